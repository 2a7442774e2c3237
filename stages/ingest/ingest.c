/* Ingest: brings frames into the chain, from files (in time order, or in the order of the plan or choice),
 * from standard input, from a folder that grows, or from those that are pushed. */
#include "ingest/ingest_internal.h"

#include <string.h>

typedef struct state {
    npg_live_settings live; /* of a capture in files, too: frames and missing */
    int64_t cache_mib;
    bool align_sensors;
    npg_rig_settings rig;
    int64_t next; /* place in the pass's order */
} state;

#define AT(member) offsetof(state, member)

/* clang-format off */
static const npg_option ingest_options[] = {
    /* type               name                place                default        least most  shown as or words */
    NPG_ROW_TEXT(         "frames",           AT(live.frames),          "",            "SELECTION",
        "Which frames, in order or by number. a:b:step are positions in time as Python counts them (from 0, "
        "without b, negative from the end); 1-5,8 are the numbers in the file names, both ends included; "
        "empty: all"),
    NPG_ROW_CHOICE(       "missing",          AT(live.missing),         "error",       "error|skip|hold|ignore",
        "What to do about gaps in the numbering. error refuses, skip leaves the frame without points, hold "
        "repeats the points of the frame before it, ignore takes numbers for mere names"),
    NPG_ROW_INT(          "cache",            AT(cache_mib),       "256",         0,    1048576, "MIB",
        "Memory for frames that were read and cleaned. Later passes need not do that again; what does not "
        "fit goes to a file in OUT/job that has no name, and is gone with the run; 0: nothing is kept, "
        "neither in memory nor on disk"),
    NPG_ROW_INT(          "look-ahead",       AT(live.look_ahead),      "64",          1,    1e6,     NULL,
        "Live: frames that the reference is made from. They are kept first: box, keyframe and reference are "
        "made from them as from a capture of that many frames"),
    NPG_PART(REAL,        "follow-end.idle",  AT(live.follow_idle_s),   "30",          0,    1e9,     "SECONDS",
        "... or so many seconds without any change; 0: only the file"),
    NPG_PART(TEXT,        "follow-end.name",  AT(live.follow_end),      "capture.end", "NAME",
        "A file of this name, once it is there; empty: none does"),
    NPG_PROGRAM_ROW(REAL, "follow-settle",    AT(live.follow_settle_s), "2",           0,    1e6,     "SECONDS",
        "Seconds without a change after which a file that can't be read, "
        "and that others follow, is given up"),
    NPG_ROW_CHOICE(       "sensor-poses",     AT(rig.poses),       "file",        "file|inverse|none",
        "How the poses of a rig's sensors are meant. As its files say (sensor to world), the other way "
        "round (world to sensor), or none: every sensor stands at the origin, for a body that moves before "
        "one sensor"),
    NPG_ROW_CHOICE(       "background",       AT(rig.background),  "auto",        "auto|removed|unknown",
        "Whether depth 0 and what a mask hides say that nothing of the body is there. removed: they do; "
        "unknown: they say nothing; auto: they do where there is a mask, or most pixels of an image have no "
        "depth"),
    NPG_ROW_FLAG(         "align-sensors",    AT(align_sensors),   "no",
        "Correct the poses of a rig's sensors that are off. By what they see together with the others in "
        "these frames; one correction for each sensor, the same in all frames. What the surfaces do not "
        "determine stays as it is"),
    NPG_KEY(REAL,         "depth-step",       AT(rig.step_share),  "0.02",        1e-5, 10,      "SHARE",
        "Neighbouring pixels of a depth image are one surface while their depths differ by less "
        "than this share"),
    NPG_KEY(INT,          "depth-margin",     AT(rig.margin),      "1",           0,    64,      "PIXELS",
        "Pixels beside depth steps, missing depth and the mask's border, where sensors mix the body with "
        "what is behind it: they are dropped, but for those beside the others that continue their surface; "
        "0: all are used"),
    NPG_PART(REAL,        "depth-range.near", AT(rig.near_m),      "0",           0,    1e12,    "LENGTH",
        "The least depth that is used"),
    NPG_PART(REAL,        "depth-range.far",  AT(rig.far_m),       "0",           0,    1e12,    "LENGTH",
        "The largest depth that is used; 0: no limit"),
    {0}};
