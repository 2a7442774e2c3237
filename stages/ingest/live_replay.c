/* Live replay: what came before a run was broken off, from its input log. */
#include <string.h>

#include "ingest/frame_names.h"
#include "ingest/live_source.h"

static bool holds(const npg_live_source *live)
{
    return live->settings.missing == NPG_MISSING_HOLD;
}

/* ---- where the source goes on ---- */

static npg_status resume_follow(npg_live_source *live, const npg_input_entry *entries, size_t count)
{
    npg_follow_place place = {0};
    for (size_t i = 0; i < count; i++) {
        const npg_input_entry *entry = &entries[i];
        if (entry->is_missing) continue;
        if (!entry->name)
            return npg_error(NPG_BAD_INPUT, "the log of inputs has no name for frame %lld",
                             (long long)entry->number);
        if (place.taken_count++) place.step = npg_common_divisor(entry->number - place.number, place.step);
        place.number = entry->number;
        place.last = entry->name;
        place.digits = (size_t)entry->digits;
    }
    return place.last ? npg_follow_resume(live->follow, &place) : NPG_OK;
}

npg_status npg_live_replay_open(npg_live_source *live)
{
    const npg_facts *facts = npg_worker_facts(live->worker);
    live->total = facts->is_resumed ? facts->frame_count : -1;
    if (!live->log) return NPG_OK;
    const npg_input_entry *entries = npg_input_log_entries(live->log, &live->replay_count);
    return live->follow ? resume_follow(live, entries, live->replay_count) : NPG_OK;
}

/* As if all of it had come in this run. */
static void end_replay(npg_live_source *live, const npg_input_entry *entries)
{
    size_t came = 0;
    for (size_t i = 0; i < live->replay_count; i++) came += !entries[i].is_missing;
    bool fills = live->settings.missing == NPG_MISSING_SKIP || holds(live);
    if (came > 1 && live->follow && live->settings.missing != NPG_MISSING_IGNORE)
        live->step = npg_follow_step(live->follow);
    if (came > 1 && !live->follow && !live->stream && fills) live->step = 1;
    npg_input_log_forget(live->log);
}

/* ---- one frame ---- */

static npg_status refuse(const npg_live_source *live, const npg_input_entry *entry, const char *what)
{
    return npg_error(NPG_USAGE,
                     "%s holds another job: frame %lld of %s %s; "
                     "give --restart to discard what is there, or choose another output folder",
                     npg_worker_settings(live->worker)->output, (long long)entry->number,
                     npg_live_source_name(live), what);
}

static npg_status check_content(const npg_live_source *live, const npg_input_entry *entry,
                                const npg_frame *frame)
{
    bool is_same = entry->bytes == (int64_t)frame->point_count && entry->hash == npg_live_frame_hash(frame);
    return is_same ? NPG_OK : refuse(live, entry, "is not the one it was");
}

static npg_status replay_streamed(npg_live_source *live, const npg_input_entry *entry, npg_frame *frame)
{
    npg_status status = npg_live_next_streamed(live, frame);
    if (status == NPG_END) return refuse(live, entry, "does not come any more");
    return status ? status : check_content(live, entry, frame);
}

/* The files were compared before the run began. */
static npg_status replay_followed(npg_live_source *live, const npg_input_entry *entry, npg_frame *frame)
{
    char *path;
    NPG_TRY(npg_follow_path(live->follow, &path, entry->name));
    if (entry->is_skipped) {
        frame->path = path;
        return NPG_OK;
    }
    npg_status status = npg_read_cloud(frame, path, npg_own(live->worker, origin));
    npg_release(&path);
    return status;
}

/* Those that are solved may be left out by the pusher. */
static npg_status replay_pushed(npg_live_source *live, const npg_input_entry *entry, bool is_needed,
                                npg_frame *frame)
{
    npg_status status = live->is_waiting ? NPG_OK : npg_live_next_pushed(live, &live->waiting);
    if (status && status != NPG_END) return status;
    live->is_waiting = !status;
    bool is_there = live->is_waiting && live->waiting.number == entry->number;
    if (live->is_waiting && live->waiting.number < entry->number) {
        const npg_input_entry other = {.number = live->waiting.number};
        return refuse(live, &other, "did not come before");
    }
    if (!is_there) return is_needed ? refuse(live, entry, "does not come any more") : NPG_OK;
    *frame = live->waiting;
    live->waiting = (npg_frame){0};
    live->is_waiting = false;
    return check_content(live, entry, frame);
}

static npg_status replay_frame(npg_live_source *live, const npg_input_entry *entry, npg_frame *frame)
{
    bool is_needed = npg_input_log_needs(live->log, live->replay_at, holds(live));
    if (entry->is_missing)
        NPG_TRY(entry->is_held && !entry->is_solved ? npg_frame_copy(frame, &live->previous) : NPG_OK);
    else if (live->stream)
        NPG_TRY(replay_streamed(live, entry, frame));
    else if (!live->follow)
        NPG_TRY(replay_pushed(live, entry, is_needed, frame));
    else if (is_needed || !entry->is_solved)
        NPG_TRY(replay_followed(live, entry, frame));
    frame->number = entry->number;
    frame->index = entry->index;
    frame->fields = NPG_FIELD_POINTS;
    frame->is_key = false;
    frame->is_held = entry->is_held;
    frame->is_skipped = entry->is_skipped;
    if (!entry->is_missing) frame->cleaning.read = frame->point_count;
    return NPG_OK;
}

static npg_status keep_number(npg_live_source *live, const npg_input_entry *entry, const npg_frame *frame)
{
    if (!entry->is_missing) NPG_TRY(npg_live_keep_previous(live, frame));
    live->previous.number = entry->number;
    if (entry->index >= 0) live->next = entry->index + 1;
    if (entry->is_skipped && (entry->index >= 0 || !entry->is_missing)) live->skipped_count++;
    live->seen++;
    return NPG_OK;
}

npg_status npg_live_replay(npg_live_source *live, npg_chunk *chunk)
{
    size_t count;
    const npg_input_entry *entries = npg_input_log_entries(live->log, &count);
    const npg_input_entry *entry = &entries[live->replay_at];
    npg_frame frame = {0};
    npg_status status = replay_frame(live, entry, &frame);
    if (!status) status = keep_number(live, entry, &frame);
    if (!status && !entry->is_solved) npg_chunk_add(chunk, &frame);
    npg_frame_clear(&frame);
    NPG_TRY(status);
    if (++live->replay_at == live->replay_count) end_replay(live, entries);
    return NPG_OK;
}
