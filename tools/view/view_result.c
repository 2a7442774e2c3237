/* Result: lists and references of a run, or of its segments. */
#include "tools/view/view.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "pipeline/file.h"
#include "pipeline/json_file.h"
#include "tools/segments/segments.h"

enum {
    GROUP_FRAMES = 16,
    GROUP_VERTS = 1 << 22
}; /* more frames a group take less, and longer to jump into */

/* ---- files ---- */

/* The bytes of a file up to its last whole line: a run may be at work on it. */
static int64_t whole_lines(const char *path)
{
    FILE *file = fopen(path, "re");
    int64_t size = 0, at = 0;
    char some[64 << 10];
    for (size_t got; file && (got = fread(some, 1, sizeof some, file)) > 0; at += (int64_t)got) {
        const char *last = memrchr(some, '\n', got);
        if (last) size = at + (last - some) + 1;
    }
    if (file) fclose(file);
    return size;
}

/* ---- the frames ---- */

typedef struct reading {
    npg_arena *arena;
    npg_view_part *part;
    int64_t every;
} reading;

static npg_status add_frame(void *user, const json_t *line, const char *text, size_t size)
{
    reading *r = user;
    npg_view_part *part = r->part;
    const json_t *index = json_object_get(line, "index");
    (void)text, (void)size;
    if (json_is_true(json_object_get(line, "shared"))) return NPG_OK; /* another segment has it as its own */
    if (!json_is_integer(index) || json_integer_value(index) < 0)
        return npg_error(NPG_BAD_INPUT, "%s: a line of its list of frames has no index", part->folder);
    if (json_integer_value(index) % r->every && !json_is_true(json_object_get(line, "key"))) return NPG_OK;
    NPG_TRY(npg_arena_grow(r->arena, &part->frames, &part->capacity, part->count + 1, sizeof *part->frames));
    npg_view_frame *frame = &part->frames[part->count++];
    frame->line = json_incref((json_t *)line);
    frame->index = (int64_t)json_integer_value(index);
    frame->number = (int64_t)json_integer_value(json_object_get(line, "number"));
    frame->file = json_string_value(json_object_get(line, "file"));
    frame->source = json_string_value(json_object_get(line, "source"));
    return NPG_OK;
}

static int by_index(const void *left, const void *right)
{
    const npg_view_frame *a = left, *b = right;
    return (a->index > b->index) - (a->index < b->index);
}

static npg_status read_frames(npg_arena *arena, npg_view_part *part, int64_t every, bool may_be_empty)
{
    const char *name =
        npg_is_in_folder(part->folder, "frames.jsonl") ? "frames.jsonl" : "frames.partial.jsonl";
    reading r = {arena, part, every};
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, part->folder, name));
    int64_t size = whole_lines(path);
    npg_status status = size ? npg_json_lines(part->folder, name, size, add_frame, &r) : NPG_OK;
    if (status == NPG_DISK) status = npg_error_set(NPG_BAD_INPUT, npg_error_text());
    if (!status && !part->count && !may_be_empty)
        status = npg_error(NPG_BAD_INPUT, "%s: no frame is solved yet", part->folder);
    if (part->count) qsort(part->frames, part->count, sizeof *part->frames, by_index);
    for (size_t i = 1; i < part->count && !status; i++)
        if (part->frames[i].index == part->frames[i - 1].index)
            status =
                npg_error(NPG_BAD_INPUT, "%s names frame %lld twice", path, (long long)part->frames[i].index);
    return status;
}

/* ---- the reference ---- */

static npg_status read_reference(npg_arena *arena, npg_view_part *part, bool may_be_empty)
{
    char path[NPG_PATH_SIZE];
    if (may_be_empty && !npg_is_in_folder(part->folder, "reference.ply")) return NPG_OK;
    NPG_TRY(npg_path_of(path, part->folder, "reference.ply"));
    npg_status status = npg_read_mesh(&part->reference, path, &part->origin);
    if (!status) status = npg_mesh_require_finite(part->reference, path);
    if (!status) status = npg_view_links_open(&part->links, arena, part->reference);
    if (!status) part->group = GROUP_VERTS / part->reference->vert_count;
    if (part->group < 1) part->group = 1;
    if (part->group > GROUP_FRAMES) part->group = GROUP_FRAMES;
    return status;
}

/* ---- what the run says of itself ---- */

const json_t *npg_view_run_options(const npg_view_part *part)
{
    return json_object_get(part->done ? part->done : part->job, "options");
}

double npg_view_number(const json_t *object, const char *key, double otherwise)
{
    const json_t *value = json_object_get(object, key);
    const char *text = json_string_value(value);
    return json_is_number(value) ? json_number_value(value) : text ? strtod(text, NULL) : otherwise;
}

static npg_status set_placement(npg_view_part *part)
{
    const json_t *said = part->done ? part->done : npg_view_run_options(part);
    const json_t *axes = json_object_get(said, "axes"), *centre = json_object_get(part->done, "centre");
    NPG_TRY(npg_placement_parse(&part->placement, json_is_string(axes) ? json_string_value(axes) : "xyz"));
    part->placement.scale = npg_view_number(said, "scale", 1);
    for (size_t a = 0; a < 3 && centre; a++)
        part->placement.centre[a] = json_number_value(json_array_get(centre, a));
    return NPG_OK;
}

