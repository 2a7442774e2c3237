/* Live source: frames that come one after the other. */
#include "ingest/live_source.h"

#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "pipeline/file.h"

/* Frames of one gap.  Each becomes a frame of the run, so a number that is damaged or a time stamp must not
 * make millions; set far above what a capture loses. */
#define GAP_MAX 100000

/* ---- opening ---- */

static npg_status open_follow(npg_live_source *live)
{
    const npg_live_settings *s = &live->settings;
    const npg_follow_settings settings = {.where = npg_worker_settings(live->worker)->follow,
                                          .confine = npg_worker_settings(live->worker)->confine,
                                          .end_name = s->follow_end,
                                          .idle_s = s->follow_idle_s,
                                          .settle_s = s->follow_settle_s,
                                          .finds_gaps = s->missing != NPG_MISSING_IGNORE,
                                          .stopping = npg_worker_should_stop,
                                          .user = live->worker};
    if (!s->follow_end[0] && !(s->follow_idle_s > 0))
        return npg_error(NPG_USAGE, "option follow-end: nothing would ever end this run");
    return npg_follow_open(&live->follow, &settings);
}

static npg_status open_source(npg_live_source *live)
{
    const npg_settings *settings = npg_worker_settings(live->worker);
    const char *frames = live->settings.frames;
    if (!settings->input[0] && !settings->follow[0]) {
        if (!frames[strspn(frames, " ")]) return NPG_OK;
        return npg_error(NPG_USAGE,
                         "option frames: pushed frames are not selected; push those that are wanted");
    }
    NPG_TRY(npg_selection_parse(&live->selection, frames));
    if (npg_selection_needs_count(&live->selection))
        return npg_error(NPG_USAGE, "option frames: \"%s\": a live source can't be counted from its end",
                         frames);
    if (settings->follow[0]) return open_follow(live);
    NPG_TRY(npg_stream_open(&live->stream, STDIN_FILENO, "standard input"));
    npg_stream_set_stop(live->stream, npg_worker_should_stop, live->worker);
    return NPG_OK;
}

npg_status npg_live_source_open(npg_live_source *live, npg_worker *worker, const npg_live_settings *settings)
{
    live->worker = worker;
    live->settings = *settings;
    live->log = npg_worker_fact(worker, &npg_fact_input_log);
    NPG_TRY(open_source(live));
    return npg_live_replay_open(live);
}

void npg_live_source_close(npg_live_source *live)
{
    npg_selection_clear(&live->selection);
    npg_stream_close(&live->stream);
    npg_follow_close(&live->follow);
    npg_chunk_unref(&live->pushed);
    npg_frame_clear(&live->waiting);
    npg_frame_clear(&live->previous);
}

const char *npg_live_source_name(const npg_live_source *live)
{
    return live->stream   ? "standard input"
           : live->follow ? npg_worker_settings(live->worker)->follow
                          : "the pushing program";
}

/* ---- the next frame ---- */

/* The next frame that was pushed, its arrays moved out of the chunk. */
npg_status npg_live_next_pushed(npg_live_source *live, npg_frame *frame)
{
    while (!live->pushed || live->pushed_at == npg_chunk_count(live->pushed)) {
        npg_chunk_unref(&live->pushed);
        live->pushed_at = 0;
        NPG_TRY(npg_worker_feed(live->worker, &live->pushed));
    }
    npg_frame *first = npg_chunk_frame(live->pushed, live->pushed_at++);
    *frame = *first;
    *first = (npg_frame){0};
    return NPG_OK;
}

static npg_status next_followed(npg_live_source *live, npg_frame *frame)
{
    npg_status status = npg_follow_next(live->follow, frame, npg_own(live->worker, origin));
    if (status != NPG_PARTIAL) return status;
    if (!npg_worker_settings(live->worker)->keep_going) {
        npg_frame_clear(frame);
        return NPG_BAD_INPUT; /* the text is the reader's */
    }
    npg_worker_warn(live->worker, true, frame->number, "skipped: %s", npg_error_text());
    live->skipped_count++;
    frame->is_skipped = true;
    frame->fields = NPG_FIELD_POINTS;
    return NPG_OK;
}

/* After a damaged frame nobody knows where the next one begins on a pipe: with keep-going the stream ends
 * there, and what came before is finished. */
npg_status npg_live_next_streamed(npg_live_source *live, npg_frame *frame)
{
    npg_status status = npg_stream_next(live->stream, frame, npg_own(live->worker, origin));
    if (status != NPG_BAD_INPUT || !npg_worker_settings(live->worker)->keep_going || !live->next)
        return status;
    npg_worker_warn(live->worker, true, live->seen, "the stream is taken to end here: %s", npg_error_text());
    return NPG_END;
}

