/* Live source: frames that come one after the other. */
#include "ingest/ingest_internal.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* Frames of one gap.  Each becomes a frame of the run, so a number that is damaged or a time stamp must not
 * make millions; set far above what a capture loses. */
#define GAP_MAX 100000

struct npg_live_source {
    npg_worker *worker; /* a loan */
    npg_live_settings settings;
    npg_selection selection;
    npg_stream *stream; /* standard input                                  */
    npg_follow *follow; /* a folder that grows; neither: frames are pushed */
    npg_chunk *pushed;  /* the pushed chunk under way                      */
    size_t pushed_at;
    int64_t next;                /* index of the next frame                               */
    int64_t seen;                /* frames that came or are missing, chosen or not        */
    npg_frame waiting, previous; /* the frame behind a gap; a copy of the one before it   */
    int64_t gap_left, step;      /* missing frames before the waiting one; their distance */
    bool is_waiting;
    int64_t skipped_count;
    npg_frame last;         /* the one that was taken last, until it is read; its index is next - 1 */
    npg_store *spool;       /* of what came; a loan, or ...                                     */
    npg_store *own;         /* ... without a job one that has no name: of the look-ahead        */
    npg_frame_store *cache; /* of what was read and cleaned; a loan                              */
    uint64_t key;           /* of the last entry of the spool                                    */
    int64_t *entries;       /* in the spool, of each frame by index, where some are not selected */
    size_t entry_capacity;
    int64_t came;     /* entries of the spool that earlier runs had ...                      */
    int64_t again;    /* ... that were walked again, and, as they came again by being ...    */
    int64_t compared; /* ... pushed, compared                                                */
    int64_t total;    /* frames, where an earlier run has seen the end; else -1              */
    bool is_ended;
    char cause[512]; /* why the frame that was skipped last was */
};

/* ---- opening ---- */

static bool holds(const npg_live_source *live)
{
    return live->settings.missing == NPG_MISSING_HOLD;
}

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
    return npg_stream_open(&live->stream, STDIN_FILENO, "standard input", npg_worker_should_stop,
                           live->worker);
}

static const char *name_of(const npg_live_source *live)
{
    return live->stream   ? "standard input"
           : live->follow ? npg_worker_settings(live->worker)->follow
                          : "the pushing program";
}

/* ---- the next frame ---- */

/* The next frame that was pushed, its arrays moved out of the chunk. */
static npg_status next_of_feed(npg_live_source *live, npg_frame *frame)
{
    while (!live->pushed || live->pushed_at == npg_chunk_count(live->pushed)) {
        npg_chunk_close(&live->pushed);
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
        return npg_error_advise(NPG_BAD_INPUT, NPG_ADVISE_KEEP_GOING); /* the text is the reader's */
    }
    npg_worker_warn(live->worker, true, frame->number, "skipped: %s", npg_error_text());
    snprintf(live->cause, sizeof live->cause, "%s", npg_error_text());
    live->skipped_count++;
    frame->is_skipped = true;
    frame->fields = NPG_FIELD_POINTS;
    return NPG_OK;
}

/* After a damaged frame nobody knows where the next one begins on a pipe: with keep-going the stream ends
 * there, and what came before is finished. */
static npg_status next_streamed(npg_live_source *live, npg_frame *frame)
{
    npg_status status = npg_stream_next(live->stream, frame, npg_own(live->worker, origin));
    if (status != NPG_BAD_INPUT || !npg_worker_settings(live->worker)->keep_going || !live->next)
        return status;
    npg_worker_warn(live->worker, true, live->seen, "the stream is taken to end here: %s", npg_error_text());
    return NPG_END;
}

/* What is there is not of this source. */
static npg_status refuse(const npg_live_source *live, int64_t number, const char *what)
{
    npg_error(NPG_USAGE, "frame %lld of %s %s", (long long)number, name_of(live), what);
    return npg_worker_refuse_job(live->worker);
}

static npg_status check_content(const npg_live_source *live, const npg_spooled *entry, const npg_frame *frame)
{
    bool is_same = entry->points == (int64_t)frame->point_count && entry->hash == npg_spool_hash(frame);
    return is_same ? NPG_OK : refuse(live, entry->number, "is not the one it was");
}

/* Frames that earlier runs had may be pushed again, or left out. */
static npg_status next_pushed(npg_live_source *live, npg_frame *frame)
{
    for (npg_spooled entry;; npg_frame_clear(frame)) {
        NPG_TRY(next_of_feed(live, frame));
        entry.number = INT64_MIN;
        while (live->compared < live->came && entry.number < frame->number)
            NPG_TRY(npg_spool_get(live->spool, live->compared++, &entry, NULL));
        if (entry.number < frame->number) return NPG_OK;
        if (entry.number > frame->number || entry.is_missing)
            return refuse(live, frame->number, "did not come before");
        NPG_TRY(check_content(live, &entry, frame));
    }
}

