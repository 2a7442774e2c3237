/* Live plan: the windows of a capture whose end is not known yet.
 *
 * A live source gets an ordinary plan when it ends inside the look-ahead (its results are then
 * those of the same frames from files), else an open one: plan.frame_count is NPG_FRAMES_OPEN.
 * Under an open plan the windows are
 *   0                 around the keyframe; later frames than the look-ahead's may belong to it
 *   1 .. B            backward to frame 0; all their frames came before the plan was made
 *   B + 1, B + 2, ..  forward for as long as frames come; the first of them starts from window 0
 * so that a stage that solves window after window holds two windows of frames at most (the look-ahead and a
 * window where the source ends inside window 0), however long the source lasts.  A forward window begins
 * `overlap` frames before its new ones even where the source ends inside it, so nothing older has to be kept;
 * that last window is then shorter.  The functions take both kinds of plans; an ordinary one gives what
 * pipeline/plan.h gives.
 *
 * `total` is the number of frames of the capture, -1 while the source is open; in a fusing pass, which walks
 * the look-ahead alone, the number of these.  It matters to open plans only.
 * Once it is known (in a stage's flush: npg_facts.frame_count) the windows that reach beyond the end are
 * shorter: a stage that waits for a window asks for it again and finds that it has all its frames. */
#ifndef NPG_LIVE_PLAN_H
#define NPG_LIVE_PLAN_H

#include <stdbool.h>

#include "pipeline/plan.h"

#define NPG_FRAMES_OPEN (INT64_MAX / 4)

static inline bool npg_plan_is_open(const npg_plan *plan)
{
    return plan->frame_count == NPG_FRAMES_OPEN;
}

/* INT64_MAX for an open plan whose total is not known. */
int64_t npg_live_window_count(const npg_plan *plan, int64_t total);

/* Window i < npg_live_window_count(). */
npg_window npg_live_window(const npg_plan *plan, int64_t i, int64_t total);

/* The i-th frame that the solving pass brings: the keyframe, the others of window 0, then each window's new
 * frames.  Under an open plan every i >= 0 has one; those beyond the end never come. */
int64_t npg_live_frame(const npg_plan *plan, int64_t i);

/* Its inverse: the place of a frame in that order. */
int64_t npg_live_place(const npg_plan *plan, int64_t index);

/* How many frames have come when window i can be solved. */
int64_t npg_live_read_before(const npg_plan *plan, int64_t i, int64_t total);

/* The place in the order that follows `read` frames: those that lie behind the end of the source never came.
 * The frame before it is the last that came. */
int64_t npg_live_next_place(const npg_plan *plan, int64_t read, int64_t total);

/* Whether the frame is one of the first `read` that came. */
bool npg_live_is_read(const npg_plan *plan, int64_t index, int64_t read, int64_t total);

/* Whether a window after window i starts from window 0. */
bool npg_live_is_first_needed_after(const npg_plan *plan, int64_t i, int64_t total);

/* Whether a window after window i holds the frame: until then it must be kept. */
bool npg_live_is_needed_after(const npg_plan *plan, int64_t index, int64_t i, int64_t total);

#endif
