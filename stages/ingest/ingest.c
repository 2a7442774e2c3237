/* Ingest: brings frames into the chain, from files (in time order, or in the order of the plan or choice),
 * from standard input, from a folder that grows, or from those that are pushed. */
#include <string.h>
#include <unistd.h>

#include "ingest/capture.h"
#include "ingest/follow.h"
#include "ingest/formats/reader.h"
#include "ingest/rig/rig_report.h"
#include "pipeline/file.h"
#include "pipeline/json_file.h"
#include "pipeline/stage.h"

/* Frames of one gap in a live source.  Each becomes a frame of the run, so a number that is damaged or a time
 * stamp must not make millions; set far above what a capture loses. */
#define GAP_MAX 100000

typedef struct state {
    const char *frames, *follow_end;
    double follow_idle_s, follow_settle_s;
    int missing;
    int64_t cache_mib;
    bool align_sensors;
    npg_rig_settings rig;
    int64_t next; /* place in the pass's order; live: frames emitted so far */
    /* live */
    npg_selection selection;
    npg_stream *stream; /* standard input                                  */
    npg_follow *follow; /* a folder that grows; neither: frames are pushed */
    npg_chunk *pushed;  /* the pushed chunk under way                      */
    size_t pushed_at;
    int64_t seen;                /* frames that came or are missing, chosen or not        */
    npg_frame waiting, previous; /* the frame behind a gap; a copy of the one before it   */
    int64_t gap_left, step;      /* missing frames before the waiting one; their distance */
    bool is_waiting;
} state;

#define AT(member) offsetof(state, member)

/* clang-format off */
static const npg_option ingest_options[] = {
    /* type        name             place                default        least  most     shown as or words */
    NPG_ROW_TEXT  ("frames",        AT(frames),          "",            "SELECTION",
        "Which frames: a:b:step are positions in time as Python counts them (from 0, without b, "
        "negative from the end); 1-5,8 are the numbers in the file names, both ends included; empty: all"),
    NPG_ROW_CHOICE("missing",       AT(missing),         "error",       "error|skip|hold|ignore",
        "What to do about gaps in the numbering: error refuses, skip leaves the frame without points, "
        "hold repeats the points of the frame before it, ignore takes numbers for mere names"),
    NPG_ROW_INT   ("cache",         AT(cache_mib),       "256",         0,     1048576, "MIB",
        "Memory for frames that were read and cleaned, so that later passes need not do that again; "
        "what does not fit goes to a file in OUT/job that has no name, and is gone with the run; "
        "0: nothing is kept, neither in memory nor on disk"),
    NPG_ROW_TEXT  ("follow-end",    AT(follow_end),      "capture.end", "NAME",
        "Name of the file that ends a folder that is followed, once it is there; empty: none does"),
    NPG_ROW_REAL  ("follow-idle",   AT(follow_idle_s),   "30",          0,     1e9,     "SECONDS",
        "Seconds without any change that end a folder that is followed; 0: wait for the end file"),
    NPG_ROW_REAL  ("follow-settle", AT(follow_settle_s), "2",           0,     1e6,     "SECONDS",
        "Seconds without a change after which a file that can't be read, "
        "and that others follow, is given up"),
    NPG_ROW_CHOICE("sensor-poses",  AT(rig.poses),       "file",        "file|inverse|none",
        "Poses of a rig's sensors: as its files say (sensor to world), the other way round (world to "
        "sensor), or none: every sensor stands at the origin, for a body that moves before one sensor"),
    NPG_ROW_REAL  ("sensor-tolerance", AT(rig.tolerance_s), "0.02",     0,     3600,    "SECONDS",
        "Images of a rig with time stamps belong together when they are no further apart"),
    NPG_ROW_FLAG  ("align-sensors", AT(align_sensors),   "no",
        "Correct the poses of a rig's sensors that are off, by what they see together with the others in "
        "these frames; one correction for each sensor, the same in all frames. What the surfaces do not "
        "determine stays as it is"),
    NPG_ROW_REAL  ("depth-step",    AT(rig.step_share),  "0.02",        1e-5,  10,      "SHARE",
        "Neighbouring pixels of a depth image are one surface while their depths differ by less "
        "than this share"),
    NPG_ROW_INT   ("depth-margin",  AT(rig.margin),      "1",           0,     64,      "PIXELS",
        "Pixels beside depth steps, missing depth and the mask's border, where sensors mix the body with "
        "what is behind it: they are dropped, but for those beside the others that continue their surface; "
        "0: all are used"),
    NPG_ROW_REAL  ("depth-near",    AT(rig.near_m),      "0",           0,     1e12,    "LENGTH",
        "Depths below this are not used, in the rig's unit"),
    NPG_ROW_REAL  ("depth-far",     AT(rig.far_m),       "0",           0,     1e12,    "LENGTH",
        "Depths above this are not used, in the rig's unit; 0: no limit"),
    {0}};
