/* Frame files: which files are the frames of a capture, in time order, gaps included. */
#include "ingest/ingest_internal.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

/* Slots are made for gaps as well.  Names that hold dates or identities instead of frame numbers would ask
 * for billions of them; the limit itself is a round number far above any capture. */
#define SLOTS_MAX ((int64_t)10000000)

/* The largest step that leads to every number from the first one; 1 for a single frame. */
static int64_t step_of(const int64_t *numbers, size_t count)
{
    int64_t step = 0;
    for (size_t i = 1; i < count; i++) step = npg_common_divisor(numbers[i] - numbers[i - 1], step);
    return step ? step : 1;
}

static npg_status add_slot(npg_frame_files *list, size_t *capacity, char *path, int64_t number)
{
    NPG_TRY(npg_arena_grow(&list->arena, &list->slots, capacity, list->count + 1, sizeof *list->slots));
    list->slots[list->count++] = (npg_frame_slot){
        path, number, path && list->rig ? npg_rig_frame_hash(list->rig, npg_rig_find(list->rig, number)) : 0};
    list->gap_count += !path;
    return NPG_OK;
}

/* All slots in time order: files, gaps between them, and selected numbers outside what is there, which are gaps, too.
 * Positions count gaps from the first file. */
static npg_status fill_slots(npg_frame_files *list, const npg_listing *paths, const npg_selection *selection,
                             bool finds_gaps)
{
    const int64_t *numbers = paths->numbers, (*ranges)[2] = selection->ranges;
    const int64_t step = step_of(numbers, paths->count), first = numbers[0], last = numbers[paths->count - 1];
    int64_t count = finds_gaps ? (last - first) / step + 1 : (int64_t)paths->count, before = 0, behind = 0;
    size_t capacity = 0, next = 0, range_count = selection->range_count;
    if (count > SLOTS_MAX)
        return npg_error(NPG_BAD_INPUT,
                         "the numbers of %zu frames run from %lld to %lld: "
                         "not a numbering (missing = ignore takes the frames as they follow each other)",
                         paths->count, (long long)first, (long long)last);
    if (finds_gaps && range_count && ranges[0][0] < first) before = (first - ranges[0][0]) / step;
    if (finds_gaps && range_count && ranges[range_count - 1][1] > last)
        behind = (ranges[range_count - 1][1] - last) / step;
    if (before + behind > SLOTS_MAX)
        return npg_error(NPG_USAGE, "option frames: %lld to %lld is far from what is there (%lld to %lld)",
                         (long long)ranges[0][0], (long long)ranges[range_count - 1][1], (long long)first,
                         (long long)last);
    for (int64_t at = -before; at < count + behind; at++) {
        int64_t number = finds_gaps ? first + at * step : numbers[at];
        bool is_there = next < paths->count && numbers[next] == number;
        if (npg_selection_takes(selection, at, number, count))
            NPG_TRY(add_slot(list, &capacity, is_there ? paths->paths[next] : NULL, number));
        next += is_there;
    }
    return NPG_OK;
}

/* *is_numbered: numbers come from the input, so gaps can be found. */
static npg_status number_frames(npg_listing *paths, bool *is_numbered)
{
    *is_numbered = true;
    if (paths->numbers) return NPG_OK;
    paths->numbers = npg_arena_take(paths->arena, paths->count, sizeof *paths->numbers);
    NPG_TRY(npg_arena_status(paths->arena));
    return npg_number_paths(paths->numbers, is_numbered, paths->paths, paths->count, !paths->is_listed);
}

/* The frames of a rig as if each were a file of its own: its first depth image. */
static npg_status find_in_rig(npg_listing *paths, const npg_rig *rig)
{
    paths->count = rig->frame_count;
    paths->paths = npg_arena_take(paths->arena, paths->count, sizeof *paths->paths);
    paths->numbers = npg_arena_copy(paths->arena, rig->numbers, paths->count, sizeof *paths->numbers);
    NPG_TRY(npg_arena_status(paths->arena));
    for (size_t f = 0; f < paths->count; f++)
        for (size_t s = 0; s < rig->sensor_count && !paths->paths[f]; s++) {
            const npg_rig_shot *shot = npg_rig_shot_of(rig, f, s);
            if (shot) paths->paths[f] = shot->depth;
        }
    return NPG_OK;
}

static npg_status fill(npg_frame_files *list, const char *input, const npg_selection *selection,
                       bool finds_gaps, const npg_rig_settings *rig)
{
    npg_listing paths = {.arena = &list->arena};
    bool is_numbered;
    if (rig) NPG_TRY(npg_rig_open(&list->rig, input, rig));
    NPG_TRY(rig ? find_in_rig(&paths, list->rig) : npg_paths_find(&paths, input));
    NPG_TRY(number_frames(&paths, &is_numbered));
    list->left_out = paths.left_out;
    NPG_TRY(fill_slots(list, &paths, selection, finds_gaps && is_numbered));
    if (list->count == list->gap_count)
        return npg_error(
            NPG_USAGE, "option frames: chooses none of the %zu frames of %s (numbers %lld to %lld)",
            paths.count, input, (long long)paths.numbers[0], (long long)paths.numbers[paths.count - 1]);
    return NPG_OK;
}

npg_status npg_frame_files_open(npg_frame_files **out, const char *input, const char *text, bool finds_gaps,
                                const npg_rig_settings *settings)
{
    npg_selection selection;
    *out = NULL;
    NPG_TRY(npg_selection_parse(&selection, text));
    npg_status status = npg_object_open(out, NPG_FOR_FILES, sizeof **out);
    if (!status)
        status = fill(*out, input, &selection, finds_gaps, settings && npg_rig_is(input) ? settings : NULL);
    if (status) npg_frame_files_close(out);
    npg_selection_clear(&selection);
    return status;
}

