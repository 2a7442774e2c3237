/* Capture: the frames of a capture in files, readable in any order, with a store of what was read. */
#include "ingest/ingest_internal.h"

static npg_status refuse_gaps(const npg_capture *capture, const char *input)
{
    char numbers[256];
    const npg_frame_files *list = capture->list;
    if (capture->missing != NPG_MISSING_ERROR || !list->gap_count) return NPG_OK;
    npg_frame_files_gaps(numbers, sizeof numbers, list);
    return npg_error(NPG_BAD_INPUT,
                     "%s: %zu of %zu frames are missing: %s (missing = skip or hold goes on without them)",
                     input, list->gap_count, list->count, numbers);
}

npg_status npg_capture_open(npg_capture **out, npg_frame_files **list, const char *input, npg_missing missing,
                            bool keep_going, npg_frame_store *store)
{
    npg_status status = npg_object_open(out, NPG_FOR_FILES, sizeof **out);
    if (status) npg_frame_files_close(list);
    NPG_TRY(status);
    npg_capture *c = *out;
    c->list = *list;
    *list = NULL;
    c->missing = missing;
    c->keep_going = keep_going;
    c->store = store;
    c->is_bad = npg_arena_take(&c->arena, c->list->count, sizeof *c->is_bad);
    c->hashes = npg_arena_take(&c->arena, c->list->count, sizeof *c->hashes);
    status = npg_arena_status(&c->arena);
    if (!status) status = refuse_gaps(c, input);
    if (status) npg_capture_close(out);
    return status;
}

void npg_capture_close(npg_capture **slot)
{
    if (*slot) npg_frame_files_close(&(*slot)->list);
    npg_object_close(slot);
}

/* A file that somebody exchanges while the run is on would give meshes of two captures.  Asked after it was read, so
 * that none slips in between. */
static npg_status check_unchanged(npg_capture *c, int64_t index)
{
    npg_input_sum now;
    const npg_frame_slot *slot = &c->list->slots[index];
    NPG_TRY(npg_frame_files_sum(c->list, (size_t)index, &now));
    if (c->hashes[index] && c->hashes[index] != now.hash)
        return npg_error(
            NPG_USAGE,
            "the input %s was exchanged while the run is on (frame %lld): put it back and run again, "
            "or begin anew with --restart",
            slot->path, (long long)slot->number);
    c->hashes[index] = now.hash;
    return NPG_OK;
}

static npg_status read_slot(npg_capture *c, npg_frame *frame, int64_t index, npg_origin *origin,
                            bool is_last_use)
{
    if (!npg_frame_store_get(c->store, frame, index, is_last_use)) return NPG_OK;
    c->reads++;
    NPG_TRY(npg_frame_files_read(c->list, (size_t)index, frame, origin));
    NPG_TRY(check_unchanged(c, index));
    frame->index = index; /* what the store keeps it under; a gap that holds it has another one */
    return is_last_use ? NPG_OK : npg_frame_store_put(c->store, frame, false);
}

/* ---- frames that are not there ---- */

static bool is_readable(const npg_capture *c, int64_t index)
{
    return c->list->slots[index].path && !c->is_bad[index];
}

/* The points of the nearest usable frame before the gap, or after it where none is before.  They are read as
 * not for the last time: other frames of the same gap, and the frame itself, need them again. */
static npg_status read_held(npg_capture *c, npg_frame *frame, int64_t index, npg_origin *origin)
{
    int64_t count = (int64_t)c->list->count;
    for (int direction = -1; direction <= 1; direction += 2)
        for (int64_t i = index + direction; i >= 0 && i < count; i += direction) {
            if (!is_readable(c, i)) continue;
            npg_status status = read_slot(c, frame, i, origin, false);
            if (status != NPG_BAD_INPUT || !c->keep_going) {
                frame->is_held = true;
                return status;
            }
        }
    return npg_error(NPG_BAD_INPUT, "frame %lld: no frame could be read whose points it could hold",
                     (long long)c->list->slots[index].number);
}

static npg_status read_or_skip(npg_capture *c, npg_frame *frame, int64_t index, npg_origin *origin,
                               bool is_last_use)
{
    npg_status status = read_slot(c, frame, index, origin, is_last_use);
    if (status != NPG_BAD_INPUT) return status;
    if (!c->keep_going)
        return npg_error_advise(
            npg_error_prefix(status, "frame %lld", (long long)c->list->slots[index].number),
            NPG_ADVISE_KEEP_GOING);
    c->is_bad[index] = 1;
    frame->is_skipped = true;
    return NPG_PARTIAL;
}

npg_status npg_capture_read(npg_capture *c, npg_frame *frame, int64_t index, npg_origin *origin,
                            bool is_last_use)
{
    npg_status status = NPG_OK;
    *frame = (npg_frame){0};
    if (is_readable(c, index))
        status = read_or_skip(c, frame, index, origin, is_last_use);
    else if (c->missing == NPG_MISSING_HOLD && !c->is_bad[index])
        status = read_held(c, frame, index, origin);
    else
        frame->is_skipped = true;
    if (status < 0) {
        npg_frame_clear(frame);
        return status;
    }
    frame->index = index;
    frame->number = c->list->slots[index].number;
    frame->fields = NPG_FIELD_POINTS | (frame->fields & NPG_FIELD_CLEAN);
    return status;
}
