/* Ingest: brings frames into the chain, from files (in time order, or in the order of the plan), from
 * standard input, or from those that are pushed. */
#include <string.h>
#include <unistd.h>

#include "capture.h"
#include "ingest.h"
#include "reader.h"

#define FILL_MAX 100000 /* frames of one gap in a live source */

typedef struct state {
    const char *frames;
    int missing;
    int64_t cache_mib;
    int64_t next; /* place in the pass's order; live: frames emitted so far */
    /* live */
    npg_selection selection;
    npg_stream *stream;
    npg_chunk *fed; /* the pushed chunk under way */
    size_t fed_at;
    int64_t seen;              /* frames that came, chosen or not */
    npg_frame waiting, before; /* the frame behind a gap; a copy of the one before it */
    bool is_waiting;
} state;

#define OFFSET(member) offsetof(state, member)

static const npg_option ingest_options[] = {
    {"frames",
     "Which frames: a:b:step are positions in time as Python counts them (from 0, without b, negative from "
     "the "
     "end); 1-5,8 are the numbers in the file names, both ends included; empty: all",
     NPG_OPTION_TEXT, OFFSET(frames), "", 0, 0, NULL, "SELECTION"},
    {"missing",
     "What to do about gaps in the numbering: error refuses, skip leaves the frame without points, hold "
     "repeats "
     "the points of the frame before it, ignore takes numbers for mere names",
     NPG_OPTION_CHOICE, OFFSET(missing), "error", 0, 0, "error|skip|hold|ignore", NULL},
    {"cache-mib", "Memory for clouds that were read, so that the later passes need not parse files again",
     NPG_OPTION_INT, OFFSET(cache_mib), "64", 0, 1048576, NULL, "MIB"},
    {0}};

/* ---- files ---- */

static void release_capture(void *thing)
{
    npg_capture *capture = thing;
    npg_capture_close(&capture);
}

static size_t cache_limit(npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    size_t limit = (size_t)s->cache_mib << 20,
           budget = (size_t)npg_worker_settings(worker)->max_memory_mib << 20;
    return budget && limit > budget / 8 ? budget / 8 : limit;
}

static void tell_list(npg_worker *worker, const npg_frame_files *list)
{
    char numbers[256];
    json_t *report = npg_worker_report(worker);
    json_object_set_new(report, "frames", json_integer((json_int_t)list->count));
    json_object_set_new(report, "gaps", json_integer((json_int_t)list->gap_count));
    if (list->left_out)
        npg_worker_log(worker, NPG_LOG_INFO, -1, "%zu files with another ending are left out",
                       list->left_out);
    if (!list->gap_count) return;
    const state *s = npg_worker_state(worker);
    bool is_held = s->missing == NPG_MISSING_HOLD;
    npg_frame_files_gaps(numbers, sizeof numbers, list);
    json_object_set_new(report, "missing_numbers", json_string(numbers));
    npg_worker_warn(worker, !is_held, -1, "%zu of %zu frames are missing and %s: %s", list->gap_count,
                    list->count, is_held ? "repeat the frame before them" : "are skipped", numbers);
}

static npg_status open_capture(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_settings *settings = npg_worker_settings(worker);
    npg_capture *capture;
    if (npg_worker_kept(worker)) return NPG_OK;
    NPG_TRY(npg_capture_open(&capture, settings->input, s->frames, (npg_missing)s->missing,
                             settings->keep_going, cache_limit(worker)));
    npg_worker_keep(worker, capture, release_capture);
    npg_facts *facts = npg_worker_facts(worker);
    if (!facts->is_resumed) facts->frame_count = (int64_t)capture->list->count;
    tell_list(worker, capture->list);
    return NPG_OK;
}

static npg_status read_frame(npg_worker *worker, npg_frame *frame, int64_t index)
{
    npg_facts *facts = npg_worker_facts(worker);
    npg_pass pass = npg_worker_pass(worker);
    npg_status status =
        npg_capture_read(npg_worker_kept(worker), frame, index, &facts->origin, pass == NPG_PASS_SOLVE);
    if (status == NPG_PARTIAL) {
        npg_worker_warn(worker, true, frame->number, "skipped: %s", npg_error_text());
        status = NPG_OK;
    }
    if (pass == NPG_PASS_MEASURE && !status) facts->skipped_count += frame->is_skipped;
    return status;
}

