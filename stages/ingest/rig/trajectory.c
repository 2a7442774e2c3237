/* Trajectory: files of times and image paths, and of poses, one or several lines each; sensors of such images. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "ingest/rig/rig_internal.h"

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

typedef npg_status read_fn(npg_stamped_list *list, npg_stamped *item, npg_source *source, const char *at,
                           const char *end);

/* One entry, whose first line is at hand. */
static npg_status read_image(npg_stamped_list *list, npg_stamped *item, npg_source *source, const char *at,
                             const char *end)
{
    NPG_TRY(parse_numbers(source, &at, end, &item->time_s, 1, false));
    while (end > at && (end[-1] == ' ' || end[-1] == '\t' || end[-1] == '\r')) end--;
    size_t length = (size_t)(end - at);
    if (!length || length > 4096 || memchr(at, 0, length))
        return npg_source_bad_line(source, "no path after the time");
    item->path = npg_arena_take(list->arena, length + 1, 1);
    NPG_TRY(npg_arena_status(list->arena));
    memcpy(item->path, at, length);
    return NPG_OK;
}

static npg_status read_quaternion(npg_stamped_list *list, npg_stamped *item, npg_source *source,
                                  const char *at, const char *end)
{
    double v[8];
    char where[64];
    (void)list;
    NPG_TRY(parse_numbers(source, &at, end, v, 8, true));
    item->time_s = v[0];
    snprintf(where, sizeof where, "line %llu", (unsigned long long)source->line);
    return npg_error_prefix(npg_pose_of_quaternion(item->pose, v + 4, v + 1, where), "%s", source->name);
}

static npg_status read_matrix(npg_stamped_list *list, npg_stamped *item, npg_source *source, const char *at,
                              const char *end)
{
    double v[4];
    char where[64];
    NPG_TRY(parse_numbers(source, &at, end, v, 3, true));
    item->time_s = (double)list->count;
    for (size_t row = 0; row < 4; row++) {
        npg_status status = next_line(source, &at, &end);
        if (status == NPG_END) return npg_source_bad_line(source, "the file ends in the rows of a matrix");
        NPG_TRY(status);
        NPG_TRY(parse_numbers(source, &at, end, v, 4, true));
        if (row < 3) memcpy(item->pose + 4 * row, v, sizeof v);
    }
    if (v[0] != 0 || v[1] != 0 || v[2] != 0 || v[3] != 1)
        return npg_source_bad_line(source, "the last row of a pose must be 0 0 0 1");
    snprintf(where, sizeof where, "line %llu", (unsigned long long)source->line - 3);
    return npg_error_prefix(npg_pose_check(item->pose, where), "%s", source->name);
}

static npg_status add_item(npg_stamped_list *list, const npg_stamped *item, const npg_source *source)
{
    if (list->count >= NPG_RIG_SHOTS_MAX)
        return npg_source_bad_line(source, "more than %d entries", NPG_RIG_SHOTS_MAX);
    if (list->count && !(item->time_s > list->items[list->count - 1].time_s))
        return npg_source_bad_line(source, "the time %.6f does not come after the one before it",
                                   item->time_s);
    NPG_TRY(npg_arena_grow(list->arena, &list->items, &list->capacity, list->count + 1, sizeof *item));
    list->items[list->count++] = *item;
    return NPG_OK;
}

static npg_status read_list(npg_stamped_list *list, npg_arena *arena, const char *path, read_fn *read)
{
    npg_source *source;
    const char *at, *end;
    *list = (npg_stamped_list){.arena = arena};
    NPG_TRY(npg_source_open_file(&source, path));
    npg_status status = next_line(source, &at, &end);
    while (!status) {
        npg_stamped item = {0};
        status = read(list, &item, source, at, end);
        if (!status) status = add_item(list, &item, source);
        if (!status) status = next_line(source, &at, &end);
    }
    npg_source_close(&source);
    if (status != NPG_END) return status;
    return list->count ? NPG_OK : npg_error(NPG_BAD_INPUT, "%s: there is no entry", path);
}

npg_status npg_read_image_list(npg_stamped_list *list, npg_arena *arena, const char *path)
{
    return read_list(list, arena, path, read_image);
}

npg_status npg_read_trajectory(npg_stamped_list *list, npg_arena *arena, const char *path)
{
    return read_list(list, arena, path, npg_rig_ends_with(path, ".log") ? read_matrix : read_quaternion);
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

/* ---- images with times ---- */

/* A path as a list names it: from the list's folder. */
static npg_status path_in_list(npg_rig *rig, char **path, const char *list, const char *name)
{
    const char *slash = strrchr(list, '/');
    char joined[8192];
    int length = slash && name[0] != '/'
                     ? snprintf(joined, sizeof joined, "%.*s/%s", (int)(slash - list), list, name)
                     : snprintf(joined, sizeof joined, "%s", name);
    if (length < 0 || (size_t)length >= sizeof joined)
        return npg_error(NPG_BAD_INPUT, "%s: a path is too long", list);
    return npg_rig_path(rig, path, joined, true);
}

typedef struct timed {
    npg_arena scratch;
    npg_stamped_list depth, colour, poses;
} timed;

static npg_status read_timed(timed *t, npg_rig *rig, const char *const files[3])
{
    npg_stamped_list *const lists[] = {&t->depth, &t->colour, &t->poses};
    for (size_t i = 0; i < 3; i++) {
        char *path;
        if (!files[i]) continue;
        NPG_TRY(npg_rig_path(rig, &path, files[i], true));
        NPG_TRY(i < 2 ? npg_read_image_list(lists[i], &t->scratch, path)
                      : npg_read_trajectory(lists[i], &t->scratch, path));
    }
    return NPG_OK;
}

static npg_status add_timed(npg_rig *rig, npg_rig_sensor *sensor, const timed *t, const char *const files[3])
{
    double tolerance = rig->settings.tolerance_s;
    for (size_t i = 0; i < t->depth.count; i++) {
        npg_rig_shot shot = {.time_s = t->depth.items[i].time_s, .number = (int64_t)i};
        const npg_stamped *colour = npg_stamped_near(&t->colour, shot.time_s, tolerance),
                          *pose = npg_stamped_near(&t->poses, shot.time_s, tolerance);
        if (files[2] && !pose) {
            rig->left_out++;
            continue;
        }
        shot.has_pose = pose != NULL;
        if (pose) memcpy(shot.pose, pose->pose, sizeof shot.pose);
        NPG_TRY(path_in_list(rig, &shot.depth, files[0], t->depth.items[i].path));
        if (colour) NPG_TRY(path_in_list(rig, &shot.colour, files[1], colour->path));
        NPG_TRY(npg_rig_add_shot(rig, sensor, &shot));
    }
    if (sensor->shot_count) return NPG_OK;
    return npg_error(NPG_BAD_INPUT,
                     "%s: none of the %zu depth images of %s has a pose within %g s: images out of step",
                     rig->path, t->depth.count, files[0], tolerance);
}

npg_status npg_rig_load_timed(npg_rig *rig, npg_rig_sensor *sensor, const char *depth, const char *colour,
                              const char *poses)
{
    timed t = {.scratch.purpose = NPG_FOR_FILES};
    const char *const files[] = {depth, colour, poses};
    rig->is_timed = true;
    npg_status status = read_timed(&t, rig, files);
    if (!status) status = add_timed(rig, sensor, &t, files);
    npg_arena_release(&t.scratch);
    return status;
}