/* clang-format on */

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
    /* The cache only saves time: under --max-memory it takes an eighth at most (set by trial). */
    return budget && limit > budget / 8 ? budget / 8 : limit;
}

static void report_list(npg_worker *worker, const npg_frame_files *list)
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

/* What the rig is, and where its sensors have no image. */
static void report_rig(npg_worker *worker, npg_rig *rig)
{
    json_t *report = npg_worker_report(worker), *sensors = json_array();
    size_t gaps = 0;
    for (size_t i = 0; i < rig->sensor_count; i++) {
        size_t images = 0;
        for (size_t f = 0; f < rig->frame_count; f++) images += npg_rig_shot_of(rig, f, i) != NULL;
        gaps += rig->frame_count - images;
        json_array_append_new(sensors, json_pack("{so sI}", "name", npg_json_text(rig->sensors[i].name),
                                                 "images", (json_int_t)images));
    }
    json_object_set_new(report, "rig", json_pack("{ss so}", "layout", rig->layout, "sensors", sensors));
    npg_worker_log(worker, NPG_LOG_INFO, -1, "%s: a rig (%s) of %zu sensors, %zu frames", rig->path,
                   rig->layout, rig->sensor_count, rig->frame_count);
    if (gaps)
        npg_worker_warn(worker, false, -1, "%zu of %zu images of the rig's sensors are missing", gaps,
                        rig->frame_count * rig->sensor_count);
    if (rig->left_out)
        npg_worker_warn(worker, false, -1, "%zu depth images have no pose within %g s and are left out",
                        rig->left_out, rig->settings.tolerance_s);
}

static void report_sensor(npg_worker *worker, const npg_rig *rig, const npg_rig_view *view, size_t i)
{
    char text[160];
    json_t *of_rig = json_object_get(npg_worker_report(worker), "rig");
    npg_rig_report_pose(json_array_get(json_object_get(of_rig, "sensors"), i), view);
    npg_rig_describe_pose(text, sizeof text, rig, view);
    npg_worker_log(worker, NPG_LOG_INFO, -1, "sensor %s: pose %s%s", rig->sensors[i].name, text,
                   view->verdict == NPG_RIG_OFF ? ", corrected" : "");
}

/* Option align-sensors. */
static npg_status align_sensors(npg_worker *worker, const npg_frame_files *list)
{
    npg_rig_view *views;
    npg_rig *rig = list->rig;
    NPG_TRY(npg_alloc_array(&views, NPG_FOR_FILES, rig->sensor_count, sizeof *views));
    npg_status status = npg_frame_files_compare(list, views);
    if (!status) npg_rig_correct(rig, views);
    for (size_t i = 0; i < rig->sensor_count && !status; i++) report_sensor(worker, rig, &views[i], i);
    npg_release(&views);
    return status;
}

static npg_status list_frames(npg_frame_files **list, const state *s, const npg_settings *settings,
                              const char *selection)
{
    npg_rig_settings rig = s->rig;
    rig.confine = settings->confine;
    NPG_TRY(
        npg_frame_files_open_any(list, settings->input, selection, s->missing != NPG_MISSING_IGNORE, &rig));
    npg_status status = settings->confine ? npg_frame_files_confine(*list, settings->input) : NPG_OK;
    if (status) npg_frame_files_close(list);
    return status;
}

npg_status npg_capture_select(npg_frame_files **list, const npg_options *options, const char *selection)
{
    npg_settings settings;
    state s = {0};
    npg_options_fill(options, npg_run_options, &settings);
    npg_options_fill(options, ingest_options, &s);
    return list_frames(list, &s, &settings, selection ? selection : s.frames);
}

npg_status npg_capture_list(npg_frame_files **list, const npg_options *options)
{
    return npg_capture_select(list, options, NULL);
}