/* ---- what earlier runs had comes again, from the spool ---- */

static bool is_again(const npg_live_source *live)
{
    return live->seen < live->came;
}

/* Whether an earlier run had this frame in its state, and has said what there is to say of it. */
static bool is_told(const npg_live_source *live, int64_t index)
{
    const npg_facts *facts = npg_worker_facts(live->worker);
    return index < 0 || npg_plan_is_read(&facts->plan, index, facts->resumed_read, facts->frame_count);
}

/* A frame that was piped comes again. */
static npg_status compare_streamed(npg_live_source *live, const npg_spooled *entry)
{
    npg_frame frame = {0};
    npg_status status = next_streamed(live, &frame);
    if (status == NPG_END) return refuse(live, entry->number, "does not come any more");
    if (!status) status = check_content(live, entry, &frame);
    npg_frame_clear(&frame);
    return status;
}

/* The folder goes on behind the file of this entry. */
static npg_status pass_file(npg_follow *follow, const npg_spooled *entry, const npg_record *record)
{
    const char *path = npg_spool_text(record, "path"), *slash = path ? strrchr(path, '/') : NULL;
    return slash ? npg_follow_pass(follow, slash + 1, (size_t)entry->digits, entry->number) : NPG_OK;
}

static npg_status next_again(npg_live_source *live, npg_frame *frame)
{
    npg_record *record;
    npg_spooled entry;
    NPG_TRY(npg_spool_get(live->spool, live->again++, &entry, &record));
    const char *cause = npg_spool_text(record, "cause");
    npg_status status = live->stream   ? compare_streamed(live, &entry)
                        : live->follow ? pass_file(live->follow, &entry, record)
                                       : NPG_OK;
    if (!status) status = npg_spool_frame(&entry, record, frame);
    if (!status && cause && !is_told(live, entry.index))
        npg_worker_warn(live->worker, true, entry.number, "skipped: %s", cause);
    if (!status) live->skipped_count += entry.is_skipped;
    npg_record_close(&record);
    return status;
}

/* Gaps are counted anew: entries of missing frames are passed over. */
static npg_status skip_missing(npg_live_source *live)
{
    npg_spooled entry = {.is_missing = true};
    while (live->again < live->came && entry.is_missing) {
        NPG_TRY(npg_spool_get(live->spool, live->again, &entry, NULL));
        live->again += entry.is_missing;
    }
    return NPG_OK;
}

static npg_status next_frame(npg_live_source *live, npg_frame *frame)
{
    NPG_TRY(live->again < live->came ? next_again(live, frame)
            : live->stream           ? next_streamed(live, frame)
            : live->follow           ? next_followed(live, frame)
                                     : next_pushed(live, frame));
    frame->cleaning.read = frame->point_count;
    return NPG_OK;
}

/* ---- the spool ---- */

/* Where frame `index` is in the spool. */
static npg_status note_place(npg_live_source *live, int64_t index, int64_t entry)
{
    NPG_TRY(npg_grow(&live->entries, &live->entry_capacity, (size_t)index + 1, sizeof *live->entries,
                     NPG_FOR_FILES));
    live->entries[index] = entry;
    return NPG_OK;
}

static npg_status spool(npg_live_source *live, const npg_frame *frame, bool is_missing)
{
    npg_spooled entry = {.number = frame->number,
                         .index = frame->index,
                         .points = -1,
                         .key = live->key,
                         .is_missing = is_missing,
                         .is_held = frame->is_held,
                         .is_skipped = frame->is_skipped};
    if (live->follow) entry.digits = (int64_t)npg_follow_facts_of(live->follow)->digits;
    if (!is_missing) entry.points = (int64_t)frame->point_count;
    if (!is_missing) entry.hash = npg_spool_hash(frame);
    const char *cause = frame->is_skipped && !is_missing ? live->cause : NULL;
    NPG_TRY(npg_spool_add(live->spool, &entry, frame, frame->index >= 0 || holds(live), cause));
    live->key = entry.key;
    return NPG_OK;
}

/* The frame that came, or is missing, in the spool; then it is the last one, where it was selected. */
static npg_status keep(npg_live_source *live, npg_frame *frame, bool is_missing, bool is_chosen)
{
    npg_status status = NPG_OK;
    frame->index = is_chosen ? live->next : -1;
    if (!live->own || live->next < live->settings.look_ahead) {
        if (is_chosen) status = note_place(live, live->next, live->seen);
        if (!status && !is_again(live)) status = spool(live, frame, is_missing);
    }
    live->seen++;
    npg_frame_clear(&live->last);
    if (!status && is_chosen) {
        live->last = *frame;
        *frame = (npg_frame){0};
        live->skipped_count += is_missing && live->last.is_skipped;
        live->next++;
    }
    npg_frame_clear(frame);
    return status;
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
    if (!is_again(live))
        npg_worker_warn(live->worker, true, number,
                        "the numbers grew by %lld before and now by %lld: frames before it are missing",
                        (long long)live->step, (long long)step);
    return NPG_OK;
}

