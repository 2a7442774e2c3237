/* Plan: which frames are solved together, and in what order the solving pass reads the capture.
 *
 * Windows go outward from the one that holds the keyframe: window 0 is around it,
 * then all later windows forward in time, then all earlier ones backward.
 * A window shares `overlap` frames with the one it starts from.  Windows of appended frames continue forward,
 * each with the last `overlap` frames before its new ones. */
#ifndef NPG_PLAN_H
#define NPG_PLAN_H

#include <stdbool.h>

#include "pipeline/status.h"

typedef struct npg_plan {
    int64_t frame_count; /* T                                                  */
    int64_t key;         /* index of the keyframe                              */
    int64_t window;      /* frames per window; >= T: one joint window over all */
    int64_t overlap;     /* frames shared with the neighbour, < window         */
    /* of a run that is continued with frames which came later; all 0 without */
    int64_t appended_at; /* frames before this one are solved; the windows are those of the rest, forward */
    int64_t first_count; /* frame_count of the first plan: it decides where the window of the keyframe lies */
} npg_plan;

typedef struct npg_window {
    int64_t first, last;         /* frames first..last, both inclusive             */
    int64_t from;                /* the window it starts from, -1 for window 0     */
    int64_t new_first, new_last; /* the frames no earlier window has solved        */
    int direction;               /* 0 around the keyframe, +1 forward, -1 backward */
} npg_window;

/* The length of windows for an option: < 0 chooses by the frames that there are (INT64_MAX: no end is known),
 * 0 is one joint window. */
int64_t npg_plan_window_asked(int64_t option, int64_t frame_count);

/* The plan for frame_count frames when those of `plan` are solved. */
npg_plan npg_plan_append(const npg_plan *plan, int64_t frame_count);

/* The window around the keyframe, solved now or long ago. */
npg_window npg_plan_key_window(const npg_plan *plan);

/* Frames that the solving pass reads. */
int64_t npg_plan_read_count(const npg_plan *plan);

/* How many of them are read before window i can be solved: it brings their last. */
int64_t npg_plan_read_before(const npg_plan *plan, int64_t i);

/* True for the window that holds the last frame in time: later frames continue from there. */
bool npg_plan_is_last_forward(const npg_plan *plan, int64_t i);

int64_t npg_plan_window_count(const npg_plan *plan);
npg_window npg_plan_window(const npg_plan *plan, int64_t i);

/* The i-th frame to read (0 <= i < read count): the keyframe first, then those after it in window 0 and those
 * before it, then each window's new frames; each next to one that came before.  Every frame comes once. */
int64_t npg_plan_frame(const npg_plan *plan, int64_t i);

#endif
