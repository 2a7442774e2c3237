/* Source: the bytes of one file or stream through a sliding window. */
#include "pipeline/source.h"

#include <errno.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "pipeline/file.h"
#include "pipeline/memory.h"

#define WINDOW_SIZE  ((size_t)256 << 10) /* set by trial */
#define STOP_POLL_MS 250                 /* a stop is noticed within that; source.h says so */

static npg_status refuse_unreadable(const char *name, int cause)
{
    return npg_error(cause == ENOMEM ? NPG_MEMORY : NPG_BAD_INPUT, "%s: can't be read: %s", name,
                     strerror(cause));
}

npg_status npg_source_open_fd(npg_source **out, int fd, const char *name)
{
    struct stat info;
    *out = NULL;
    if (fstat(fd, &info)) return refuse_unreadable(name, errno);
    if (S_ISDIR(info.st_mode)) return refuse_unreadable(name, EISDIR);
    NPG_TRY(npg_object_open(out, NPG_FOR_FILES, sizeof **out));
    npg_source *source = *out;
    /* A file that was opened elsewhere may stand behind its beginning: its size then says nothing. */
    bool is_file = S_ISREG(info.st_mode) && lseek(fd, 0, SEEK_CUR) == 0;
    /* A small file needs no more than its own size, so that many small frames stay cheap. */
    size_t window = WINDOW_SIZE;
    if (is_file && info.st_size < (off_t)WINDOW_SIZE) window = (size_t)info.st_size + 1;
    source->fd = fd;
    source->is_seekable = is_file;
    source->size = is_file ? (uint64_t)info.st_size : UINT64_MAX;
    source->line_end = '\n';
    source->name = npg_arena_text(&source->arena, name);
    npg_status status = npg_arena_grow(&source->arena, &source->window, &source->capacity, window, 1);
    if (status) npg_source_close(out);
    return status;
}

npg_status npg_source_open_file(npg_source **out, const char *path)
{
    *out = NULL;
    int fd;
    NPG_TRY(npg_file_open_plain(&fd, path, NPG_BAD_INPUT));
    npg_status status = npg_source_open_fd(out, fd, path);
    if (status)
        close(fd);
    else
        (*out)->owns_fd = true;
    return status;
}

void npg_source_close(npg_source **source)
{
    if (*source && (*source)->owns_fd) close((*source)->fd);
    npg_object_close(source);
}

npg_status npg_source_rewind(npg_source *source)
{
    NPG_REQUIRE(source->is_seekable);
    if (lseek(source->fd, 0, SEEK_SET) < 0) return refuse_unreadable(source->name, errno);
    source->begin = source->end = 0;
    source->byte = source->line = 0;
    source->at_end = false;
    return NPG_OK;
}

/* A read from a pipe may last for ever: ask meanwhile whether the run is to stop. */
static npg_status wait_for_bytes(npg_source *source)
{
    struct pollfd wanted = {source->fd, POLLIN, 0};
    while (source->stopping && !source->is_seekable) {
        if (source->stopping(source->user)) return npg_error(NPG_STOPPED, "%s: stopped", source->name);
        int ready = poll(&wanted, 1, STOP_POLL_MS);
        if (ready > 0 || (ready < 0 && errno != EINTR)) break;
    }
    return NPG_OK;
}

static npg_status read_some(npg_source *source)
{
    for (;;) {
        NPG_TRY(wait_for_bytes(source));
        ssize_t got = read(source->fd, source->window + source->end, source->capacity - source->end);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) return refuse_unreadable(source->name, errno);
        source->at_end = got == 0;
        source->end += (size_t)got;
        return NPG_OK;
    }
}

npg_status npg_source_fill(npg_source *source, size_t need, size_t *available)
{
    while (source->end - source->begin < need && !source->at_end) {
        if (source->begin) {
            memmove(source->window, source->window + source->begin, source->end - source->begin);
            source->end -= source->begin;
            source->begin = 0;
        }
        if (source->end == source->capacity)
            NPG_TRY(
                npg_arena_grow(&source->arena, &source->window, &source->capacity, source->capacity + 1, 1));
        NPG_TRY(read_some(source));
    }
    *available = source->end - source->begin;
    return NPG_OK;
}

