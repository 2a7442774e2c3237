/* Backward tracking: frames of which sensors saw a part each, followed once more from the outermost to the key.
 *
 * Outward from the key a limb that comes into sight again is not where the pose has it: what was hidden has
 * moved meanwhile.  It is found some frames later, or only at the end.  From there the frames are followed
 * back: each one from the motion of the two beyond it, what no sensor sees held between where it was seen
 * last and where it is seen next (occlusion_prior.h).  A pose stays as it was where the way back explains the frame's
 * points clearly worse.  Not in the paper. */
#ifndef NPG_BACKWARD_H
#define NPG_BACKWARD_H

#include "align/recover.h"

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
