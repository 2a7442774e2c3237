/* Door of the align room: what tools use of it. */
#ifndef NPG_ALIGN_H
#define NPG_ALIGN_H

#include "pipeline/mesh.h"
#include "pipeline/work.h"

/* "dense_pose": all vertices of a mesh posed by a deformation graph of about the default size.  The mesh is a
 * loan during the call.  NPG_MEMORY, NPG_BAD_INPUT, and the visit's failures. */
npg_status npg_align_work(const npg_mesh *mesh, npg_work_visit *visit, void *user);

/* "align_frame": the reference (with normals) brought from rest to one frame's points (N x 3, unit), as the
 * stage does it by default.  Both are loans during the call.  Failures as above. */
npg_status npg_align_frame_work(npg_mesh *reference, const float *points, size_t point_count,
                                npg_work_visit *visit, void *user);

#endif
