/* Look-ahead: the frames of a live source that wait for their turn, first for the choice of the keyframe,
 * then for the order of the plan; and a watch on what leaves the box that was chosen with them. */
#ifndef NPG_LOOK_AHEAD_H
#define NPG_LOOK_AHEAD_H

#include "pipeline/stage.h"

typedef struct npg_look_ahead {
    npg_frame *frames; /* owned, with what they own; in order of arrival */
    size_t count, capacity;
    int64_t next; /* place in the plan's order of the frame that goes next */
    /* of the frames that went past after the box was set */
    int64_t outside_count, worst_number;
    double worst_share;
} npg_look_ahead;

/* Take over *frame; it is emptied. */
npg_status npg_look_ahead_add(npg_look_ahead *held, npg_frame *frame);

/* One more than the highest index that came. */
int64_t npg_look_ahead_frame_count(const npg_look_ahead *held);

/* Push on every frame whose turn it is, one per chunk, is_key and NPG_FIELD_KEY set; at_end: the source has
 * ended, and those that are left go in the plan's order whatever is missing between them.  NPG_FAILED when
 * the turn is at a frame that never came although `limit` others wait. */
npg_status npg_look_ahead_release(npg_worker *worker, npg_look_ahead *held, size_t limit, bool at_end);

/* Tell when a frame lies outside [-1, 1]: the first few by name, all of them in the last word. */
void npg_look_ahead_watch(npg_worker *worker, npg_look_ahead *held, const npg_frame *frame);
void npg_look_ahead_tell_outside(npg_worker *worker, const npg_look_ahead *held);

void npg_look_ahead_clear(npg_look_ahead *held);

#endif
