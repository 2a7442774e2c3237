/* Attempt: a frame that has a pose is fitted once more from another one, and keeps the better. */
#ifndef NPG_ATTEMPT_H
#define NPG_ATTEMPT_H

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

#endif