/* clang-format on */

/* ---- files ---- */

static void release_capture(void *thing)
{
    npg_capture *capture = thing;
    npg_capture_close(&capture);
}

/* For frames that are read again, as a fact. */
static npg_status open_store(npg_worker *worker, npg_frame_store **store)
{
    const npg_settings *settings = npg_worker_settings(worker);
    const state *s = npg_worker_state(worker);
    size_t limit = (size_t)s->cache_mib << 20, budget = (size_t)settings->max_memory_mib << 20;
    bool may_spill = settings->output[0] && s->cache_mib;
    char folder[NPG_PATH_SIZE];
    if (may_spill) NPG_TRY(npg_path_of(folder, settings->output, "job"));
    /* The cache only saves time: under --max-memory it takes an eighth at most (set by trial). */
    if (budget && limit > budget / 8) limit = budget / 8;
    NPG_TRY(npg_frame_store_open(store, limit, may_spill ? folder : NULL));
    return npg_worker_publish(worker, &npg_fact_frame_store, *store);
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
    bool is_held = s->live.missing == NPG_MISSING_HOLD;
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
        size_t images = rig->sensors[i].shot_count;
        gaps += rig->frame_count - images;
        json_array_append_new(sensors, json_pack("{so sI}", "name", npg_json_text(rig->sensors[i].name),
                                                 "images", (json_int_t)images));
    }
    json_object_set_new(report, "rig",
                        json_pack("{ss so}", "up", npg_up_words[npg_rig_up(rig)], "sensors", sensors));
    npg_worker_log(worker, NPG_LOG_INFO, -1, "%s: a rig of %zu sensors, %zu frames", rig->path,
                   rig->sensor_count, rig->frame_count);
    if (gaps)
        npg_worker_warn(worker, false, -1, "%zu of %zu images of the rig's sensors are missing", gaps,
                        rig->frame_count * rig->sensor_count);
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
    npg_rig_view *views = NULL;
    npg_rig *rig = list->rig;
    npg_status status = npg_frame_files_compare(list, &views);
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
        npg_frame_files_open(list, settings->input, selection, s->live.missing != NPG_MISSING_IGNORE, &rig));
    npg_status status = settings->confine ? npg_frame_files_confine(*list, settings->input) : NPG_OK;
    if (status) npg_frame_files_close(list);
    return status;
}

npg_status npg_capture_list(npg_frame_files **list, const npg_options *options, const char *selection)
{
    npg_settings settings;
    state s = {0};
    npg_options_fill(options, npg_run_options, &settings);
    npg_options_fill(options, ingest_options, &s);
    return list_frames(list, &s, &settings, selection ? selection : s.live.frames);
}

static npg_status open_capture(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_settings *settings = npg_worker_settings(worker);
    npg_capture *capture;
    npg_frame_files *list;
    npg_frame_store *store;
    NPG_TRY(open_store(worker, &store));
    NPG_TRY(list_frames(&list, s, settings, s->live.frames));
    NPG_TRY(npg_capture_open(&capture, &list, settings->input, (npg_missing)s->live.missing,
                             settings->keep_going, store));
    npg_worker_keep(worker, capture, release_capture);
    const uint64_t *hashes = npg_worker_fact(worker, &npg_fact_input_hashes);
    if (hashes) memcpy(capture->hashes, hashes, capture->list->count * sizeof *hashes);
    /* A resumed run has restored it. */
    if (!npg_worker_facts(worker)->is_resumed)
        *npg_own(worker, frame_count) = *npg_own(worker, planned_count) = (int64_t)capture->list->count;
    report_list(worker, capture->list);
    if (capture->list->rig) report_rig(worker, capture->list->rig);
    return capture->list->rig && s->align_sensors ? align_sensors(worker, capture->list) : NPG_OK;
}