npg_status npg_frame_files_read(const npg_frame_files *list, size_t slot, npg_frame *frame,
                                npg_origin *origin)
{
    const npg_frame_slot *at = &list->slots[slot];
    if (!list->rig) return npg_read_cloud(frame, at->path, origin);
    NPG_TRY(npg_rig_read(list->rig, frame, npg_rig_find(list->rig, at->number), origin));
    npg_status status = npg_copy_text(&frame->path, at->path);
    frame->cleaning.read = frame->point_count;
    frame->fields = NPG_FIELD_POINTS;
    if (status) npg_frame_clear(frame);
    return status;
}

npg_status npg_frame_files_compare(const npg_frame_files *list, npg_rig_view **views)
{
    size_t *frames, count = 0;
    NPG_TRY(npg_alloc_array(views, NPG_FOR_FILES, list->rig->sensor_count, sizeof **views));
    NPG_TRY(npg_alloc_array(&frames, NPG_FOR_FILES, list->count, sizeof *frames));
    for (size_t i = 0; i < list->count; i++)
        if (list->slots[i].path) frames[count++] = npg_rig_find(list->rig, list->slots[i].number);
    npg_status status = npg_rig_compare(list->rig, *views, frames, count);
    npg_release(&frames);
    return status;
}

npg_status npg_frame_files_each(const npg_frame_files *list, size_t slot,
                                npg_status (*visit)(void *user, const char *path), void *user)
{
    const npg_frame_slot *at = &list->slots[slot];
    if (!list->rig) return visit(user, at->path);
    for (size_t s = 0, frame = npg_rig_find(list->rig, at->number); s < list->rig->sensor_count; s++) {
        const npg_rig_shot *shot = npg_rig_shot_of(list->rig, frame, s);
        const char *const paths[] = {shot ? shot->depth : NULL, shot ? shot->colour : NULL,
                                     shot ? shot->mask : NULL};
        for (size_t i = 0; i < sizeof paths / sizeof *paths; i++)
            if (paths[i]) NPG_TRY(visit(user, paths[i]));
    }
    return NPG_OK;
}

/* ---- checksums ---- */

static void release_hashes(void *value)
{
    npg_release(&value);
}

const npg_fact_kind npg_fact_input_hashes = {"input_hashes", "job", release_hashes};

npg_status npg_input_sum_add(void *user, const char *path)
{
    npg_input_sum *sum = user;
    struct stat info;
    uint64_t hash;
    if (stat(path, &info)) return npg_error_errno(NPG_BAD_INPUT, "can't read %s", path);
    npg_status status = npg_hash_file(&hash, path, UINT64_MAX);
    if (status) return status == NPG_DISK ? NPG_BAD_INPUT : status;
    sum->bytes += (int64_t)info.st_size;
    sum->hash = sum->is_begun ? (sum->hash ^ hash) * 0x9e3779b97f4a7c15u : hash;
    sum->is_begun = true;
    return NPG_OK;
}

npg_status npg_frame_files_sum(const npg_frame_files *list, size_t slot, npg_input_sum *sum)
{
    *sum = (npg_input_sum){.hash = list->slots[slot].calibration, .is_begun = list->rig != NULL};
    return npg_frame_files_each(list, slot, npg_input_sum_add, sum);
}

/* ---- option confine ---- */

static npg_status confine_to(void *user, const char *path)
{
    return npg_path_confine(path, user);
}

npg_status npg_frame_files_confine(const npg_frame_files *list, const char *input)
{
    char *folder;
    struct stat info;
    NPG_TRY(npg_copy_text(&folder, input));
    /* Of a pattern or a glob the longest part in front that is a folder. */
    while (folder[0] && strcmp(folder, "/") != 0 && (stat(folder, &info) || !S_ISDIR(info.st_mode))) {
        char *slash = strrchr(folder, '/');
        folder[!slash ? 0 : slash == folder ? 1 : slash - folder] = 0;
    }
    char here[] = ".", *place = folder[0] ? folder : here;
    npg_status status = NPG_OK;
    for (size_t i = 0; i < list->count && !status; i++)
        if (list->slots[i].path) status = npg_frame_files_each(list, i, confine_to, place);
    npg_release(&folder);
    return status;
}

void npg_frame_files_close(npg_frame_files **list)
{
    if (*list) npg_rig_close(&(*list)->rig);
    npg_object_close(list);
}

void npg_frame_files_gaps(char *text, size_t size, const npg_frame_files *list)
{
    size_t used = 0;
    text[0] = 0;
    for (size_t i = 0, next; i < list->count; i = next) {
        for (next = i + 1; next < list->count && !list->slots[i].path && !list->slots[next].path;) next++;
        if (list->slots[i].path) continue;
        char part[64];
        long long first = (long long)list->slots[i].number, last = (long long)list->slots[next - 1].number;
        const char *comma = used ? ", " : "";
        if (next == i + 1)
            snprintf(part, sizeof part, "%s%lld", comma, first);
        else
            snprintf(part, sizeof part, "%s%lld%s%lld", comma, first, next == i + 2 ? ", " : "-", last);
        /* Room is kept for the mark of what is left out. */
        bool fits = used + strlen(part) + sizeof ", ..." < size;
        used += (size_t)snprintf(text + used, size - used, "%s", fits ? part : used ? ", ..." : "...");
        if (!fits) return;
    }
}
