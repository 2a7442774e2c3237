/* Ring: a bounded queue of chunks between two stages.  One producer thread, one consumer thread; a full ring
 * blocks the producer, and that is the pipeline's back-pressure.
 *
 * States: OPEN -> ENDED (the producer said that nothing more comes; what is inside is still delivered) or
 * ABORTED (either side; both sides return NPG_ABORTED at once and what is inside is freed).  The end is a
 * state, never a message. */
#ifndef NPG_RING_H
#define NPG_RING_H

#include "pipeline/chunk.h"

typedef struct npg_ring npg_ring;

/* A ring for up to capacity >= 1 chunks. */
npg_status npg_ring_open(npg_ring **ring, size_t capacity);
void npg_ring_close(npg_ring **ring);

/* Put *chunk in, waiting while the ring is full.  On NPG_OK the ring owns it and *chunk is NULL; on
 * NPG_ABORTED it is still the caller's.  Pushing after npg_ring_end() is NPG_USAGE. */
npg_status npg_ring_push(npg_ring *ring, npg_chunk **chunk);

/* Take the oldest chunk, waiting while the ring is empty and open.  NPG_END: ended
 * and empty.  NPG_ABORTED. */
npg_status npg_ring_pop(npg_ring *ring, npg_chunk **chunk);

void npg_ring_end(npg_ring *ring);
void npg_ring_abort(npg_ring *ring);

/* Seconds the producer waited for room, and the consumer for chunks, so far. */
void npg_ring_waits(npg_ring *ring, double *push_wait_s, double *pop_wait_s);

#endif
