/* Latch: a count that only grows, raised by one thread and waited for by others.
 *
 * Like a ring it has an end that both sides see: once aborted it stays so, and whoever waits is woken.
 * The run aborts the latches that its stages opened (npg_worker_open_latch) when it stops or fails, so a
 * wait needs neither a clock nor a look at the run.
 *
 * Threads: all functions but close from any thread. */
#ifndef NPG_LATCH_H
#define NPG_LATCH_H

#include <stdint.h>

#include "pipeline/status.h"

typedef struct npg_latch npg_latch;

npg_status npg_latch_open(npg_latch **latch, int64_t count);
void npg_latch_close(npg_latch **latch);

/* The count becomes this where it was less. */
void npg_latch_raise(npg_latch *latch, int64_t count);

/* Until the count has reached `count`: NPG_OK, or NPG_ABORTED. */
npg_status npg_latch_wait(npg_latch *latch, int64_t count);

void npg_latch_abort(npg_latch *latch);

#endif