npg_status npg_source_skip(npg_source *source, uint64_t size, uint64_t *skipped)
{
    *skipped = 0;
    while (*skipped < size) {
        size_t available;
        NPG_TRY(npg_source_fill(source, 1, &available));
        if (!available) return NPG_OK;
        uint64_t step = size - *skipped < available ? size - *skipped : available;
        npg_source_take(source, (size_t)step);
        *skipped += step;
    }
    return NPG_OK;
}

uint64_t npg_source_left(const npg_source *source)
{
    if (source->size == UINT64_MAX) return UINT64_MAX;
    return source->size > source->byte ? source->size - source->byte : 0;
}

npg_status npg_source_line(npg_source *source, const char **text, size_t *length)
{
    size_t searched = 0, available = source->end - source->begin;
    const unsigned char *end = NULL;
    for (;;) {
        end = memchr(npg_source_data(source) + searched, source->line_end, available - searched);
        if (end) break;
        searched = available;
        NPG_TRY(npg_source_fill(source, available + 1, &available));
        if (available == searched) break;
        if (searched > NPG_LINE_MAX) {
            source->line++;
            return npg_source_bad_line(source, "longer than %zu bytes", NPG_LINE_MAX);
        }
    }
    if (!end && !available) return NPG_END;
    *text = (const char *)npg_source_data(source);
    size_t taken = end ? (size_t)(end - npg_source_data(source)) + 1 : available;
    *length = end ? taken - 1 : taken;
    while (*length && (*text)[*length - 1] == '\r') --*length; /* line ends of Windows */
    npg_source_take(source, taken);
    source->line++;
    return NPG_OK;
}

npg_status npg_source_row(npg_source *source, const char **at, const char **end)
{
    size_t length;
    do {
        NPG_TRY(npg_source_line(source, at, &length));
        *end = *at + length;
        *at = npg_skip_blanks(*at, *end);
    } while (*at == *end);
    return NPG_OK;
}

npg_status npg_source_number(const npg_source *source, double *value, const char **at, const char *end)
{
    const char *after = npg_number_parse(*at, end, value);
    int shown = end - *at > 30 ? 30 : (int)(end - *at);
    if (!after) return npg_source_bad_line(source, "\"%.*s\" is not a number", shown, *at);
    *at = npg_skip_blanks(after, end);
    return NPG_OK;
}

npg_status npg_source_words(npg_source *source, npg_words *line)
{
    const char *text;
    char *rest = NULL;
    size_t length;
    npg_status status = npg_source_line(source, &text, &length);
    if (status == NPG_END) return npg_source_bad_line(source, "the file ends inside the header");
    if (status) return status;
    if (length > NPG_WORDS_LINE) return npg_source_bad_line(source, "header line of %zu bytes", length);
    if (memchr(text, 0, length)) return npg_source_bad_line(source, "zero byte in the header");
    memcpy(line->text, text, length);
    line->text[length] = 0;
    line->count = 0;
    for (char *word = strtok_r(line->text, " \t", &rest); word; word = strtok_r(NULL, " \t", &rest)) {
        if (line->count == NPG_WORDS_MAX)
            return npg_source_bad_line(source, "header line of more than %d words", NPG_WORDS_MAX);
        line->words[line->count++] = word;
    }
    return NPG_OK;
}

npg_status npg_source_count(const npg_source *source, uint64_t *count, const char *text)
{
    size_t digits = strspn(text, "0123456789");
    if (!digits || text[digits]) return npg_source_bad_line(source, "\"%.40s\" is not a count", text);
    if (digits > 15) return npg_source_bad_line(source, "impossible count %.40s", text);
    *count = strtoull(text, NULL, 10);
    return NPG_OK;
}

npg_status npg_source_find_line_end(npg_source *source)
{
    size_t available;
    NPG_TRY(npg_source_fill(source, (size_t)64 << 10, &available));
    bool has_lf = memchr(npg_source_data(source), '\n', available) != NULL;
    bool has_cr = memchr(npg_source_data(source), '\r', available) != NULL;
    source->line_end = has_cr && !has_lf ? '\r' : '\n';
    return NPG_OK;
}

npg_status npg_source_bad(const npg_source *source, const char *unit, uint64_t place, const char *format, ...)
{
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    return npg_error(NPG_BAD_INPUT, "%s: %s %llu: %s", source->name, unit, (unsigned long long)place, text);
}
