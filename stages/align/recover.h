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

#include "align/attempt.h"

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

#endif