/* How many frames are missing before this one.  Numbers may jump: in a folder as in any capture of files; of
 * pushed frames only skip and hold ask for those that lie between; a pipe has no numbers of its own. */
static npg_status count_gap(npg_live_source *live, const npg_frame *frame)
{
    int missing = live->settings.missing;
    int64_t step = live->follow ? npg_follow_facts_of(live->follow)->step : 1;
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

static npg_status keep_previous(npg_live_source *live, const npg_frame *frame)
{
    npg_frame_clear(&live->previous);
    if (holds(live) && !live->stream) return npg_frame_copy(&live->previous, frame);
    live->previous.number = frame->number;
    return NPG_OK;
}

static npg_status fill_gap(npg_live_source *live)
{
    npg_frame frame = {.fields = NPG_FIELD_POINTS};
    live->gap_left--;
    int64_t number = live->previous.number += live->step;
    bool is_held = holds(live), is_chosen = npg_selection_takes(&live->selection, live->seen, number, -1);
    if (is_chosen && is_held) NPG_TRY(npg_frame_copy(&frame, &live->previous));
    frame.number = number;
    frame.is_key = false;
    frame.is_held = is_held;
    frame.is_skipped = !is_held || live->previous.is_skipped;
    if (is_chosen && !(is_again(live) && is_told(live, live->next)))
        npg_worker_warn(live->worker, !is_held, number, "the frame is missing and %s",
                        is_held ? "repeats the frame before it" : "is skipped");
    return keep(live, &frame, true, is_chosen);
}

/* ---- the end ---- */

/* An earlier run has seen the end: files that came since are not taken, none may be missing. */
static npg_status check_end(npg_live_source *live)
{
    size_t fresh = 0;
    npg_frame frame = {0};
    npg_status status = NPG_OK;
    if (live->total < 0) return NPG_OK;
    /* what is pushed again is compared */
    while (!live->stream && !live->follow && !status) {
        status = next_pushed(live, &frame);
        if (!status) status = refuse(live, frame.number, "did not come before");
        npg_frame_clear(&frame);
    }
    if (status && status != NPG_END) return status;
    if (live->next < live->total) {
        npg_error(NPG_USAGE, "%s had %lld frames and has %lld", name_of(live), (long long)live->total,
                  (long long)live->next);
        return npg_worker_refuse_job(live->worker);
    }
    if (live->follow) NPG_TRY(npg_follow_count_new(live->follow, &fresh));
    if (fresh)
        npg_worker_warn(live->worker, false, -1,
                        "%zu files came since the earlier run had seen the end: they are left out", fresh);
    return NPG_OK;
}

static npg_status end_live(npg_live_source *live)
{
    json_t *report = npg_worker_report(live->worker);
    size_t late_count = live->follow ? npg_follow_facts_of(live->follow)->late_count : 0;
    const char *name = name_of(live);
    live->is_ended = true;
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

static npg_status take_waiting(npg_live_source *live)
{
    npg_frame *frame = &live->waiting;
    bool is_chosen = npg_selection_takes(&live->selection, live->seen, frame->number, -1);
    live->is_waiting = false;
    NPG_TRY(keep_previous(live, frame));
    return keep(live, frame, false, is_chosen);
}

/* One more frame that came or is missing; NPG_END. */
static npg_status step(npg_live_source *live)
{
    if (live->is_ended) return NPG_END;
    if (npg_worker_stopping(live->worker)) return npg_error(NPG_STOPPED, "stopped while reading");
    if (live->total >= 0 && live->next >= live->total && !is_again(live)) return end_live(live);
    if (!live->is_waiting) {
        npg_status status = next_frame(live, &live->waiting);
        if (status) return status == NPG_END ? end_live(live) : status;
        live->is_waiting = true;
        NPG_TRY(count_gap(live, &live->waiting));
    }
    return live->gap_left > 0 ? fill_gap(live) : take_waiting(live);
}

/* Frame `index` has come, and with it all before. */
static npg_status await(npg_live_source *live, int64_t index)
{
    npg_status status = NPG_OK;
    while (live->next <= index && !status) status = step(live);
    return status;
}

static npg_status from_spool(npg_live_source *live, npg_frame *frame, int64_t index)
{
    npg_record *record;
    npg_spooled entry;
    NPG_TRY(npg_spool_get(live->spool, live->entries[index], &entry, &record));
    npg_status status = npg_spool_frame(&entry, record, frame);
    npg_record_close(&record);
    return status;
}

npg_status npg_live_source_read(npg_live_source *live, npg_frame *frame, int64_t index, bool is_last_use)
{
    npg_pass pass = npg_worker_pass(live->worker);
    *frame = (npg_frame){0};
    if (pass == NPG_PASS_MEASURE || index >= npg_worker_facts(live->worker)->planned_count) {
        if (pass != NPG_PASS_MEASURE && pass != NPG_PASS_SOLVE) return NPG_END;
        NPG_TRY(await(live, index));
    }
    npg_status status = npg_frame_store_get(live->cache, frame, index, is_last_use);
    if (status != NPG_END) {
        frame->fields &= NPG_FIELD_POINTS | NPG_FIELD_CLEAN;
        return status;
    }
    if (live->last.fields && live->last.index == index) {
        *frame = live->last;
        live->last = (npg_frame){0};
    } else {
        NPG_TRY(from_spool(live, frame, index));
    }
    status = is_last_use ? NPG_OK : npg_frame_store_put(live->cache, frame, false);
    if (status) npg_frame_clear(frame);
    return status;
}

npg_status npg_live_source_end(npg_live_source *live)
{
    const bool is_first = npg_worker_pass(live->worker) == NPG_PASS_MEASURE;
    const int64_t most = live->settings.look_ahead;
    npg_status status = is_first ? await(live, most) : step(live);
    if (status && status != NPG_END) return status;
    if (is_first) *npg_own(live->worker, planned_count) = live->next < most ? live->next : most;
    return is_first || status ? NPG_END : npg_error(NPG_FAILED, "a frame came behind the last one");
}

/* ---- the whole ---- */

/* As if all that earlier runs had came in this one. */
static npg_status walk_again(npg_live_source *live)
{
    npg_spooled last;
    npg_status status = NPG_OK;
    live->came = npg_spool_count(live->spool);
    if (live->came) NPG_TRY(npg_spool_get(live->spool, live->came - 1, &last, NULL));
    if (live->came) live->key = last.key;
    while (!status && (live->is_waiting || live->again < live->came)) {
        if (!live->is_waiting) status = skip_missing(live);
        if (!status && (live->is_waiting || live->again < live->came)) status = step(live);
    }
    return status;
}

npg_status npg_live_source_open(npg_live_source **out, npg_worker *worker, const npg_live_settings *settings,
                                npg_frame_store *store)
{
    const npg_facts *facts = npg_worker_facts(worker);
    npg_live_source *live;
    *out = NULL;
    NPG_TRY(npg_alloc(&live, NPG_FOR_FILES, sizeof *live));
    live->worker = worker;
    live->settings = *settings;
    live->cache = store;
    live->total = facts->is_resumed ? facts->frame_count : -1;
    live->spool = npg_worker_fact(worker, &npg_fact_spool);
    npg_status status = NPG_OK;
    if (!live->spool) {
        status = npg_store_open_nameless(&live->own, NULL);
        live->spool = live->own;
    }
    if (!status) status = open_source(live);
    if (!status && facts->is_resumed) status = walk_again(live);
    if (status) npg_live_source_close(&live);
    *out = live;
    return status;
}

void npg_live_source_close(npg_live_source **slot)
{
    npg_live_source *live = *slot;
    if (!live) return;
    npg_selection_clear(&live->selection);
    npg_stream_close(&live->stream);
    npg_follow_close(&live->follow);
    npg_chunk_close(&live->pushed);
    npg_frame_clear(&live->waiting);
    npg_frame_clear(&live->previous);
    npg_frame_clear(&live->last);
    npg_store_close(&live->own);
    npg_release(&live->entries);
    npg_release(slot);
}

npg_status npg_live_check_done(npg_worker *worker, npg_store *spool)
{
    npg_live_source *live;
    size_t fresh = 0;
    if (!npg_worker_settings(worker)->follow[0]) return NPG_OK;
    NPG_TRY(npg_alloc(&live, NPG_FOR_FILES, sizeof *live));
    live->worker = worker;
    live->settings = (npg_live_settings){
        .follow_end = npg_options_get(npg_worker_options(worker), "follow-end.name"), .follow_idle_s = 1};
    npg_status status = open_follow(live);
    for (int64_t i = 0; i < npg_spool_count(spool) && !status; i++) {
        npg_record *record;
        npg_spooled entry;
        status = npg_spool_get(spool, i, &entry, &record);
        if (!status && !entry.is_missing) status = pass_file(live->follow, &entry, record);
        npg_record_close(&record);
    }
    if (!status) status = npg_follow_count_new(live->follow, &fresh);
    npg_live_source_close(&live);
    if (status || !fresh) return status;
    return npg_error(NPG_USAGE,
                     "%s is done, but %zu files came since: --restart starts over, "
                     "another output folder begins a new run",
                     npg_worker_settings(worker)->output, fresh);
}
