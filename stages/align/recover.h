/* Recover: frames that the tracker lost, tried again from what is known of the frames around them.
 *
 * Frame by frame, outward from the key, a pose can only start from the frames before it; where the motion is
 * too fast for that, frames are lost and lead those after them astray.  But among the frames of a window some
 * are found, and each of them is a place to start from.  So a lost frame is tried again from
 *
 *     1  the poses of the frames whose points look most like its own, where those fit better: motion recurs;
 *        moved to where the body stands in this frame (rigid_icp.h), as it seldom recurs in place
 *     2  the poses of the frame before it and of the one after it, moved likewise
 *     3  the motion of the two frames before it, and of the two after it, taken on
 *     4  the poses of the frame before it and of the one after it
 *
 * and the pose that explains its points best stays.  What is found helps the frames around it, so this is
 * repeated until none is found.  A frame is lost when its Chamfer distance is well above that of the
 * window's best quarter, and so are its points' distances alone: a frame with fewer points or with holes has
 * surface far from them, too, and what it is then found by is a worse pose.  Not in the paper. */
#ifndef NPG_RECOVER_H
#define NPG_RECOVER_H

#include "align/tracker.h"

/* A frame of a group.  pose and points are the caller's; the pose is changed where a better one is found. */
typedef struct npg_recover_frame {
    int64_t index;
    double *pose; /* K x 12 */
    npg_tracked tracked;
    npg_tracker_cloud cloud; /* count 0: nothing is known of the frame, its pose is not started from either;
                                of a fixed frame the points may be NULL */
    const float *since;      /* K: frames since a sensor saw what a node carries, or NULL: not known        */
    bool is_fixed;           /* of the group before: a place to start from, no more                         */
} npg_recover_frame;

/* Who tries, and what for.  should_stop may be NULL; it is asked before each fit. */
typedef struct npg_attempts {
    npg_tracker *tracker;
    double *trial;    /* K x 12, scratch; the caller's                     */
    const char *what; /* is done with frames, for the error: "followed on" */
    bool (*should_stop)(void *user);
    void *user;
} npg_attempts;

/* Where an attempt starts. */
typedef struct npg_start {
    const double *now, *before;       /* K x 12; before: NULL, or the motion since then goes on */
    const npg_tracker_effort *effort; /* NULL: the usual one */
} npg_start;

/* Fit the frame from there, hidden parts held by `poses`.  *taken: whether its pose and what was tracked
 * become the new ones, those of a Chamfer distance of at most `share` times the old one.  NPG_STOPPED,
 * NPG_MEMORY, NPG_DIVERGED. */
npg_status npg_attempt(const npg_attempts *attempts, bool *taken, npg_recover_frame *frame,
                       const npg_start *from, const npg_prior_poses *poses, double share);

/* What was done; frames. */
typedef struct npg_recover_result {
    int64_t tried; /* fits                       */
    int64_t lost;  /* frames that were lost      */
    int64_t found; /* of those, lost no longer   */
} npg_recover_result;

/* Recover the frames (in order of their indices).  should_stop may be NULL; it is asked before each fit.
 * Equal input gives equal bits.  NPG_MEMORY, NPG_DIVERGED, NPG_STOPPED. */
npg_status npg_recover(npg_tracker *tracker, npg_recover_result *result, npg_recover_frame *frames,
                       size_t count, bool (*should_stop)(void *user), void *user);

/* Backward tracking: frames of which sensors saw a part each, followed once more from the outermost to the key.
 *
 * Outward from the key a limb that comes into sight again is not where the pose has it: what was hidden has
 * moved meanwhile.  It is found some frames later, or only at the end.  From there the frames are followed
 * back: each one from the motion of the two beyond it, what no sensor sees held between where it was seen
 * last and where it is seen next (occlusion_prior.h).  A pose stays as it was where the way back explains the frame's
 * points clearly worse.  Not in the paper. */
/* What was done; frames. */
typedef struct npg_backward_result {
    int64_t tried; /* fits                              */
    int64_t taken; /* whose pose is that of the way back */
} npg_backward_result;

/* Sweep both sides of the key over the frames (in order of their indices); those that are fixed, without
 * points or without `since` keep their pose.  should_stop may be NULL; it is asked before each fit.  Equal
 * input gives equal bits.  NPG_MEMORY, NPG_DIVERGED, NPG_STOPPED. */
npg_status npg_track_backward(npg_tracker *tracker, npg_backward_result *result, npg_recover_frame *frames,
                              size_t count, int64_t key, bool (*should_stop)(void *user), void *user);

#endif
