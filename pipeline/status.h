/* Failures: a status to return and one line of text per thread that says what, where and why. */
#ifndef NPG_STATUS_H
#define NPG_STATUS_H

#include "neupig.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Set this thread's error text and return status, so that a failure is one line: return npg_error(...). */
npg_status npg_error(npg_status status, const char *format, ...) NPG_PRINTF(2, 3);

/* Put "<prefix>: " before the text of the failure under way and return status;
 * does nothing for status >= 0. */
npg_status npg_error_prefix(npg_status status, const char *format, ...) NPG_PRINTF(2, 3);

/* Put "; <what to do>" behind it, likewise. */
npg_status npg_error_advise(npg_status status, const char *what);
#define NPG_ADVISE_KEEP_GOING "--keep-going goes on without such frames"

/* As npg_error(), with the status and text of errno: NPG_DISK for a full or failing disk,
 * NPG_MEMORY, else fallback. */
npg_status npg_error_errno(npg_status fallback, const char *format, ...) NPG_PRINTF(2, 3);

/* Misuse by the caller of a public function. */
#define NPG_REQUIRE(condition)                                                                               \
    do {                                                                                                     \
        if (!(condition)) return npg_error(NPG_USAGE, "%s: needs %s", __func__, #condition);                 \
    } while (0)

/* Cleaning up after a failure: one way everywhere, without goto.
 *
 *   - A function that holds nothing returns at once: NPG_TRY(call).
 *   - A function that holds something frees it in one place, at its end, whether things went well or not.
 *     What it frees begins as NULL (closers take that), calls are chained, and work between calls that
 *     can fail becomes a function of its own, which holds nothing:
 *
 *         npg_status status = npg_alloc_array(&index, NPG_FOR_MESH, count, sizeof *index);
 *         if (!status) status = npg_kdtree_open(&tree, points, count);
 *         if (!status) status = measure(index, tree);
 *         npg_kdtree_close(&tree);
 *         npg_release(&index);
 *         return status;
 *
 *   - A function that hands out what it opens closes it before it returns a failure:
 *
 *         if (status) npg_thing_close(&thing);
 *         *out = thing;
 *         return status;
 *
 *   - What only one call needs (a path) is freed right after it, then NPG_TRY(status). */

/* Return what a call returned, unless it was NPG_OK. */
#define NPG_TRY(call)                                                                                        \
    do {                                                                                                     \
        npg_status try_status_ = (call);                                                                     \
        if (try_status_ != NPG_OK) return try_status_;                                                       \
    } while (0)

#ifdef __cplusplus
}
#endif

#endif
