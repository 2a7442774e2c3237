/* Workload: every op as work to be timed, on the data of one window. */
#ifndef NPG_WORKLOAD_H
#define NPG_WORKLOAD_H

#include "kernels/runtime/device.h"
#include "pipeline/work.h"

/* One window of a capture, unit coordinates; all of it loans. */
typedef struct npg_workload {
    const float *vert_pos, *vert_normals; /* V x 3 */
    size_t vert_count;
    const uint32_t (*edges)[2]; /* E pairs of vertices, lower index first */
    size_t edge_count;
    const float *const *points; /* T clouds, N x 3 each */
    size_t frame_count, point_count;
} npg_workload;

/* Open the ops as the fit opens them by default, and hand them to `visit` one after the other.  The decoder
 * and what follows it work on one batch of frames.  Failures are the device's, and the visit's. */
npg_status npg_kernels_work(npg_device *device, const npg_workload *load, npg_work_visit *visit, void *user);

/* The decoder alone, as it places V vertices (V x 3) of a dense surface in one frame and gives them to the
 * host. */
npg_status npg_decoder_work(npg_device *device, const float *vert_pos, size_t vert_count,
                            npg_work_visit *visit, void *user);

#endif
