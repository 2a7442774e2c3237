/* Plan: which frames are solved together, and in what order the solving pass reads the capture.
 *
 * Windows go outward from the one that holds the keyframe: window 0 is around it,
 * then all later windows forward in time, then all earlier ones backward.
 * A window shares `overlap` frames with the one it borders on.  Windows of appended frames continue forward,
 * each with the last `overlap` frames before its new ones.
 *
 * A live source gets an ordinary plan when it ends inside the look-ahead (its results are then
 * those of the same frames from files), else an open one: frame_count is NPG_FRAMES_OPEN.
 * Under an open plan the windows are
 *   0                 around the keyframe; later frames than the look-ahead's may belong to it
 *   1 .. B            backward to frame 0; all their frames came before the plan was made
 *   B + 1, B + 2, ..  forward for as long as frames come; the first of them borders on window 0
 * so that a stage that solves window after window holds two windows of frames at most (the look-ahead and a
 * window where the source ends inside window 0), however long the source lasts.  A forward window begins
 * `overlap` frames before its new ones even where the source ends inside it, so nothing older has to be kept;
 * that last window is then shorter.
 *
 * `total` is the number of frames of the capture, -1 while the source is open; in a fusing pass, which walks
 * the look-ahead alone, the number of these.  It matters to open plans only.
 * Once it is known (in a stage's flush: npg_facts.frame_count) the windows that reach beyond the end are
 * shorter: a stage that waits for a window asks for it again and finds that it has all its frames. */
#ifndef NPG_PLAN_H
#define NPG_PLAN_H

#include <stdbool.h>

#include "pipeline/status.h"

#define NPG_FRAMES_OPEN (INT64_MAX / 4)

typedef struct npg_plan {
    int64_t frame_count; /* T, or NPG_FRAMES_OPEN                              */
    int64_t key;         /* index of the keyframe                              */
    int64_t window;      /* frames per window; >= T: one joint window over all */
    int64_t overlap;     /* frames shared with the neighbour, < window         */
    /* of a run that is continued with frames which came later; all 0 without */
    int64_t appended_at; /* frames before this one are solved; the windows are those of the rest, forward */
    int64_t first_count; /* frame_count of the first plan: it decides where the window of the keyframe lies */
} npg_plan;

typedef struct npg_window {
    int64_t first, last;         /* frames first..last, both inclusive             */
    int64_t new_first, new_last; /* the frames no earlier window has solved        */
    int direction;               /* 0 around the keyframe, +1 forward, -1 backward */
} npg_window;

static inline bool npg_plan_is_open(const npg_plan *plan)
{
    return plan->frame_count == NPG_FRAMES_OPEN;
}

/* The length of windows for an option: < 0 chooses by the frames that there are (INT64_MAX: no end is known),
 * 0 is one joint window. */
int64_t npg_plan_window_asked(int64_t option, int64_t frame_count);

/* The plan for frame_count frames when those of `plan` are solved. */
npg_plan npg_plan_append(const npg_plan *plan, int64_t frame_count);

/* The window around the keyframe, solved now or long ago. */
npg_window npg_plan_key_window(const npg_plan *plan, int64_t total);

/* INT64_MAX for an open plan whose total is not known. */
int64_t npg_plan_window_count(const npg_plan *plan, int64_t total);

/* Window i < npg_plan_window_count(). */
npg_window npg_plan_window(const npg_plan *plan, int64_t i, int64_t total);

/* True for the window that holds the last frame in time: later frames continue from there. */
bool npg_plan_is_last_forward(const npg_plan *plan, int64_t i);

/* Frames that the solving pass reads. */
int64_t npg_plan_read_count(const npg_plan *plan);

/* The i-th frame to read (0 <= i < read count): the keyframe first, then those after it in window 0 and those
 * before it, then each window's new frames; each next to one that came before.  Every frame comes once.  Under an
 * open plan those beyond the end never come. */
int64_t npg_plan_frame(const npg_plan *plan, int64_t i);

/* Its inverse: the place of a frame in that order. */
int64_t npg_plan_place(const npg_plan *plan, int64_t index);

/* How many frames have been read when window i can be solved: it brings their last. */
int64_t npg_plan_read_before(const npg_plan *plan, int64_t i, int64_t total);

/* The place in the order that follows `read` frames: those that lie behind the end of the source never came.
 * The frame before it is the last that came. */
int64_t npg_plan_next_place(const npg_plan *plan, int64_t read, int64_t total);

/* Whether the frame is one of the first `read` that came. */
bool npg_plan_is_read(const npg_plan *plan, int64_t index, int64_t read, int64_t total);

/* Whether a window after window i holds the frame: until then it must be kept. */
bool npg_plan_is_needed_after(const npg_plan *plan, int64_t index, int64_t i, int64_t total);

#endif