static npg_status next_frame(npg_live_source *live, npg_frame *frame)
{
    NPG_TRY(live->stream   ? npg_live_next_streamed(live, frame)
            : live->follow ? next_followed(live, frame)
                           : npg_live_next_pushed(live, frame));
    frame->cleaning.read = frame->point_count;
    return NPG_OK;
}

/* ---- the log ---- */

uint64_t npg_live_frame_hash(const npg_frame *frame)
{
    const size_t vectors = frame->point_count * 3 * sizeof(float);
    uint64_t hash = frame->pos_local ? XXH3_64bits(frame->pos_local, vectors) : 0;
    if (frame->normals) hash = XXH3_64bits_withSeed(frame->normals, vectors, hash + 1);
    if (frame->colours) hash = XXH3_64bits_withSeed(frame->colours, 4 * frame->point_count, hash + 2);
    return hash;
}

/* A file that has gone since it was read can't be compared later. */
static npg_status describe_file(npg_input_entry *entry, const char *path)
{
    struct stat info;
    entry->bytes = -1;
    if (entry->is_skipped || stat(path, &info)) return NPG_OK;
    npg_status status = npg_hash_file(&entry->hash, path, UINT64_MAX);
    if (!status) entry->bytes = (int64_t)info.st_size;
    return status == NPG_MEMORY ? status : NPG_OK;
}

static npg_status log_frame(npg_live_source *live, const npg_frame *frame, int64_t index)
{
    npg_input_entry entry = {.number = frame->number, .index = index, .is_skipped = frame->is_skipped};
    if (!live->log) return NPG_OK;
    if (live->follow) {
        entry.name = strrchr(frame->path, '/') + 1;
        entry.digits = (int64_t)npg_follow_digits(live->follow);
        NPG_TRY(describe_file(&entry, frame->path));
    } else {
        entry.bytes = (int64_t)frame->point_count;
        entry.hash = npg_live_frame_hash(frame);
    }
    return npg_input_log_add(live->log, &entry);
}

static npg_status log_missing(npg_live_source *live, const npg_frame *frame, int64_t index)
{
    const npg_input_entry entry = {.number = frame->number,
                                   .index = index,
                                   .bytes = -1,
                                   .is_missing = true,
                                   .is_held = frame->is_held,
                                   .is_skipped = frame->is_skipped};
    return live->log ? npg_input_log_add(live->log, &entry) : NPG_OK;
}

/* ---- gaps ---- */

static npg_status refuse_gap(const npg_live_source *live, int64_t gap, int64_t number)
{
    if (gap > GAP_MAX)
        return npg_error(NPG_BAD_INPUT, "frame %lld comes %lld numbers after the one before it",
                         (long long)number, (long long)gap + 1);
    return npg_error(NPG_BAD_INPUT,
                     "%lld frames are missing between %lld and %lld "
                     "(option missing: skip or hold goes on, "
                     "ignore takes the frames as they follow each other)",
                     (long long)gap, (long long)live->previous.number, (long long)number);
}

/* A smaller step than so far shows that frames were missing before; they are behind us. */
static npg_status check_step(npg_live_source *live, int64_t step, int64_t number, bool fills)
{
    if (!live->step || step == live->step) return NPG_OK;
    if (!fills)
        return npg_error(NPG_BAD_INPUT,
                         "frame %lld: the numbers grew by %lld before and now by %lld: frames are missing",
                         (long long)number, (long long)live->step, (long long)step);
    npg_worker_warn(live->worker, true, number,
                    "the numbers grew by %lld before and now by %lld: frames before it are missing",
                    (long long)live->step, (long long)step);
    return NPG_OK;
}

/* How many frames are missing before this one.  Numbers may jump: in a folder as in any capture of files; of
 * pushed frames only skip and hold ask for those that lie between; a pipe has no numbers of its own. */
static npg_status count_gap(npg_live_source *live, const npg_frame *frame)
{
    npg_missing missing = live->settings.missing;
    int64_t step = live->follow ? npg_follow_step(live->follow) : 1;
    bool fills = missing == NPG_MISSING_SKIP || missing == NPG_MISSING_HOLD;
    bool is_checked = live->follow ? missing != NPG_MISSING_IGNORE : fills && !live->stream;
    live->gap_left = 0;
    if (!live->seen || !is_checked) return NPG_OK;
    NPG_TRY(check_step(live, step, frame->number, fills));
    live->step = step;
    int64_t gap = (frame->number - live->previous.number) / step - 1;
    if (gap > GAP_MAX || (gap > 0 && !fills)) return refuse_gap(live, gap, frame->number);
    live->gap_left = gap;
    return NPG_OK;
}

npg_status npg_live_keep_previous(npg_live_source *live, const npg_frame *frame)
{
    npg_frame_clear(&live->previous);
    if (live->settings.missing == NPG_MISSING_HOLD && !live->stream)
        return npg_frame_copy(&live->previous, frame);
    live->previous.number = frame->number;
    return NPG_OK;
}

