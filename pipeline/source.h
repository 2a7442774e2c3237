#ifndef NPG_PIPELINE_SOURCE_H
#define NPG_PIPELINE_SOURCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "pipeline/memory.h"

/* Number: decimal numbers from text, fast and the same under every locale. */

/* The number that begins at text (no leading space): [+-]digits[.digits][e[+-]digits], nan, inf, infinity and
 * what older Windows libraries print for them (1.#IND, 1.#INF).  Returns the first byte after it, NULL when
 * there is none or it does not end before a space, a separator (',', ';') or the end. */
const char *npg_number_parse(const char *text, const char *end, double *value);

/* A number as printf writes it with this format (one double), with a decimal point in every locale;
 * returns the length. */
size_t npg_number_print(char *out, size_t size, const char *format, double value);

/* The first byte at or after text that is neither space, tab nor carriage return. */
static inline const char *npg_skip_blanks(const char *text, const char *end)
{
    while (text < end && (*text == ' ' || *text == '\t' || *text == '\r' || *text == '\v' || *text == '\f'))
        text++;
    return text;
}

/* Bytes: numbers in the byte order that a file format asks for, on any machine. */

/* The low `size` bytes of a number, least significant first; returns size. */
static inline size_t npg_put_little(unsigned char *out, uint64_t bits, size_t size)
{
    for (size_t i = 0; i < size; i++) out[i] = (unsigned char)(bits >> (8 * i));
    return size;
}

/* The same, most significant first. */
static inline size_t npg_put_big(unsigned char *out, uint64_t bits, size_t size)
{
    for (size_t i = 0; i < size; i++) out[i] = (unsigned char)(bits >> (8 * (size - 1 - i)));
    return size;
}

static inline uint32_t npg_float_bits(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static inline uint64_t npg_double_bits(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

/* Source: the bytes of one file or stream through a sliding window, with byte and line for messages.
 *
 * A source never holds more than its window, which grows only while one line or one binary row that really is
 * in the file needs it.  Failures are NPG_BAD_INPUT with the source's name.  Threads: one user at a time. */

#define NPG_LINE_MAX ((size_t)1 << 20) /* longer lines are refused */

typedef struct npg_source {
    npg_arena arena; /* of name and window */
    char *name;      /* for messages */
    int fd;
    bool owns_fd, is_seekable, at_end;
    char line_end; /* '\n', or '\r' for files that know no '\n' */
    uint64_t size; /* of the whole file; UINT64_MAX where it can't be known */
    uint64_t byte; /* offset of data[0] in the file */
    uint64_t line; /* number of the line npg_source_line() gave last, 1 for the first */
    unsigned char *window;
    size_t capacity, begin, end;
    /* asked about four times a second while a stream has nothing; may be NULL */
    bool (*stopping)(void *user);
    void *user;
} npg_source;

npg_status npg_source_open_file(npg_source **source, const char *path);

/* fd is a loan and is read from where it stands. */
npg_status npg_source_open_fd(npg_source **source, int fd, const char *name);
void npg_source_close(npg_source **source);

/* Go back to the first byte; only where is_seekable. */
npg_status npg_source_rewind(npg_source *source);

/* Make `need` bytes stand at npg_source_data(), fewer only at the end of the source; *available says how many
 * do.  NPG_STOPPED when stopping() said so. */
npg_status npg_source_fill(npg_source *source, size_t need, size_t *available);

static inline const unsigned char *npg_source_data(const npg_source *source)
{
    return source->window + source->begin;
}

/* Step over bytes that npg_source_fill() made available. */
static inline void npg_source_take(npg_source *source, size_t size)
{
    source->begin += size;
    source->byte += size;
}

/* Step over any number of bytes; *skipped < size only at the end of the source. */
npg_status npg_source_skip(npg_source *source, uint64_t size, uint64_t *skipped);

/* Bytes from here to the end; UINT64_MAX where that can't be known. */
uint64_t npg_source_left(const npg_source *source);

/* The next line without its end, not terminated by 0; valid until the next call.  NPG_END. */
npg_status npg_source_line(npg_source *source, const char **text, size_t *length);

/* The next line that holds more than blanks, from its first word on; valid until the next call.  NPG_END. */
npg_status npg_source_row(npg_source *source, const char **at, const char **end);

/* The number that begins at *at, which then stands behind it and the blanks that follow; NPG_BAD_INPUT with the
 * line where there is none. */
npg_status npg_source_number(const npg_source *source, double *value, const char **at, const char *end);

/* The words of a header's next line, blanks aside; maybe none.  NPG_BAD_INPUT where the file ends, or the line is
 * no text of that size. */
enum { NPG_WORDS_MAX = 129, NPG_WORDS_LINE = 8191 }; /* far above any header of real files (set by trial) */
typedef struct npg_words {
    char text[NPG_WORDS_LINE + 1];
    char *words[NPG_WORDS_MAX]; /* into text */
    size_t count;
} npg_words;
npg_status npg_source_words(npg_source *source, npg_words *line);

/* A count in a header: digits, and so few that counts times row sizes stay below 2^64. */
npg_status npg_source_count(const npg_source *source, uint64_t *count, const char *text);

/* Look whether lines end with '\r' alone, from the first 64 KiB. */
npg_status npg_source_find_line_end(npg_source *source);

/* NPG_BAD_INPUT with "<name>: line <n>: ..." or "<name>: byte <n>: ...": of the place where the source is. */
npg_status npg_source_bad(const npg_source *source, const char *unit, uint64_t place, const char *format, ...)
    NPG_PRINTF(4, 5);
#define npg_source_bad_line(source, ...) npg_source_bad(source, "line", (source)->line, __VA_ARGS__)
#define npg_source_bad_byte(source, ...) npg_source_bad(source, "byte", (source)->byte, __VA_ARGS__)

#endif
