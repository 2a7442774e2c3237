/* Trajectory: files of times and image paths, and of poses, one or several lines each. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "ingest/rig/rig_internal.h"

void npg_stamped_clear(npg_stamped_list *list)
{
    for (size_t i = 0; i < list->count; i++) npg_release(&list->items[i].path);
    npg_release(&list->items);
    *list = (npg_stamped_list){0};
}

/* The next line that is neither empty nor a comment; NPG_END. */
static npg_status next_line(npg_source *source, const char **at, const char **end)
{
    do {
        NPG_TRY(npg_source_row(source, at, end));
    } while (**at == '#');
    if (source->byte > NPG_RIG_TEXT_MAX)
        return npg_source_bad_line(source, "the file is larger than %zu MiB", NPG_RIG_TEXT_MAX >> 20);
    return NPG_OK;
}

/* `count` numbers of a line, which may have no more where is_whole. */
static npg_status parse_numbers(const npg_source *source, const char **at, const char *end, double *values,
                                size_t count, bool is_whole)
{
    for (size_t i = 0; i < count; i++) {
        const char *after = npg_number_parse(*at, end, &values[i]);
        if (!after || !isfinite(values[i]))
            return npg_source_bad_line(source, "number %zu of %zu is missing or none", i + 1, count);
        *at = npg_skip_blanks(after, end);
    }
    if (is_whole && *at < end) return npg_source_bad_line(source, "more than %zu numbers", count);
    return NPG_OK;
}

static npg_status add_item(npg_stamped_list *list, const npg_source *source, double time_s)
{
    if (list->count >= NPG_RIG_SHOTS_MAX)
        return npg_source_bad_line(source, "more than %d entries", NPG_RIG_SHOTS_MAX);
    if (list->count && !(time_s > list->items[list->count - 1].time_s))
        return npg_source_bad_line(source, "the time %.6f does not come after the one before it", time_s);
    NPG_TRY(npg_grow(&list->items, &list->capacity, list->count + 1, sizeof *list->items, NPG_FOR_FILES));
    list->items[list->count++] = (npg_stamped){.time_s = time_s};
    return NPG_OK;
}

static npg_status read_images(npg_stamped_list *list, npg_source *source)
{
    const char *at, *end;
    for (;;) {
        double time_s;
        npg_status status = next_line(source, &at, &end);
        if (status) return status == NPG_END ? NPG_OK : status;
        NPG_TRY(parse_numbers(source, &at, end, &time_s, 1, false));
        while (end > at && (end[-1] == ' ' || end[-1] == '\t' || end[-1] == '\r')) end--;
        size_t length = (size_t)(end - at);
        if (!length || length > 4096 || memchr(at, 0, length))
            return npg_source_bad_line(source, "no path after the time");
        NPG_TRY(add_item(list, source, time_s));
        char **path = &list->items[list->count - 1].path;
        NPG_TRY(npg_alloc(path, NPG_FOR_FILES, length + 1));
        memcpy(*path, at, length);
    }
}

static npg_status read_quaternions(npg_stamped_list *list, npg_source *source)
{
    const char *at, *end;
    for (;;) {
        double v[8];
        char where[64];
        npg_status status = next_line(source, &at, &end);
        if (status) return status == NPG_END ? NPG_OK : status;
        NPG_TRY(parse_numbers(source, &at, end, v, 8, true));
        NPG_TRY(add_item(list, source, v[0]));
        snprintf(where, sizeof where, "line %llu", (unsigned long long)source->line);
        status = npg_pose_of_quaternion(list->items[list->count - 1].pose, v + 4, v + 1, where);
        if (status) return npg_error_prefix(status, "%s", source->name);
    }
}

static npg_status read_matrix(npg_source *source, double pose[12])
{
    const char *at, *end;
    char where[64];
    for (size_t row = 0; row < 4; row++) {
        double v[4];
        npg_status status = next_line(source, &at, &end);
        if (status == NPG_END) return npg_source_bad_line(source, "the file ends in the rows of a matrix");
        if (status) return status;
        NPG_TRY(parse_numbers(source, &at, end, v, 4, true));
        if (row < 3) memcpy(pose + 4 * row, v, sizeof v);
        if (row == 3 && (v[0] != 0 || v[1] != 0 || v[2] != 0 || v[3] != 1))
            return npg_source_bad_line(source, "the last row of a pose must be 0 0 0 1");
    }
    snprintf(where, sizeof where, "line %llu", (unsigned long long)source->line - 3);
    return npg_error_prefix(npg_pose_check(pose, where), "%s", source->name);
}

static npg_status read_blocks(npg_stamped_list *list, npg_source *source)
{
    const char *at, *end;
    for (;;) {
        double numbers[3];
        npg_status status = next_line(source, &at, &end);
        if (status) return status == NPG_END ? NPG_OK : status;
        NPG_TRY(parse_numbers(source, &at, end, numbers, 3, true));
        NPG_TRY(add_item(list, source, (double)list->count));
        NPG_TRY(read_matrix(source, list->items[list->count - 1].pose));
    }
}

static npg_status read_list(npg_stamped_list *list, const char *path,
                            npg_status (*read)(npg_stamped_list *list, npg_source *source))
{
    npg_source *source;
    *list = (npg_stamped_list){0};
    NPG_TRY(npg_source_open_file(&source, path));
    npg_status status = read(list, source);
    if (!status && !list->count) status = npg_error(NPG_BAD_INPUT, "%s: there is no entry", path);
    npg_source_close(&source);
    if (status) npg_stamped_clear(list);
    return status;
}

npg_status npg_read_image_list(npg_stamped_list *list, const char *path)
{
    return read_list(list, path, read_images);
}

npg_status npg_read_trajectory(npg_stamped_list *list, const char *path)
{
    return read_list(list, path, npg_rig_ends_with(path, ".log") ? read_blocks : read_quaternions);
}

const npg_stamped *npg_stamped_near(const npg_stamped_list *list, double time_s, double tolerance_s)
{
    size_t lo = 0, hi = list->count; /* the first that is not before time_s */
    while (lo < hi) {
        size_t middle = (lo + hi) / 2;
        if (list->items[middle].time_s < time_s)
            lo = middle + 1;
        else
            hi = middle;
    }
    const npg_stamped *best = NULL;
    for (size_t i = lo ? lo - 1 : 0; i < list->count && i <= lo; i++)
        if (!best || fabs(list->items[i].time_s - time_s) < fabs(best->time_s - time_s))
            best = &list->items[i];
    return best && fabs(best->time_s - time_s) <= tolerance_s ? best : NULL;
}