static npg_status read_frame(npg_worker *worker, npg_frame *frame, int64_t index)
{
    npg_pass pass = npg_worker_pass(worker);
    npg_status status = npg_capture_read(npg_worker_kept(worker), frame, index, npg_own(worker, origin),
                                         pass == NPG_PASS_SOLVE);
    if (status == NPG_PARTIAL) {
        npg_worker_warn(worker, true, frame->number, "skipped: %s", npg_error_text());
        status = NPG_OK;
    }
    /* Each pass reads the frame again; only the first one counts it. */
    if (pass == NPG_PASS_MEASURE && !status) *npg_own(worker, skipped_count) += frame->is_skipped;
    return status;
}

static void report_cache(npg_worker *worker)
{
    json_t *report = npg_worker_report(worker);
    if (npg_worker_pass(worker) == NPG_PASS_SOLVE) return;
    npg_frame_store_use use = npg_frame_store_used(npg_worker_fact(worker, &npg_fact_frame_store));
    json_object_set_new(report, "cache_bytes", json_integer((json_int_t)use.memory_bytes));
    json_object_set_new(report, "cache_disk_bytes", json_integer((json_int_t)use.disk_bytes));
}

static void warn_of_blank(npg_worker *worker, const npg_rig *rig)
{
    if (!rig || !rig->blank_count || npg_worker_pass(worker) != NPG_PASS_MEASURE) return;
    npg_worker_warn(worker, false, -1, "%zu depth images have no depth in any pixel, the first is %s",
                    rig->blank_count, rig->first_blank);
}

/* Figures of the capture as it was read; the first pass sees every frame once. */
static npg_status end_files(npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_capture *capture = npg_worker_kept(worker);
    json_t *report = npg_worker_report(worker);
    json_object_set_new(report, "skipped", json_integer((json_int_t)facts->skipped_count));
    json_object_set_new(report, "files_parsed", json_integer((json_int_t)capture->reads));
    report_cache(worker);
    warn_of_blank(worker, capture->list->rig);
    if (facts->skipped_count == facts->frame_count)
        return npg_error(NPG_BAD_INPUT, "%s: none of the %lld frames can be used",
                         npg_worker_settings(worker)->input, (long long)facts->frame_count);
    return NPG_END;
}

/* ---- the order of a pass ---- */

/* Places of the pass's order; INT64_MAX while the end of a live source is not known. */
static int64_t place_count(const npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    npg_pass pass = npg_worker_pass(worker);
    int64_t total = pass == NPG_PASS_FUSE ? facts->planned_count : facts->frame_count;
    if (pass == NPG_PASS_CHOOSE) return (int64_t)facts->choice.count;
    if (pass != NPG_PASS_SOLVE && pass != NPG_PASS_FUSE) return facts->planned_count;
    if (!npg_plan_is_open(&facts->plan)) return npg_plan_read_count(&facts->plan);
    return total < 0 ? INT64_MAX : npg_plan_next_place(&facts->plan, total, total);
}

/* Index of the frame at this place; under an open plan there may be none with it. */
static int64_t index_at(const npg_worker *worker, int64_t place)
{
    const npg_facts *facts = npg_worker_facts(worker);
    npg_pass pass = npg_worker_pass(worker);
    if (pass == NPG_PASS_CHOOSE) return facts->choice.frames[place];
    return pass == NPG_PASS_SOLVE || pass == NPG_PASS_FUSE ? npg_plan_frame(&facts->plan, place) : place;
}

