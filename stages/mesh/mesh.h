/* Door of the mesh room: what tools use of it. */
#ifndef NPG_MESH_ROOM_H
#define NPG_MESH_ROOM_H

#include "pipeline/work.h"

/* Row "poisson": the surface of a cloud (N x 3) of a closed body.  Failures are those of npg_poisson() and
 * the visit's. */
npg_status npg_mesh_work(const float *points, size_t point_count, npg_work_visit *visit, void *user);

#endif
