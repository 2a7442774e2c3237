/* Query as work to be timed: the closest points of a surface. */
#ifndef NPG_QUERY_WORK_H
#define NPG_QUERY_WORK_H

#include "pipeline/mesh.h"
#include "pipeline/work.h"

/* Row "surface_closest": N points (N x 3) against the mesh.  Failures are NPG_MEMORY and the visit's. */
npg_status npg_query_work(const npg_mesh *mesh, const float *points, size_t point_count,
                          npg_work_visit *visit, void *user);

#endif
