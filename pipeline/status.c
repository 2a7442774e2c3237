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

npg_status npg_error_advise(npg_status status, const char *what)
{
    return status >= 0 ? status : npg_error(status, "%s; %s", error_text, what);
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

npg_status npg_error_set(npg_status status, const char *text)
{
    return npg_error(status, "%s", text ? text : "");
}

static const struct word {
    npg_status status;
    int exit_code;
    const char *name;
} words[] = {{NPG_OK, 0, "ok"},
             {NPG_END, 0, "end"},
             {NPG_STOPPED, 75, "stopped"},
             {NPG_PARTIAL, 7, "partial"},
             {NPG_CHANGED, 7, "changed"},
             {NPG_FAILED, 1, "failed"},
             {NPG_USAGE, 2, "usage"},
             {NPG_BAD_INPUT, 3, "bad input"},
             {NPG_DEVICE, 4, "device"},
             {NPG_DISK, 5, "disk"},
             {NPG_MEMORY, 6, "memory"},
             {NPG_DIVERGED, 1, "diverged"},
             {NPG_ABORTED, 1, "aborted"}};

static struct word word_of(npg_status status)
{
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (words[i].status == status) return words[i];
    return (struct word){status, 1, "unknown"};
}

int npg_status_exit_code(npg_status status)
{
    return word_of(status).exit_code;
}

const char *npg_status_name(npg_status status)
{
    return word_of(status).name;
}

#define TEXT_OF_(x) #x
#define TEXT_OF(x)  TEXT_OF_(x)

const char *npg_version(void)
{
    return TEXT_OF(NPG_VERSION_MAJOR) "." TEXT_OF(NPG_VERSION_MINOR) "." TEXT_OF(NPG_VERSION_PATCH);
}
