/* Look-ahead: the frames of a live source that wait for their turn, first for the choice of the keyframe,
 * then for the order of the plan; and a watch on what leaves the box that was chosen with them. */
#ifndef NPG_LOOK_AHEAD_H
#define NPG_LOOK_AHEAD_H

#include <pthread.h>

#include "pipeline/stage.h"

/* A frame that lies outside the box. */
typedef struct npg_outside {
    int64_t index, number;
    double share; /* by how much, in longest sides of the box */
} npg_outside;

typedef struct npg_look_ahead {
    npg_frame *frames; /* owned, with what they own; in order of arrival */
    size_t count, capacity;
    int64_t next;         /* place in the plan's order of the frame that goes next */
    npg_outside *outside; /* of the frames that went past after the box was set; owned */
    size_t outside_count, outside_capacity;
    pthread_mutex_t *lock; /* of outside: another thread may write it to a state on disk; a loan */
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
npg_status npg_look_ahead_watch(npg_worker *worker, npg_look_ahead *held, const npg_frame *frame);
void npg_look_ahead_tell_outside(npg_worker *worker, const npg_look_ahead *held);

/* Those that were told, to a state on disk and back: of frames that are solved, the others come again.  Any
 * thread may save. */
npg_status npg_look_ahead_save(const npg_look_ahead *held, npg_archive_writer *out);
npg_status npg_look_ahead_restore(npg_look_ahead *held, const npg_archive *in, const npg_facts *facts);

void npg_look_ahead_clear(npg_look_ahead *held);

#endif
