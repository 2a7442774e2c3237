/* Failures: a status to return and one line of text per thread that says what, where and why. */
#include "pipeline/status.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define TEXT_SIZE 1024

static _Thread_local char error_text[TEXT_SIZE];

const char *npg_error_text(void)
{
    return error_text;
}

/* Control characters in file names must not break a log line. */
static void make_one_line(char *text)
{
    for (; *text; text++)
        if ((unsigned char)*text < 32 || *text == 127) *text = '?';
}

npg_status npg_error(npg_status status, const char *format, ...)
{
    char text[TEXT_SIZE]; /* an argument may be error_text itself */
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    make_one_line(text);
    memcpy(error_text, text, sizeof text);
    return status;
}

npg_status npg_error_prefix(npg_status status, const char *format, ...)
{
    if (status >= 0) return status;
    char prefix[TEXT_SIZE];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(prefix, sizeof prefix, format, arguments);
    va_end(arguments);
    return npg_error(status, "%s: %s", prefix, error_text);
}

npg_status npg_error_errno(npg_status fallback, const char *format, ...)
{
    int cause = errno;
    npg_status status = fallback;
    if (cause == ENOSPC || cause == EDQUOT || cause == EIO || cause == EROFS || cause == EFBIG)
        status = NPG_DISK;
    if (cause == ENOMEM) status = NPG_MEMORY;
    char text[TEXT_SIZE];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    return npg_error(status, "%s: %s", text, strerror(cause));
}

npg_status npg_error_restore(npg_status status, const char *text)
{
    return npg_error(status, "%s", text);
}

npg_status npg_error_set(npg_status status, const char *text)
{
    return npg_error(status, "%s", text ? text : "");
}

int npg_status_exit_code(npg_status status)
{
    switch (status) {
    case NPG_OK:
    case NPG_END: return 0;
    case NPG_STOPPED: return 75;
    case NPG_PARTIAL:
    case NPG_CHANGED: return 7;
    case NPG_USAGE: return 2;
    case NPG_BAD_INPUT: return 3;
    case NPG_DEVICE: return 4;
    case NPG_DISK: return 5;
    case NPG_MEMORY: return 6;
    case NPG_FAILED:
    case NPG_DIVERGED:
    case NPG_ABORTED: break;
    }
    return 1;
}

const char *npg_status_name(npg_status status)
{
    switch (status) {
    case NPG_OK: return "ok";
    case NPG_END: return "end";
    case NPG_STOPPED: return "stopped";
    case NPG_PARTIAL: return "partial";
    case NPG_CHANGED: return "changed";
    case NPG_FAILED: return "failed";
    case NPG_USAGE: return "usage";
    case NPG_BAD_INPUT: return "bad input";
    case NPG_DEVICE: return "device";
    case NPG_DISK: return "disk";
    case NPG_MEMORY: return "memory";
    case NPG_DIVERGED: return "diverged";
    case NPG_ABORTED: return "aborted";
    }
    return "unknown";
}

#define TEXT_OF_(x) #x
#define TEXT_OF(x)  TEXT_OF_(x)

const char *npg_version(void)
{
    return TEXT_OF(NPG_VERSION_MAJOR) "." TEXT_OF(NPG_VERSION_MINOR) "." TEXT_OF(NPG_VERSION_PATCH);
}
