/* Door of the optimize room: what tools use of it. */
#ifndef NPG_OPTIMIZE_H
#define NPG_OPTIMIZE_H

#include "kernels/runtime/device.h"
#include "pipeline/mesh.h"
#include "pipeline/work.h"

/* "dense_carry": all vertices of a mesh carried by the default number of fitted samples.  The mesh, with
 * normals, is a loan during the call.  NPG_MEMORY, NPG_BAD_INPUT, and the visit's failures. */
npg_status npg_carry_work(const npg_mesh *mesh, npg_work_visit *visit, void *user);

/* Called when a fit is set up (epoch -1), then after each epoch from 0 on; a failure ends the fit. */
typedef npg_status npg_epoch_visit(void *user, int64_t epoch);

/* Fit one window with the default options, but for the number of epochs, and throw the result away: what
 * neupig bench times.  mesh has normals, unit coordinates; points: T clouds of N x 3; all are loans. */
npg_status npg_fit_once(npg_device *device, const npg_mesh *mesh, const float *const *points,
                        size_t point_count, size_t frame_count, int64_t epochs, npg_epoch_visit *visit,
                        void *user);

#endif