/* Figures of the capture as it was read; the first pass sees every frame once. */
static void tell_capture(npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_capture *capture = npg_worker_kept(worker);
    json_t *report = npg_worker_report(worker);
    json_object_set_new(report, "skipped", json_integer((json_int_t)facts->skipped_count));
    json_object_set_new(report, "files_parsed", json_integer((json_int_t)capture->reads));
    if (npg_worker_pass(worker) != NPG_PASS_SOLVE)
        json_object_set_new(report, "cache_bytes", json_integer((json_int_t)capture->cache_bytes));
}

static npg_status next_from_files(npg_worker *worker, npg_chunk *chunk)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    bool is_solving = npg_worker_pass(worker) == NPG_PASS_SOLVE;
    int64_t end = is_solving ? npg_plan_read_count(&facts->plan) : facts->frame_count;
    while (s->next < end && npg_chunk_count(chunk) < npg_chunk_capacity(chunk)) {
        npg_frame frame;
        int64_t index = is_solving ? npg_plan_frame(&facts->plan, s->next) : s->next;
        if (npg_worker_stopping(worker)) return npg_error(NPG_STOPPED, "stopped while reading");
        NPG_TRY(read_frame(worker, &frame, index));
        npg_chunk_add(chunk, &frame);
        s->next++;
    }
    if (npg_chunk_count(chunk)) return NPG_OK;
    tell_capture(worker);
    if (facts->skipped_count == facts->frame_count)
        return npg_error(NPG_BAD_INPUT, "%s: none of the %lld frames can be used",
                         npg_worker_settings(worker)->input, (long long)facts->frame_count);
    return NPG_END;
}

/* ---- standard input and pushed frames ---- */

static bool wants_stop(void *user)
{
    return npg_worker_stopping(user);
}

static npg_status open_live(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    if (!npg_worker_settings(worker)->input[0]) {
        if (!s->frames[strspn(s->frames, " ")]) return NPG_OK;
        return npg_error(NPG_USAGE,
                         "option frames: pushed frames are not selected; push those that are wanted");
    }
    NPG_TRY(npg_selection_parse(&s->selection, s->frames));
    if (npg_selection_needs_count(&s->selection))
        return npg_error(NPG_USAGE, "option frames: \"%s\": standard input can't be counted from its end",
                         s->frames);
    NPG_TRY(npg_stream_open(&s->stream, STDIN_FILENO, "standard input"));
    npg_stream_set_stop(s->stream, wants_stop, worker);
    return NPG_OK;
}

/* The next frame that was pushed, its arrays moved out of the chunk. */
static npg_status next_pushed(npg_worker *worker, npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    while (!s->fed || s->fed_at == npg_chunk_count(s->fed)) {
        npg_chunk_unref(&s->fed);
        s->fed_at = 0;
        NPG_TRY(npg_worker_feed(worker, &s->fed));
    }
    npg_frame *fed = npg_chunk_frame(s->fed, s->fed_at++);
    *frame = *fed;
    *fed = (npg_frame){0};
    return NPG_OK;
}

static npg_status next_live(npg_worker *worker, npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    for (;;) {
        NPG_TRY(s->stream ? npg_stream_next(s->stream, frame, &npg_worker_facts(worker)->origin)
                          : next_pushed(worker, frame));
        int64_t position = s->seen++;
        frame->cleaning.read = frame->point_count;
        if (npg_selection_takes(&s->selection, position, frame->number, -1)) return NPG_OK;
        npg_frame_clear(frame);
    }
}

/* Numbers of pushed frames may jump; under skip and hold what lies between are frames, too. */
static int64_t gap_before(const state *s, const npg_frame *frame)
{
    bool fills = s->missing == NPG_MISSING_SKIP || s->missing == NPG_MISSING_HOLD;
    return fills && !s->stream && s->next ? frame->number - s->before.number - 1 : 0;
}