static npg_status open_capture(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_settings *settings = npg_worker_settings(worker);
    npg_capture *capture;
    npg_frame_files *list;
    char *folder = NULL;
    if (npg_worker_kept(worker)) return NPG_OK;
    if (settings->output[0] && s->cache_mib) NPG_TRY(npg_join_path(&folder, settings->output, "job"));
    npg_status status = list_frames(&list, s, settings, s->frames);
    if (!status)
        status = npg_capture_open_list(&capture, &list, settings->input, (npg_missing)s->missing,
                                       settings->keep_going, cache_limit(worker), folder);
    npg_release(&folder);
    NPG_TRY(status);
    npg_worker_keep(worker, capture, release_capture);
    NPG_TRY(npg_worker_publish(worker, &npg_fact_frame_store, capture->store));
    npg_facts *facts = npg_worker_facts(worker);
    /* A resumed run has restored it. */
    if (!facts->is_resumed) facts->frame_count = (int64_t)capture->list->count;
    report_list(worker, capture->list);
    if (capture->list->rig) report_rig(worker, capture->list->rig);
    return capture->list->rig && s->align_sensors ? align_sensors(worker, capture->list) : NPG_OK;
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
    /* Each pass reads the frame again; only the first one counts it. */
    if (pass == NPG_PASS_MEASURE && !status) facts->skipped_count += frame->is_skipped;
    return status;
}

/* Figures of the capture as it was read; the first pass sees every frame once. */
static void report_capture(npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_capture *capture = npg_worker_kept(worker);
    json_t *report = npg_worker_report(worker);
    json_object_set_new(report, "skipped", json_integer((json_int_t)facts->skipped_count));
    json_object_set_new(report, "files_parsed", json_integer((json_int_t)capture->reads));
    if (npg_worker_pass(worker) == NPG_PASS_SOLVE) return;
    npg_frame_store_use use = npg_frame_store_used(capture->store);
    json_object_set_new(report, "cache_bytes", json_integer((json_int_t)use.memory_bytes));
    json_object_set_new(report, "cache_disk_bytes", json_integer((json_int_t)use.disk_bytes));
}

static npg_status next_from_files(npg_worker *worker, npg_chunk *chunk)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    npg_pass pass = npg_worker_pass(worker);
    int64_t count = pass == NPG_PASS_CHOOSE ? (int64_t)facts->choice.count : facts->frame_count;
    bool is_in_order = pass == NPG_PASS_SOLVE || pass == NPG_PASS_FUSE;
    if (is_in_order) count = npg_plan_read_count(&facts->plan);
    while (s->next < count && npg_chunk_count(chunk) < npg_chunk_capacity(chunk)) {
        npg_frame frame;
        int64_t index = s->next;
        if (is_in_order) index = npg_plan_frame(&facts->plan, s->next);
        if (pass == NPG_PASS_CHOOSE) index = facts->choice.frames[s->next];
        if (npg_worker_stopping(worker)) return npg_error(NPG_STOPPED, "stopped while reading");
        NPG_TRY(read_frame(worker, &frame, index));
        npg_chunk_add(chunk, &frame);
        s->next++;
    }
    if (npg_chunk_count(chunk)) return NPG_OK;
    report_capture(worker);
    if (facts->skipped_count == facts->frame_count)
        return npg_error(NPG_BAD_INPUT, "%s: none of the %lld frames can be used",
                         npg_worker_settings(worker)->input, (long long)facts->frame_count);
    return NPG_END;
}

/* ---- standard input, a folder that grows, pushed frames ---- */

static bool wants_stop(void *user)
{
    return npg_worker_stopping(user);
}

static npg_status open_follow(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_follow_settings settings = {.where = npg_worker_settings(worker)->follow,
                                          .confine = npg_worker_settings(worker)->confine,
                                          .end_name = s->follow_end,
                                          .idle_s = s->follow_idle_s,
                                          .settle_s = s->follow_settle_s,
                                          .finds_gaps = s->missing != NPG_MISSING_IGNORE,
                                          .stopping = wants_stop,
                                          .user = worker};
    if (!s->follow_end[0] && !(s->follow_idle_s > 0))
        return npg_error(NPG_USAGE, "options follow-end and follow-idle: nothing would ever end this run");
    return npg_follow_open(&s->follow, &settings);
}

static npg_status open_live(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_settings *settings = npg_worker_settings(worker);
    if (!settings->input[0] && !settings->follow[0]) {
        if (!s->frames[strspn(s->frames, " ")]) return NPG_OK;
        return npg_error(NPG_USAGE,
                         "option frames: pushed frames are not selected; push those that are wanted");
    }
    NPG_TRY(npg_selection_parse(&s->selection, s->frames));
    if (npg_selection_needs_count(&s->selection))
        return npg_error(NPG_USAGE, "option frames: \"%s\": a live source can't be counted from its end",
                         s->frames);
    if (settings->follow[0]) return open_follow(worker);
    NPG_TRY(npg_stream_open(&s->stream, STDIN_FILENO, "standard input"));
    npg_stream_set_stop(s->stream, wants_stop, worker);
    return NPG_OK;
}

