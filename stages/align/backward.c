/* Backward tracking: one side after the other. */
#include "align/backward.h"

#define WORSE                                                                                                \
    1.05 /* times a frame's Chamfer distance: what the way back may have, for what it says of the rest */

/* step: +1 from the first frame on, -1 from the last one. */
static npg_status sweep_side(const npg_attempts *attempts, npg_backward_result *result,
                             npg_recover_frame *frames, size_t count, int64_t key, int step)
{
    npg_start from = {0}; /* the poses of the two frames beyond */
    for (size_t i = 0; i < count; i++) {
        npg_recover_frame *frame = &frames[step > 0 ? i : count - 1 - i];
        if (step > 0 ? frame->index >= key : frame->index <= key) break;
        if (frame->is_fixed || !frame->cloud.count || !frame->since) continue;
        if (from.now) {
            const npg_prior_poses prior = {frame->pose, from.now, frame->since};
            bool taken;
            NPG_TRY(npg_attempt(attempts, &taken, frame, &from, &prior, WORSE));
            result->tried++;
            result->taken += taken;
        }
        from.before = from.now;
        from.now = frame->pose;
    }
    return NPG_OK;
}

npg_status npg_track_backward(npg_tracker *tracker, npg_backward_result *result, npg_recover_frame *frames,
                              size_t count, int64_t key, bool (*should_stop)(void *user), void *user)
{
    npg_attempts attempts = {tracker, NULL, "frames were followed back", should_stop, user};
    *result = (npg_backward_result){0};
    NPG_TRY(npg_alloc(&attempts.trial, NPG_FOR_FIT, npg_pose_bytes(npg_tracker_node_count(tracker))));
    npg_status status = sweep_side(&attempts, result, frames, count, key, 1);
    if (!status) status = sweep_side(&attempts, result, frames, count, key, -1);
    npg_release(&attempts.trial);
    return status;
}