static npg_status next_from_files(npg_worker *worker, npg_chunk *chunk)
{
    state *s = npg_worker_state(worker);
    const int64_t count = place_count(worker);
    while (s->next < count && npg_chunk_count(chunk) < npg_chunk_capacity(chunk)) {
        npg_frame frame;
        if (npg_worker_stopping(worker)) return npg_error(NPG_STOPPED, "stopped while reading");
        NPG_TRY(read_frame(worker, &frame, index_at(worker, s->next)));
        npg_chunk_add(chunk, &frame);
        s->next++;
    }
    return npg_chunk_count(chunk) ? NPG_OK : end_files(worker);
}

/* ---- a live source ---- */

static void release_live(void *thing)
{
    npg_live_source *live = thing;
    npg_live_source_close(&live);
}

static npg_status open_live(npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    npg_live_source *live;
    npg_frame_store *store;
    NPG_TRY(open_store(worker, &store));
    NPG_TRY(npg_live_source_open(&live, worker, &s->live, store));
    npg_worker_keep(worker, live, release_live);
    return NPG_OK;
}

/* One frame per chunk, so that nothing waits for frames that may come much later. */
static npg_status next_from_source(npg_worker *worker, npg_chunk *chunk)
{
    state *s = npg_worker_state(worker);
    npg_live_source *live = npg_worker_kept(worker);
    bool is_first = npg_worker_pass(worker) == NPG_PASS_MEASURE,
         is_last = npg_worker_pass(worker) == NPG_PASS_SOLVE;
    npg_status status = NPG_END;
    npg_frame frame;
    if (is_first && s->next < s->live.look_ahead)
        status = npg_live_source_read(live, &frame, s->next++, false);
    else if (!is_first)
        while (status == NPG_END && s->next < place_count(worker))
            status = npg_live_source_read(live, &frame, index_at(worker, s->next++), is_last);
    if (!status) npg_chunk_add(chunk, &frame);
    if (status != NPG_END) return status;
    report_cache(worker);
    return is_first || is_last ? npg_live_source_end(live) : NPG_END;
}

/* ---- the stage ---- */

/* Under an open plan frames behind the end never came. */
static int64_t resumed_place(const npg_facts *facts)
{
    return facts->is_live ? npg_plan_next_place(&facts->plan, facts->resumed_read, facts->frame_count)
                          : facts->resumed_read;
}

static npg_status init(npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    state *s = npg_worker_state(worker);
    if (npg_worker_pass(worker) == NPG_PASS_SOLVE && facts->is_resumed) s->next = resumed_place(facts);
    if (npg_worker_kept(worker)) return NPG_OK; /* from an earlier pass */
    return facts->is_live ? open_live(worker) : open_capture(worker);
}

static npg_status process(npg_worker *worker, npg_chunk **chunk)
{
    bool is_live = npg_worker_facts(worker)->is_live;
    size_t frames = is_live ? 1 : (size_t)npg_worker_settings(worker)->chunk_frames;
    NPG_TRY(npg_chunk_open(chunk, frames));
    npg_status status = is_live ? next_from_source(worker, *chunk) : next_from_files(worker, *chunk);
    if (status) npg_chunk_close(chunk);
    return status;
}

/* The normals are those of the keyframe, which are to come. */
static size_t memory(const npg_worker *worker, size_t *chunks_held)
{
    npg_frame_store *store = npg_worker_fact(worker, &npg_fact_frame_store);
    *chunks_held = 1;
    return (store ? npg_frame_store_used(store).memory_bytes : 0) +
           npg_worker_facts(worker)->point_count_max * 3 * sizeof(float);
}

const npg_stage npg_stage_ingest = {.name = "ingest",
                                    .help = "reads the frames",
                                    .options = ingest_options,
                                    .state_size = sizeof(state),
                                    .passes = NPG_PASS_MEASURE | NPG_PASS_SCORE | NPG_PASS_CHOOSE |
                                              NPG_PASS_FUSE | NPG_PASS_SOLVE,
                                    .gives = NPG_FIELD_POINTS,
                                    .init = init,
                                    .process = process,
                                    .memory = memory};
