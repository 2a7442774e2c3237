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

/* The same with the status and text of errno: NPG_DISK for a full or failing disk,
 * NPG_MEMORY, else fallback. */
npg_status npg_error_errno(npg_status fallback, const char *format, ...) NPG_PRINTF(2, 3);

/* Take over a text kept elsewhere (a failure that came from another thread). */
npg_status npg_error_restore(npg_status status, const char *text);

/* Misuse by the caller of a public function. */
#define NPG_REQUIRE(condition)                                                                               \
    do {                                                                                                     \
        if (!(condition)) return npg_error(NPG_USAGE, "%s: needs %s", __func__, #condition);                 \
    } while (0)

/* Return what a call returned, unless it was NPG_OK. */
#define NPG_TRY(call)                                                                                        \
    do {                                                                                                     \
        npg_status try_status_ = (call);                                                                     \
        if (try_status_ != NPG_OK) return try_status_;                                                       \
    } while (0)

/* Leave for the label with what a call returned in status, unless it was NPG_OK. */
#define NPG_TRY_OR(label, status, call)                                                                      \
    do {                                                                                                     \
        (status) = (call);                                                                                   \
        if ((status) != NPG_OK) goto label;                                                                  \
    } while (0)

#ifdef __cplusplus
}
#endif

#endif
