/* Outside: a watch on the frames of a live source that leave the box of the look-ahead. */
#ifndef NPG_OUTSIDE_H
#define NPG_OUTSIDE_H

#include <pthread.h>

#include "pipeline/stage.h"

/* A frame that lies outside the box. */
typedef struct npg_outside_frame {
    int64_t index, number;
    double share; /* by how much, in longest sides of the box */
} npg_outside_frame;

typedef struct npg_outside {
    npg_outside_frame *frames; /* in order of arrival; owned */
    size_t count, capacity;
    pthread_mutex_t lock; /* another thread may write the frames to a state on disk */
} npg_outside;

void npg_outside_open(npg_outside *outside);
void npg_outside_close(npg_outside *outside);

/* Tell when a frame lies outside [-1, 1]: the first few by name, all of them in the last word. */
npg_status npg_outside_watch(npg_worker *worker, npg_outside *outside, const npg_frame *frame);
void npg_outside_tell(npg_worker *worker, const npg_outside *outside);

/* Those that were told, to a state on disk and back: of frames that are solved, the others come again.  Any
 * thread may save. */
npg_status npg_outside_save(npg_outside *outside, npg_archive_writer *out);
npg_status npg_outside_restore(npg_outside *outside, const npg_archive *in, const npg_facts *facts);

#endif
