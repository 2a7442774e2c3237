/* Number: decimal numbers from text, fast and the same under every locale. */
#include "pipeline/source.h"

#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define DIGITS_MAX 19  /* what fits an uint64_t                            */
#define POWER_MAX  27  /* 10^27 is exact in a 64-bit mantissa: 5^27 < 2^63 */
#define TOKEN_MAX  800 /* longer than any double needs: 767 digits         */

static const long double power_of_ten[POWER_MAX + 1] = {
    1e0L,  1e1L,  1e2L,  1e3L,  1e4L,  1e5L,  1e6L,  1e7L,  1e8L,  1e9L,  1e10L, 1e11L, 1e12L, 1e13L,
    1e14L, 1e15L, 1e16L, 1e17L, 1e18L, 1e19L, 1e20L, 1e21L, 1e22L, 1e23L, 1e24L, 1e25L, 1e26L, 1e27L};

static locale_t c_locale;
static pthread_once_t c_locale_once = PTHREAD_ONCE_INIT;

static void open_c_locale(void)
{
    c_locale = newlocale(LC_ALL_MASK, "C", (locale_t)0);
}

static bool ends(const char *text, const char *end)
{
    return text == end || *text == ' ' || *text == '\t' || *text == ',' || *text == ';' || *text == '\r' ||
           *text == '\v' || *text == '\f';
}

static double by_library(const char *text)
{
    pthread_once(&c_locale_once, open_c_locale);
    return c_locale ? strtod_l(text, NULL, c_locale) : strtod(text, NULL);
}

/* Words for numbers that are not finite. */
static const char *parse_word(const char *text, const char *end, bool negative, double *value)
{
    /* clang-format off */
    static const struct {
        const char *word;
        double value;
    } words[] = {
        {"nan",       (double)NAN},
        {"inf",       (double)INFINITY},
        {"infinity",  (double)INFINITY},
        {"nan(ind)",  (double)NAN}, /* Windows libraries of today */
        {"nan(snan)", (double)NAN},
        {"1.#qnan",   (double)NAN}, /* older ones, padded to the digits asked for */
        {"1.#qnan0",  (double)NAN},
        {"1.#ind",    (double)NAN},
        {"1.#ind00",  (double)NAN},
        {"1.#inf",    (double)INFINITY},
        {"1.#inf00",  (double)INFINITY}};
    /* clang-format on */
    size_t length = 0;
    while (!ends(text + length, end)) length++;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        if (strlen(words[i].word) != length || strncasecmp(words[i].word, text, length) != 0) continue;
        *value = negative ? -words[i].value : words[i].value;
        return text + length;
    }
    return NULL;
}

/* What the quick way can't do exactly goes to the C library, as a copy because the text has no end mark. */
static const char *parse_long(const char *token, const char *after, double *value)
{
    char copy[TOKEN_MAX + 1];
    size_t length = (size_t)(after - token);
    if (length > TOKEN_MAX) return NULL;
    memcpy(copy, token, length);
    copy[length] = 0;
    *value = by_library(copy);
    return after;
}

static const char *parse_exponent(const char *text, const char *end, int *exponent)
{
    bool negative = false, any = false;
    int value = 0;
    if (text < end && (*text == '+' || *text == '-')) negative = *text++ == '-';
    for (; text < end && *text >= '0' && *text <= '9'; text++, any = true)
        if (value < 100000) value = value * 10 + (*text - '0'); /* beyond that it is 0 or infinity anyway */
    *exponent = negative ? -value : value;
    return any ? text : NULL;
}

const char *npg_number_parse(const char *token, const char *end, double *value)
{
    const char *text = token;
    bool negative = false;
    if (text < end && (*text == '+' || *text == '-')) negative = *text++ == '-';
    uint64_t mantissa = 0;
    int digits = 0, significant = 0, scale = 0, exponent = 0;
    for (bool after_point = false; text < end; text++) {
        unsigned digit = (unsigned)*text - '0';
        if (digit <= 9) {
            digits++;
            significant += significant > 0 || digit > 0; /* leading zeros are not */
            if (significant <= DIGITS_MAX) mantissa = mantissa * 10 + digit;
            scale -= after_point;
        } else if (*text == '.' && !after_point) {
            after_point = true;
        } else {
            break;
        }
    }
    if (token == end) return NULL;
    if (!digits || (text < end && *text == '#'))
        return parse_word(token + (*token == '+' || *token == '-'), end, negative, value);
    if (text < end && (*text == 'e' || *text == 'E')) text = parse_exponent(text + 1, end, &exponent);
    if (!text || !ends(text, end)) return NULL;
    scale += exponent;
    if (significant > DIGITS_MAX || scale > POWER_MAX || scale < -POWER_MAX)
        return parse_long(token, text, value);
    /* Both factors are exact in the 64-bit mantissa of x86: one rounding here, one to double. */
    long double result = (long double)mantissa;
    result = scale < 0 ? result / power_of_ten[-scale] : result * power_of_ten[scale];
    *value = negative ? -(double)result : (double)result;
    return text;
}

/* The formats come from this library's own writers. */
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
size_t npg_number_print(char *out, size_t size, const char *format, double value)
{
    /* snprintf() writes the decimal point of the program's locale. */
    const char *sign = localeconv()->decimal_point;
    int length = snprintf(out, size, format, value);
    char *at = *sign && strcmp(sign, ".") != 0 ? strstr(out, sign) : NULL;
    if (at) {
        *at = '.';
        memmove(at + 1, at + strlen(sign), strlen(at + strlen(sign)) + 1);
        length -= (int)strlen(sign) - 1;
    }
    return (size_t)length < size ? (size_t)length : size - 1;
}
#pragma GCC diagnostic pop
