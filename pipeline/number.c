/* Number: decimal numbers from text, fast and the same under every locale. */
#include "pipeline/source.h"

#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <strings.h>

#define TOKEN_MAX 800 /* longer than any double needs: 767 digits */

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

/* Up to 15 digits with a point, as most numbers are: both factors are exact, so the one rounding is right (Clinger
 * 1990). */
static const char *parse_short(const char *text, const char *end, double *value)
{
    static const double power_of_ten[] = {1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                          1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};
    bool is_negative = text < end && *text == '-', has_point = false;
    uint64_t digits = 0;
    int count = 0, behind = 0;
    for (text += is_negative; text < end; text++) {
        unsigned digit = (unsigned)*text - '0';
        if (digit <= 9 && count++ < 15) {
            digits = 10 * digits + digit;
            behind += has_point;
        } else if (*text == '.' && !has_point) {
            has_point = true;
        } else {
            break;
        }
    }
    *value = (is_negative ? -(double)digits : (double)digits) / power_of_ten[behind];
    return count && ends(text, end) ? text : NULL;
}

const char *npg_number_parse(const char *text, const char *end, double *value)
{
    static const char *const of_windows[] = {"#inf", "#ind", "#qnan"}; /* behind "1." */
    char copy[TOKEN_MAX + 1], *after;                                  /* the text has no end mark */
    const char *short_end = parse_short(text, end, value);
    size_t length = 0;
    if (short_end) return short_end;
    for (; length < TOKEN_MAX && !ends(text + length, end); length++) copy[length] = text[length];
    copy[length] = 0;
    if (!ends(text + length, end) || strpbrk(copy, "xX\n")) return NULL;
    pthread_once(&c_locale_once, open_c_locale);
    *value = c_locale ? strtod_l(copy, &after, c_locale) : strtod(copy, &after);
    for (size_t i = 0; i < 3 && after > copy; i++) {
        if (strncasecmp(after, of_windows[i], strlen(of_windows[i])) != 0) continue;
        *value = i ? (double)NAN : copysign((double)INFINITY, *value);
        after += strlen(of_windows[i]);
        after += strspn(after, "0"); /* padded to the digits asked for */
    }
    return length && after == copy + length ? text + length : NULL;
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
