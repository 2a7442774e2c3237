/* Frame selection: the text of --frames. */
#include "ingest/ingest_internal.h"
#include "pipeline/order.h"

#include <stdlib.h>
#include <string.h>

/* Larger numbers count as this one, so that sums of two stay far from overflow. */
#define NUMBER_MAX ((int64_t)1 << 53)

static npg_status refuse(const char *text, const char *cause)
{
    return npg_error(NPG_USAGE,
                     "option frames: \"%.100s\": %s "
                     "(a:b:step are positions, b not included; 1-5,8 are frame numbers)",
                     text, cause);
}

static const char *skip_spaces(const char *at)
{
    return at + strspn(at, " ");
}

/* A whole number at *at; *has says whether there is one. */
static bool parse_number(int64_t *value, bool *has, const char **at)
{
    const char *text = skip_spaces(*at);
    bool negative = *text == '-';
    text += negative;
    size_t digits = strspn(text, "0123456789");
    *has = digits > 0;
    if (!digits) return !negative;
    *value = digits > 16 ? NUMBER_MAX : strtoll(text, NULL, 10); /* 2^53 has 16 */
    if (*value > NUMBER_MAX) *value = NUMBER_MAX;
    if (negative) *value = -*value;
    *at = skip_spaces(text + digits);
    return true;
}

static npg_status parse_slice(npg_selection *s, const char *text)
{
    bool has_step;
    int64_t *const parts[] = {&s->first, &s->end, &s->step};
    bool *const has[] = {&s->has_first, &s->has_end, &has_step};
    const char *at = text;
    s->is_slice = true;
    s->step = 1;
    for (size_t i = 0; i < 3; i++) {
        if (!parse_number(parts[i], has[i], &at)) return refuse(text, "not a number");
        at = skip_spaces(at);
        if (i == 0 && *at != ':') return refuse(text, "not a number");
        if (i < 2 && *at == ':')
            at++;
        else
            break;
    }
    if (*at) return refuse(text, "not of the form a:b:step");
    return s->step < 1 ? refuse(text, "the step must be at least 1") : NPG_OK;
}

static npg_status parse_range(int64_t range[2], const char *text, const char **at)
{
    bool has;
    if (!parse_number(&range[0], &has, at) || !has) return refuse(text, "not a frame number");
    range[1] = range[0];
    if (**at == '-') {
        ++*at;
        if (!parse_number(&range[1], &has, at) || !has) return refuse(text, "a range without an end");
    }
    if (range[0] < 0) return refuse(text, "a negative frame number");
    if (range[1] < range[0]) return refuse(text, "a range that runs backward");
    return NPG_OK;
}

/* Sort, and join what overlaps. */
static void merge_ranges(npg_selection *s)
{
    size_t kept = 0;
    qsort(s->ranges, s->range_count, sizeof *s->ranges, npg_order_int64);
    for (size_t i = 1; i < s->range_count; i++) {
        if (s->ranges[i][0] <= s->ranges[kept][1]) {
            if (s->ranges[i][1] > s->ranges[kept][1]) s->ranges[kept][1] = s->ranges[i][1];
        } else {
            memcpy(s->ranges[++kept], s->ranges[i], sizeof *s->ranges);
        }
    }
    s->range_count = kept + 1;
}

static npg_status parse_numbers(npg_selection *s, const char *text)
{
    size_t capacity = 0;
    for (const char *at = text;; at++) {
        NPG_TRY(npg_grow(&s->ranges, &capacity, s->range_count + 1, sizeof *s->ranges, NPG_FOR_RUN));
        NPG_TRY(parse_range(s->ranges[s->range_count], text, &at));
        s->range_count++;
        if (!*at) break;
        if (*at != ',') return refuse(text, "numbers and ranges are parted by commas");
    }
    merge_ranges(s);
    return NPG_OK;
}

npg_status npg_selection_parse(npg_selection *selection, const char *text)
{
    *selection = (npg_selection){0};
    if (!*skip_spaces(text)) return NPG_OK;
    npg_status status = strchr(text, ':') ? parse_slice(selection, text) : parse_numbers(selection, text);
    if (status) npg_selection_clear(selection);
    return status;
}

void npg_selection_clear(npg_selection *selection)
{
    npg_release(&selection->ranges);
    *selection = (npg_selection){0};
}

bool npg_selection_needs_count(const npg_selection *s)
{
    return s->is_slice && ((s->has_first && s->first < 0) || (s->has_end && s->end < 0));
}

static bool slice_takes(const npg_selection *s, int64_t position, int64_t count)
{
    int64_t first = s->has_first ? s->first : 0, end = s->has_end ? s->end : INT64_MAX;
    if (first < 0) first = first + count < 0 ? 0 : first + count;
    if (end < 0) end += count;
    return position >= first && position < end && (position - first) % s->step == 0;
}

bool npg_selection_takes(const npg_selection *s, int64_t position, int64_t number, int64_t count)
{
    if (s->is_slice) return slice_takes(s, position, count);
    if (!s->range_count) return true;
    for (size_t i = 0; i < s->range_count; i++)
        if (number >= s->ranges[i][0] && number <= s->ranges[i][1]) return true;
    return false;
}
