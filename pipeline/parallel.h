/* Parallel: one piece of work split into parts that run at the same time. */
#ifndef NPG_PARALLEL_H
#define NPG_PARALLEL_H

#include <stddef.h>

#include "pipeline/status.h"

#define NPG_PARALLEL_MAX 64 /* parts that are worth it, whatever the machine */

/* Code that gcc builds for several widths of x86 processor; which one runs is settled when the program is
 * loaded (the sanitizers' start-up code can't do that).  For small loops over plain arrays. */
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define NPG_WIDE __attribute__((target_clones("default", "avx2", "arch=skylake-avx512")))
#else
#define NPG_WIDE
#endif

/* What one part does; parts may not touch what another writes. */
typedef npg_status (*npg_part)(void *user, size_t part);

/* Call part(user, 0) .. part(user, count - 1), and return when all are done: NPG_OK, or the status of the lowest
 * part that did not return it, with its error text.  Parts are taken in their order by the caller and by the
 * threads of one pool, of which there are as many as the process has cores beside the caller's; it starts with
 * the first call.  None waits for another, and any may call this itself: a caller does what no thread takes.
 * Any thread.  What comes out must not depend on how many threads there are: split by what the work is, or
 * let no part's result depend on the split. */
npg_status npg_parallel(npg_part part, void *user, size_t count);

/* Parts that are worth their threads: one per core, each of at least `least` of `count` items, no more than
 * `most` (0: as many as there are cores). */
size_t npg_parallel_parts(size_t count, size_t least, size_t most);

#endif