static npg_status fill_gap(npg_live_source *live, npg_chunk *chunk)
{
    npg_frame frame = {.fields = NPG_FIELD_POINTS};
    live->gap_left--;
    int64_t number = live->previous.number += live->step;
    bool is_held = live->settings.missing == NPG_MISSING_HOLD;
    bool is_chosen = npg_selection_takes(&live->selection, live->seen++, number, -1);
    if (is_chosen && is_held) NPG_TRY(npg_frame_copy(&frame, &live->previous));
    frame.number = number;
    frame.is_key = false;
    frame.is_held = is_held;
    frame.is_skipped = !is_held || live->previous.is_skipped;
    npg_status status = log_missing(live, &frame, is_chosen ? live->next : -1);
    if (status || !is_chosen) {
        npg_frame_clear(&frame);
        return status;
    }
    frame.index = live->next++;
    live->skipped_count += frame.is_skipped;
    npg_worker_warn(live->worker, !is_held, number, "the frame is missing and %s",
                    is_held ? "repeats the frame before it" : "is skipped");
    npg_chunk_add(chunk, &frame);
    return NPG_OK;
}

/* ---- the end ---- */

/* An earlier run has seen the end: files that came since are not taken, none may be missing. */
static npg_status check_end(npg_live_source *live)
{
    size_t fresh = 0;
    if (live->total < 0) return NPG_OK;
    if (live->next < live->total)
        return npg_error(NPG_USAGE,
                         "%s holds another job: %s had %lld frames and has %lld; "
                         "give --restart to discard what is there, or choose another output folder",
                         npg_worker_settings(live->worker)->output, npg_live_source_name(live),
                         (long long)live->total, (long long)live->next);
    if (live->follow) NPG_TRY(npg_follow_count_new(live->follow, &fresh));
    if (fresh)
        npg_worker_warn(live->worker, false, -1,
                        "%zu files came since the earlier run had seen the end: they are left out", fresh);
    return NPG_OK;
}

static npg_status end_live(npg_live_source *live)
{
    json_t *report = npg_worker_report(live->worker);
    size_t late_count = live->follow ? npg_follow_late_count(live->follow) : 0;
    const char *name = npg_live_source_name(live);
    if (!live->next) return npg_error(NPG_BAD_INPUT, "%s: no frame came", name);
    NPG_TRY(check_end(live));
    *npg_own(live->worker, skipped_count) = live->skipped_count;
    if (live->skipped_count == live->next)
        return npg_error(NPG_BAD_INPUT, "%s: none of the %lld frames can be used", name,
                         (long long)live->next);
    if (late_count)
        npg_worker_warn(live->worker, true, -1,
                        "%zu files came after a later one had been taken and are left out", late_count);
    *npg_own(live->worker, frame_count) = live->next;
    json_object_set_new(report, "frames", json_integer((json_int_t)live->next));
    json_object_set_new(report, "skipped", json_integer((json_int_t)live->skipped_count));
    return NPG_END;
}

/* ---- frame after frame ---- */

static npg_status take_waiting(npg_live_source *live, npg_chunk *chunk)
{
    npg_frame *frame = &live->waiting;
    bool is_chosen = npg_selection_takes(&live->selection, live->seen++, frame->number, -1);
    live->is_waiting = false;
    NPG_TRY(npg_live_keep_previous(live, frame));
    NPG_TRY(log_frame(live, frame, is_chosen ? live->next : -1));
    if (!is_chosen) {
        npg_frame_clear(frame);
        return NPG_OK;
    }
    frame->index = live->next++;
    npg_chunk_add(chunk, frame);
    return NPG_OK;
}

/* The chunk stays empty for a frame that is not chosen. */
static npg_status step(npg_live_source *live, npg_chunk *chunk)
{
    if (live->replay_at < live->replay_count) return npg_live_replay(live, chunk);
    if (live->total >= 0 && live->next >= live->total) return end_live(live);
    if (!live->is_waiting) {
        npg_status status = next_frame(live, &live->waiting);
        if (status) return status == NPG_END ? end_live(live) : status;
        live->is_waiting = true;
        live->is_counted = false;
    }
    if (!live->is_counted) NPG_TRY(count_gap(live, &live->waiting));
    live->is_counted = true;
    return live->gap_left > 0 ? fill_gap(live, chunk) : take_waiting(live, chunk);
}

npg_status npg_live_source_next(npg_live_source *live, npg_chunk *chunk)
{
    while (!npg_chunk_count(chunk)) {
        if (npg_worker_stopping(live->worker)) return npg_error(NPG_STOPPED, "stopped while reading");
        NPG_TRY(step(live, chunk));
    }
    return NPG_OK;
}
