/* Sweep back: one side after the other. */
#include "align/sweep_back.h"

#include <string.h>

#define WORSE                                                                                                \
    1.05 /* times a frame's Chamfer distance: what the way back may have, for what it says of the rest */

typedef struct sweep {
    npg_tracker *tracker;
    double *trial; /* K x 12; owned */
    npg_sweep_result *result;
    bool (*should_stop)(void *user);
    void *user;
} sweep;

/* The pose of a frame from those of the two beyond it; before: NULL where there is one only. */
static npg_status follow_back(sweep *s, npg_recover_frame *frame, const double *now, const double *before)
{
    const npg_hold hold = {frame->pose, now, frame->since};
    size_t nodes = npg_tracker_node_count(s->tracker), bytes = npg_pose_bytes(nodes);
    npg_tracked tracked;
    if (s->should_stop && s->should_stop(s->user))
        return npg_error(NPG_STOPPED, "stopped while frames were followed back");
    if (before)
        npg_pose_extrapolate(s->trial, now, before, nodes);
    else
        memcpy(s->trial, now, bytes);
    NPG_TRY(npg_tracker_fit(s->tracker, &tracked, s->trial, &frame->cloud, &hold, NULL));
    s->result->tried++;
    if (tracked.chamfer > WORSE * frame->tracked.chamfer) return NPG_OK;
    s->result->taken++;
    frame->tracked = tracked;
    memcpy(frame->pose, s->trial, bytes);
    return NPG_OK;
}

/* step: +1 from the first frame on, -1 from the last one. */
static npg_status sweep_side(sweep *s, npg_recover_frame *frames, size_t count, int64_t key, int step)
{
    const double *now = NULL, *before = NULL;
    for (size_t i = 0; i < count; i++) {
        npg_recover_frame *frame = &frames[step > 0 ? i : count - 1 - i];
        if (step > 0 ? frame->index >= key : frame->index <= key) break;
        if (frame->is_fixed || !frame->cloud.count || !frame->since) continue;
        if (now) NPG_TRY(follow_back(s, frame, now, before));
        before = now;
        now = frame->pose;
    }
    return NPG_OK;
}

npg_status npg_sweep_back(npg_tracker *tracker, npg_sweep_result *result, npg_recover_frame *frames,
                          size_t count, int64_t key, bool (*should_stop)(void *user), void *user)
{
    sweep s = {.tracker = tracker, .result = result, .should_stop = should_stop, .user = user};
    *result = (npg_sweep_result){0};
    NPG_TRY(npg_alloc(&s.trial, NPG_FOR_FIT, npg_pose_bytes(npg_tracker_node_count(tracker))));
    npg_status status = sweep_side(&s, frames, count, key, 1);
    if (!status) status = sweep_side(&s, frames, count, key, -1);
    npg_release(&s.trial);
    return status;
}