static npg_status remember(state *s, const npg_frame *frame)
{
    npg_frame_clear(&s->before);
    if (s->missing == NPG_MISSING_HOLD && !s->stream) return npg_frame_copy(&s->before, frame);
    s->before.number = frame->number;
    return NPG_OK;
}

static npg_status fill_gap(npg_worker *worker, npg_chunk *chunk)
{
    state *s = npg_worker_state(worker);
    npg_frame frame = {.fields = NPG_FIELD_POINTS};
    int64_t number = ++s->before.number;
    bool is_held = s->missing == NPG_MISSING_HOLD;
    if (is_held) NPG_TRY(npg_frame_copy(&frame, &s->before));
    frame.number = number;
    frame.index = s->next++;
    frame.is_held = is_held;
    frame.is_skipped = !is_held;
    npg_worker_facts(worker)->skipped_count += !is_held;
    npg_worker_warn(worker, !is_held, number, "the frame is missing and %s",
                    is_held ? "repeats the frame before it" : "is skipped");
    npg_chunk_add(chunk, &frame);
    return NPG_OK;
}

static npg_status end_live(npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    json_t *report = npg_worker_report(worker);
    if (!s->next)
        return npg_error(NPG_BAD_INPUT, "%s: no frame came",
                         s->stream ? "standard input" : "the pushing program");
    npg_worker_facts(worker)->frame_count = s->next;
    json_object_set_new(report, "frames", json_integer((json_int_t)s->next));
    json_object_set_new(report, "skipped", json_integer((json_int_t)npg_worker_facts(worker)->skipped_count));
    return NPG_END;
}

/* One frame per chunk, so that nothing waits for frames that may come much later. */
static npg_status next_from_live(npg_worker *worker, npg_chunk *chunk)
{
    state *s = npg_worker_state(worker);
    if (!s->is_waiting) {
        npg_status status = next_live(worker, &s->waiting);
        if (status) return status == NPG_END ? end_live(worker) : status;
        s->is_waiting = true;
    }
    int64_t gap = gap_before(s, &s->waiting);
    if (gap > FILL_MAX)
        return npg_error(NPG_BAD_INPUT, "frame %lld comes %lld numbers after the one before it",
                         (long long)s->waiting.number, (long long)gap + 1);
    if (gap > 0) return fill_gap(worker, chunk);
    NPG_TRY(remember(s, &s->waiting));
    s->waiting.index = s->next++;
    s->is_waiting = false;
    npg_chunk_add(chunk, &s->waiting);
    return NPG_OK;
}

/* ---- the stage ---- */

static npg_status init(npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    state *s = npg_worker_state(worker);
    if (npg_worker_pass(worker) == NPG_PASS_SOLVE) s->next = facts->resumed_read;
    return facts->is_live ? open_live(worker) : open_capture(worker);
}

static npg_status process(npg_worker *worker, npg_chunk **chunk)
{
    bool is_live = npg_worker_facts(worker)->is_live;
    size_t frames = is_live ? 1 : (size_t)npg_worker_settings(worker)->chunk_frames;
    NPG_TRY(npg_chunk_open(chunk, frames));
    npg_status status = is_live ? next_from_live(worker, *chunk) : next_from_files(worker, *chunk);
    if (status) npg_chunk_unref(chunk);
    return status;
}

static void uninit(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    npg_selection_clear(&s->selection);
    npg_stream_close(&s->stream);
    npg_chunk_unref(&s->fed);
    npg_frame_clear(&s->waiting);
    npg_frame_clear(&s->before);
}

static size_t memory(const npg_worker *worker, size_t *chunks_held)
{
    const npg_capture *capture = npg_worker_kept(worker);
    *chunks_held = 1;
    return capture ? capture->cache_bytes : 0;
}

const npg_stage npg_stage_ingest = {.name = "ingest",
                                    .help = "reads the frames",
                                    .options = ingest_options,
                                    .state_size = sizeof(state),
                                    .passes = NPG_PASS_MEASURE | NPG_PASS_SCORE | NPG_PASS_SOLVE,
                                    .gives = NPG_FIELD_POINTS,
                                    .init = init,
                                    .process = process,
                                    .uninit = uninit,
                                    .memory = memory};
