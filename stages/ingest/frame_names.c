/* Frame names: natural order, and the frame number inside a file's name. */
#include "ingest/ingest_internal.h"

#include <stdlib.h>
#include <string.h>

#define DIGITS_MAX 17 /* every number of so many digits fits an int64_t, with room for sums */

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

/* A run of digits without its leading zeros; *text moves behind it. */
static size_t next_run(const char **run, const char **text)
{
    while (**text == '0' && is_digit((*text)[1])) ++*text;
    *run = *text;
    while (is_digit(**text)) ++*text;
    return (size_t)(*text - *run);
}

int npg_natural_compare(const char *a, const char *b)
{
    while (*a && *b) {
        if (is_digit(*a) && is_digit(*b)) {
            const char *run_a, *run_b;
            size_t size_a = next_run(&run_a, &a), size_b = next_run(&run_b, &b);
            /* Without leading zeros the longer number is the larger one. */
            if (size_a != size_b) return size_a < size_b ? -1 : 1;
            int order = memcmp(run_a, run_b, size_a);
            if (order) return order;
        } else if (*a != *b) {
            return (unsigned char)*a < (unsigned char)*b ? -1 : 1;
        } else {
            a++;
            b++;
        }
    }
    return *a ? 1 : *b ? -1 : 0;
}

int npg_natural_order(const void *left, const void *right)
{
    const char *a = *(char *const *)left, *b = *(char *const *)right;
    int order = npg_natural_compare(a, b);
    return order ? order : strcmp(a, b);
}

/* Where the ending begins, or the end of the text. */
static const char *stem_end(const char *path)
{
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash ? slash : path, '.');
    /* A dot before a digit belongs to a number (scan_1.5), one at the beginning to a hidden file's name. */
    return dot && dot != path && dot[-1] != '/' && !is_digit(dot[1]) ? dot : path + strlen(path);
}

int64_t npg_name_number(const char *path, size_t from_end, size_t *run_count)
{
    const char *end = stem_end(path);
    int64_t value = -1;
    size_t seen = 0;
    for (const char *at = end; at > path;) {
        while (at > path && !is_digit(at[-1])) at--;
        const char *last = at;
        while (at > path && is_digit(at[-1])) at--;
        if (at == last) break;
        const char *first = at;
        while (first < last - 1 && *first == '0') first++;
        if (seen++ == from_end && last - first <= DIGITS_MAX) value = strtoll(first, NULL, 10);
    }
    if (run_count) *run_count = seen;
    return value;
}

/* Whether one run of digits numbers all paths: they have as many runs each, and its value grows. */
static bool number_by_run(int64_t *numbers, char *const *paths, size_t count, size_t from_end)
{
    size_t runs, first_runs;
    npg_name_number(paths[0], 0, &first_runs);
    for (size_t i = 0; i < count; i++) {
        numbers[i] = npg_name_number(paths[i], from_end, &runs);
        if (runs != first_runs || numbers[i] < 0 || (i && numbers[i] <= numbers[i - 1])) return false;
    }
    return true;
}

static npg_status refuse_equal_names(char *const *paths, size_t count)
{
    for (size_t i = 1; i < count; i++)
        if (!npg_natural_compare(paths[i - 1], paths[i]))
            return npg_error(NPG_BAD_INPUT, "%s and %s have the same number", paths[i - 1], paths[i]);
    return NPG_OK;
}

npg_status npg_number_paths(int64_t *numbers, bool *is_numbered, char *const *paths, size_t count,
                            bool is_sorted)
{
    size_t runs = 0;
    *is_numbered = false;
    if (!count) return NPG_OK;
    if (is_sorted) NPG_TRY(refuse_equal_names(paths, count));
    const char *slash = strrchr(paths[0], '/');
    /* Of one path alone every run "grows": only those of its own name count, not its folders'. */
    npg_name_number(count == 1 && slash ? slash + 1 : paths[0], 0, &runs);
    for (size_t from_end = 0; from_end < runs && !*is_numbered; from_end++)
        *is_numbered = number_by_run(numbers, paths, count, from_end);
    for (size_t i = 0; i < count && !*is_numbered; i++) numbers[i] = (int64_t)i;
    return NPG_OK;
}

int64_t npg_common_divisor(int64_t a, int64_t b)
{
    /* Euclid's algorithm. */
    while (b) {
        int64_t rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}