/* The next frame that was pushed, its arrays moved out of the chunk. */
static npg_status next_pushed(npg_worker *worker, npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    while (!s->pushed || s->pushed_at == npg_chunk_count(s->pushed)) {
        npg_chunk_unref(&s->pushed);
        s->pushed_at = 0;
        NPG_TRY(npg_worker_feed(worker, &s->pushed));
    }
    npg_frame *first = npg_chunk_frame(s->pushed, s->pushed_at++);
    *frame = *first;
    *first = (npg_frame){0};
    return NPG_OK;
}

static npg_status next_followed(npg_worker *worker, npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    npg_status status = npg_follow_next(s->follow, frame, &npg_worker_facts(worker)->origin);
    if (status != NPG_PARTIAL) return status;
    if (!npg_worker_settings(worker)->keep_going) {
        npg_frame_clear(frame);
        return NPG_BAD_INPUT; /* the text is the reader's */
    }
    npg_worker_warn(worker, true, frame->number, "skipped: %s", npg_error_text());
    npg_worker_facts(worker)->skipped_count++;
    frame->is_skipped = true;
    frame->fields = NPG_FIELD_POINTS;
    return NPG_OK;
}

/* After a damaged frame nobody knows where the next one begins on a pipe: with keep-going the stream ends
 * there, and what came before is finished. */
static npg_status next_streamed(npg_worker *worker, npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    npg_status status = npg_stream_next(s->stream, frame, &npg_worker_facts(worker)->origin);
    if (status != NPG_BAD_INPUT || !npg_worker_settings(worker)->keep_going || !s->next) return status;
    npg_worker_warn(worker, true, s->seen, "the stream is taken to end here: %s", npg_error_text());
    return NPG_END;
}

static npg_status next_live(npg_worker *worker, npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    NPG_TRY(s->stream   ? next_streamed(worker, frame)
            : s->follow ? next_followed(worker, frame)
                        : next_pushed(worker, frame));
    frame->cleaning.read = frame->point_count;
    return NPG_OK;
}

static npg_status refuse_gap(const state *s, int64_t gap, int64_t number)
{
    if (gap > GAP_MAX)
        return npg_error(NPG_BAD_INPUT, "frame %lld comes %lld numbers after the one before it",
                         (long long)number, (long long)gap + 1);
    return npg_error(NPG_BAD_INPUT,
                     "%lld frames are missing between %lld and %lld "
                     "(option missing: skip or hold goes on, "
                     "ignore takes the frames as they follow each other)",
                     (long long)gap, (long long)s->previous.number, (long long)number);
}

/* How many frames are missing before this one.  Numbers may jump: in a folder as in any capture of files; of
 * pushed frames only skip and hold ask for those that lie between; a pipe has no numbers of its own. */
static npg_status count_gap(npg_worker *worker, const npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    int64_t step = s->follow ? npg_follow_step(s->follow) : 1;
    bool fills = s->missing == NPG_MISSING_SKIP || s->missing == NPG_MISSING_HOLD;
    bool is_checked = s->follow ? s->missing != NPG_MISSING_IGNORE : fills && !s->stream;
    s->gap_left = 0;
    if (!s->seen || !is_checked) return NPG_OK;
    /* A smaller step than so far shows that frames were missing before; they are behind us. */
    if (s->step && step != s->step) {
        if (!fills)
            return npg_error(
                NPG_BAD_INPUT,
                "frame %lld: the numbers grew by %lld before and now by %lld: frames are missing",
                (long long)frame->number, (long long)s->step, (long long)step);
        npg_worker_warn(worker, true, frame->number,
                        "the numbers grew by %lld before and now by %lld: frames before it are missing",
                        (long long)s->step, (long long)step);
    }
    s->step = step;
    int64_t gap = (frame->number - s->previous.number) / step - 1;
    if (gap > GAP_MAX || (gap > 0 && !fills)) return refuse_gap(s, gap, frame->number);
    s->gap_left = gap;
    return NPG_OK;
}

static npg_status keep_previous(state *s, const npg_frame *frame)
{
    npg_frame_clear(&s->previous);
    if (s->missing == NPG_MISSING_HOLD && !s->stream) return npg_frame_copy(&s->previous, frame);
    s->previous.number = frame->number;
    return NPG_OK;
}

