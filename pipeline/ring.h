/* Ring: a bounded queue of chunks between two stages.  One producer thread, one consumer thread; a full ring
 * blocks the producer, and that is the pipeline's back-pressure.
 *
 * States: OPEN -> ENDED (the producer said that nothing more comes; what is inside is still delivered) or
 * ABORTED (either side; both sides return NPG_ABORTED at once and what is inside is freed).  The end is a
 * state, never a message. */
#ifndef NPG_RING_H
#define NPG_RING_H

#include <stdint.h>

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

/* Latch: a count that only grows, raised by one thread and waited for by others.
 *
 * Like a ring it has an end that both sides see: once aborted it stays so, and whoever waits is woken.
 * The run aborts the latches that its stages opened (npg_worker_open_latch) when it stops or fails, so a
 * wait needs neither a clock nor a look at the run.
 *
 * Threads: all functions but close from any thread. */

typedef struct npg_latch npg_latch;

npg_status npg_latch_open(npg_latch **latch, int64_t count);
void npg_latch_close(npg_latch **latch);

/* The count becomes this where it was less. */
void npg_latch_raise(npg_latch *latch, int64_t count);

/* Until the count has reached `count`: NPG_OK, or NPG_ABORTED. */
npg_status npg_latch_wait(npg_latch *latch, int64_t count);

void npg_latch_abort(npg_latch *latch);

#endif
