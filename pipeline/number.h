/* Number: decimal numbers from text, fast and the same under every locale. */
#ifndef NPG_NUMBER_H
#define NPG_NUMBER_H

#include <stdbool.h>
#include <stddef.h>

/* The number that begins at text (no leading space): [+-]digits[.digits][e[+-]digits], nan, inf, infinity and
 * what older Windows libraries print for them (1.#IND, 1.#INF).  Returns the first byte after it, NULL when
 * there is none or it does not end before a space, a separator (',', ';') or the end.
 * Correctly rounded up to 19 digits and moderate exponents, save for halfway cases that extended precision
 * can't tell apart (off by at most one last place); beyond that the C library decides. */
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

#endif