static npg_status fill_gap(npg_worker *worker, npg_chunk *chunk)
{
    state *s = npg_worker_state(worker);
    npg_frame frame = {.fields = NPG_FIELD_POINTS};
    s->gap_left--;
    int64_t number = s->previous.number += s->step;
    bool is_held = s->missing == NPG_MISSING_HOLD;
    if (!npg_selection_takes(&s->selection, s->seen++, number, -1)) return NPG_OK;
    if (is_held) NPG_TRY(npg_frame_copy(&frame, &s->previous));
    frame.number = number;
    frame.index = s->next++;
    frame.is_key = false;
    frame.is_held = is_held;
    frame.is_skipped = !is_held || s->previous.is_skipped;
    npg_worker_facts(worker)->skipped_count += frame.is_skipped;
    npg_worker_warn(worker, !is_held, number, "the frame is missing and %s",
                    is_held ? "repeats the frame before it" : "is skipped");
    npg_chunk_add(chunk, &frame);
    return NPG_OK;
}

static const char *source_name(const npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    return s->stream   ? "standard input"
           : s->follow ? npg_worker_settings(worker)->follow
                       : "the pushing program";
}

static npg_status end_live(npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    npg_facts *facts = npg_worker_facts(worker);
    json_t *report = npg_worker_report(worker);
    size_t late_count = s->follow ? npg_follow_late_count(s->follow) : 0;
    if (!s->next) return npg_error(NPG_BAD_INPUT, "%s: no frame came", source_name(worker));
    if (facts->skipped_count == s->next)
        return npg_error(NPG_BAD_INPUT, "%s: none of the %lld frames can be used", source_name(worker),
                         (long long)s->next);
    if (late_count)
        npg_worker_warn(worker, true, -1, "%zu files came after a later one had been taken and are left out",
                        late_count);
    facts->frame_count = s->next;
    json_object_set_new(report, "frames", json_integer((json_int_t)s->next));
    json_object_set_new(report, "skipped", json_integer((json_int_t)facts->skipped_count));
    return NPG_END;
}

/* One frame per chunk, so that nothing waits for frames that may come much later.  The chunk stays empty for
 * a frame that is not chosen. */
static npg_status step_live(npg_worker *worker, npg_chunk *chunk)
{
    state *s = npg_worker_state(worker);
    if (!s->is_waiting) {
        npg_status status = next_live(worker, &s->waiting);
        if (status) return status == NPG_END ? end_live(worker) : status;
        s->is_waiting = true;
        NPG_TRY(count_gap(worker, &s->waiting));
    }
    if (s->gap_left > 0) return fill_gap(worker, chunk);
    s->is_waiting = false;
    NPG_TRY(keep_previous(s, &s->waiting));
    if (!npg_selection_takes(&s->selection, s->seen++, s->waiting.number, -1)) {
        npg_frame_clear(&s->waiting);
        return NPG_OK;
    }
    s->waiting.index = s->next++;
    npg_chunk_add(chunk, &s->waiting);
    return NPG_OK;
}

static npg_status next_from_live(npg_worker *worker, npg_chunk *chunk)
{
    while (!npg_chunk_count(chunk)) {
        if (npg_worker_stopping(worker)) return npg_error(NPG_STOPPED, "stopped while reading");
        NPG_TRY(step_live(worker, chunk));
    }
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
    npg_follow_close(&s->follow);
    npg_chunk_unref(&s->pushed);
    npg_frame_clear(&s->waiting);
    npg_frame_clear(&s->previous);
}

static size_t memory(const npg_worker *worker, size_t *chunks_held)
{
    const npg_capture *capture = npg_worker_kept(worker);
    size_t normals = npg_worker_facts(worker)->point_count_max * 3 * sizeof(float); /* of the keyframe, yet */
    *chunks_held = 1;
    return capture ? npg_frame_store_used(capture->store).memory_bytes + normals : 0;
}

extern const npg_stage npg_stage_ingest;
const npg_stage npg_stage_ingest = {.name = "ingest",
                                    .help = "reads the frames",
                                    .options = ingest_options,
                                    .state_size = sizeof(state),
                                    .passes = NPG_PASS_MEASURE | NPG_PASS_SCORE | NPG_PASS_CHOOSE |
                                              NPG_PASS_FUSE | NPG_PASS_SOLVE,
                                    .gives = NPG_FIELD_POINTS,
                                    .init = init,
                                    .process = process,
                                    .uninit = uninit,
                                    .memory = memory};
