/* Attempt: one fit, compared. */
#include "align/attempt.h"

#include <string.h>

#include "align/pose.h"

npg_status npg_attempt(const npg_attempts *a, bool *taken, npg_recover_frame *frame, const npg_start *from,
                       const npg_prior_poses *poses, double share)
{
    size_t nodes = npg_tracker_node_count(a->tracker), bytes = npg_pose_bytes(nodes);
    npg_tracked tracked;
    *taken = false;
    if (a->should_stop && a->should_stop(a->user)) return npg_error(NPG_STOPPED, "stopped while %s", a->what);
    if (from->before)
        npg_pose_extrapolate(a->trial, from->now, from->before, nodes);
    else
        memcpy(a->trial, from->now, bytes);
    NPG_TRY(npg_tracker_fit(a->tracker, &tracked, a->trial, &frame->cloud, poses, from->effort));
    if (tracked.chamfer > share * frame->tracked.chamfer) return NPG_OK;
    *taken = true;
    frame->tracked = tracked;
    memcpy(frame->pose, a->trial, bytes);
    return NPG_OK;
}