static void set_lengths(npg_view_part *part)
{
    const json_t *keyframe = npg_json_at(part->report, "stages.keyframe");
    double own = npg_view_number(keyframe, "figure_diagonal", npg_view_number(keyframe, "box_diagonal", 0));
    npg_bounds bounds = npg_bounds_empty();
    if (part->reference)
        npg_bounds_add_points(&bounds, part->reference->vert_pos, part->reference->vert_count);
    part->diagonal = part->placement.scale * own;
    if (!(part->diagonal > 0) && part->reference) part->diagonal = npg_bounds_diagonal(&bounds);
    if (!(part->diagonal > 0) || !isfinite(part->diagonal)) part->diagonal = 1;
    part->cover_share = 0.01 * npg_view_number(npg_view_run_options(part), "bars.cover", 1);
}

static npg_status fill_part(npg_arena *arena, npg_view_part *part, int64_t every, bool may_be_empty)
{
    NPG_TRY(npg_json_load(&part->report, part->folder, "report.json", NPG_BAD_INPUT));
    NPG_TRY(npg_json_load(&part->done, part->folder, "done.json", NPG_BAD_INPUT));
    NPG_TRY(npg_json_load(&part->job, part->folder, "job/job.json", NPG_BAD_INPUT));
    NPG_TRY(set_placement(part));
    NPG_TRY(read_frames(arena, part, every, may_be_empty));
    NPG_TRY(read_reference(arena, part, may_be_empty));
    set_lengths(part);
    return NPG_OK;
}

/* ---- runs and segments ---- */

static npg_status add_part(npg_view_result *result, const char *label)
{
    npg_arena *arena = &result->arena;
    NPG_TRY(npg_arena_grow(arena, &result->parts, &result->capacity, result->part_count + 1,
                           sizeof *result->parts));
    npg_view_part *part = &result->parts[result->part_count++];
    *part = (npg_view_part){.group = 1, .label = npg_arena_text(arena, label)};
    part->folder = strcmp(label, ".") ? npg_arena_path(arena, result->path, label) : result->path;
    return npg_arena_status(arena);
}

static npg_status list_parts(npg_view_result *result)
{
    npg_segments segments = {.output = result->path};
    npg_status status = npg_segments_load(&segments);
    if (status == NPG_USAGE) status = npg_error_set(NPG_BAD_INPUT, npg_error_text());
    for (size_t i = 0; i < segments.count && !status; i++) status = add_part(result, segments.list[i].folder);
    npg_segments_clear(&segments);
    if (!status && !result->part_count) status = add_part(result, ".");
    if (!status) status = npg_json_load(&result->segments, result->path, "segments.json", NPG_BAD_INPUT);
    return status;
}

static npg_status set_name(npg_view_result *result)
{
    char *real = realpath(result->path, NULL);
    const char *slash = real ? strrchr(real, '/') : NULL;
    result->name = npg_arena_text(&result->arena, slash && slash[1] ? slash + 1 : result->path);
    free(real);
    return npg_arena_status(&result->arena);
}

static npg_status check_folder(const char *path, bool may_be_empty)
{
    static const char *const traces[] = {"frames.jsonl", "frames.partial.jsonl", "segments.json"};
    struct stat info;
    if (stat(path, &info)) return npg_error(NPG_USAGE, "%s: %s", path, strerror(errno));
    if (!S_ISDIR(info.st_mode)) return npg_error(NPG_USAGE, "%s is not a folder", path);
    for (size_t i = 0; i < sizeof traces / sizeof *traces; i++)
        if (npg_is_in_folder(path, traces[i])) return NPG_OK;
    if (npg_is_in_folder(path, "job") && may_be_empty) return NPG_OK;
    if (npg_is_in_folder(path, "job")) return npg_error(NPG_BAD_INPUT, "%s: no frame is solved yet", path);
    return npg_error(NPG_USAGE, "%s is not the output folder of neupig run", path);
}

npg_status npg_view_result_open(npg_view_result *result, const char *path, int64_t every, bool may_be_empty)
{
    *result = (npg_view_result){.arena = {.purpose = NPG_FOR_FILES}};
    NPG_TRY(check_folder(path, may_be_empty));
    result->path = npg_arena_text(&result->arena, path);
    npg_status status = result->path ? set_name(result) : npg_arena_status(&result->arena);
    if (!status) status = list_parts(result);
    for (size_t i = 0; i < result->part_count && !status; i++)
        status = fill_part(&result->arena, &result->parts[i], every, may_be_empty);
    result->is_done = !status && npg_is_in_folder(path, "done.json");
    if (status) npg_view_result_close(result);
    return status;
}

static void close_part(npg_view_part *part)
{
    for (size_t i = 0; i < part->count; i++) json_decref(part->frames[i].line);
    npg_mesh_unref(&part->reference);
    json_decref(part->report);
    json_decref(part->done);
    json_decref(part->job);
}

void npg_view_result_close(npg_view_result *result)
{
    for (size_t i = 0; i < result->part_count; i++) close_part(&result->parts[i]);
    json_decref(result->segments);
    npg_arena_release(&result->arena);
    *result = (npg_view_result){0};
}
