/* Outlier: drops what is no point of the surface, thins where asked or where a frame is too large, and makes
 * or mends normals.
 *
 * Cleaning takes part in every pass, so that box and keyframe are those of clean points; it gives the same
 * points each time, and a frame that was kept clean (frame_store.h) is not cleaned again.  Normals are made
 * for the keyframe alone (or all, if asked), and in the choosing pass for the frames that may become it. */
#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "ingest/ingest.h"
#include "outlier/outlier_internal.h"
#include "pipeline/clock.h"
#include "pipeline/options.h"
#include "pipeline/parallel.h"
#include "pipeline/stage.h"

enum { NORMALS_AUTO, NORMALS_ESTIMATE, NORMALS_GIVEN };
enum { FOR_KEY, FOR_ALL };

typedef struct outlier_state {
    const char *sensor_text;
    bool drop_isolated;
    int normals, normals_for;
    int64_t point_max;
    double ratio;
    /* what was found so far, over the pass */
    enum { SENSOR_AUTO, SENSOR_NONE, SENSOR_GIVEN } sensor_kind;
    bool has_found_sensor;
    npg_sensors sensors; /* where given */
    npg_cleaning sum;
    size_t frames, skipped;
    double normals_s;
    npg_frame_store *store; /* loan; NULL: nothing is kept */
    bool keeps;             /* there are later passes      */
} outlier_state;

#define AT(member) offsetof(outlier_state, member)

/* clang-format off */
static const npg_option outlier_options[] = {
    /* type         name             place              default   least most  shown as or words */
    NPG_ROW_FLAG(   "outliers",      AT(drop_isolated), "yes",
        "Keep isolated points. Without it they are dropped by the statistical filter that PCL has, too, "
        "repeated until it finds no more; those of depth images are only kept out of the reference, since few of "
        "a hand that reaches to the sensor lie apart, too"),
    NPG_KEY(REAL,   "outlier-ratio", AT(ratio),         "5",      0.5,  100, NULL,
        "Standard deviations above the mean at which a point is isolated"),
    NPG_KEY(INT,    "points-max",    AT(point_max),     "0",      0,    4e9, NULL,
        "Thin frames with more points than this, evenly by their order. 0: twice the faces, and 40000 at least; more "
        "take time, and the reference can't hold them"),
    NPG_ROW_CHOICE( "normals",       AT(normals),       "auto",   "auto|estimate|given",
        "Where normals come from. Given ones are checked and mended; auto: given where there are any, else "
        "estimated"),
    NPG_KEY(CHOICE, "normals-for",   AT(normals_for),   "key",    "key|all",
        "Make and mend normals for the keyframe alone or for all frames"),
    NPG_ROW_TEXT(   "sensor",        AT(sensor_text),   "auto",   "X,Y,Z",
        "Where the points were seen from, in the capture's unit. x,y,z, several x,y,z:x,y,z, or a file of a "
        "line X Y Z for each frame in order, or lines NUMBER X Y Z, one for each sensor. Normals point to a "
        "single one, what lies before the points is empty, and surface that can't be seen from there waits "
        "for frames that see it; none: nothing is known, and every frame has all sides; auto: the origin, "
        "if the points look like one view from it, or a place that is looked for, if those of the first frame do from "
        "there; else, if the keyframe's surface lacks points, what it can be seen from"),
    {0}};
/* clang-format on */

/* ---- set-up ---- */

static npg_status parse_sensor(outlier_state *s)
{
    s->sensor_kind = !strcmp(s->sensor_text, "auto")  ? SENSOR_AUTO
                     : strcmp(s->sensor_text, "none") ? SENSOR_GIVEN
                                                      : SENSOR_NONE;
    return s->sensor_kind == SENSOR_GIVEN ? npg_sensors_open(&s->sensors, s->sensor_text) : NPG_OK;
}

static void outlier_uninit(npg_worker *worker)
{
    outlier_state *s = npg_worker_state(worker);
    npg_sensors_close(&s->sensors);
}

static npg_status outlier_init(npg_worker *worker)
{
    outlier_state *s = npg_worker_state(worker);
    s->point_max = (int64_t)npg_clean_point_max((double)s->point_max,
                                                npg_options_number(npg_worker_options(worker), "faces", 0));
    return parse_sensor(s);
}

/* Every pass cleans frames again that are not kept; only the first one that brings them reports what it did:
 * the solving one those behind a look-ahead. */
static bool comes_first(npg_worker *worker, const npg_frame *frame)
{
    const npg_facts *facts = npg_worker_facts(worker);
    return npg_worker_pass(worker) == NPG_PASS_MEASURE ||
           (facts->is_live && frame->index >= facts->planned_count);
}

/* ---- points ---- */

static npg_status clean_points(npg_worker *worker, npg_frame *frame)
{
    const outlier_state *s = npg_worker_state(worker);
    frame->cleaning = (npg_cleaning){.read = frame->point_count};
    return npg_clean_points(frame, (size_t)s->point_max);
}

/* ---- normals ---- */

/* Unit length; a normal that is no direction takes that of the estimate.  *bad counts them. */
static void repair_directions(float *normals, size_t *bad, const float *estimate, size_t n)
{
    *bad = 0;
    for (size_t i = 0; i < n; i++) {
        float *d = normals + 3 * i, length = npg_vec3_lengthf(d);
        bool good = isfinite(length) && length > 1e-6f; /* readers give 0 where there is none */
        for (size_t a = 0; a < 3; a++) d[a] = good ? d[a] / length : estimate[3 * i + a];
        *bad += !good;
    }
}

/* The one place that all points were seen from, given or found; NULL: there is none.  A rig's own normals face its
 * sensors already. */
static const float *lone_sensor(const npg_frame *frame)
{
    return frame->sensor_count == 1 && !frame->sensors ? frame->sensor_local : NULL;
}

static npg_status make_normals(npg_frame *frame)
{
    size_t n = frame->point_count, turned;
    const float *sensor = lone_sensor(frame);
    NPG_TRY(npg_alloc_array(&frame->normals, NPG_FOR_FRAMES, n, 3 * sizeof(float)));
    frame->cleaning.normals_estimated = n;
    if (!sensor) return npg_normals_make(frame->normals, frame->pos_local, n);
    NPG_TRY(npg_normals_estimate(frame->normals, frame->pos_local, n, NPG_PATCH));
    npg_normals_face_sensor(frame->normals, &turned, frame->pos_local, n, sensor);
    return NPG_OK;
}

static npg_status mend_normals(npg_worker *worker, npg_frame *frame)
{
    const outlier_state *s = npg_worker_state(worker);
    size_t n = frame->point_count, bad;
    float *estimate;
    const float *sensor = lone_sensor(frame);
    NPG_TRY(npg_alloc_array(&estimate, NPG_FOR_FRAMES, n, 3 * sizeof *estimate));
    npg_status status = npg_normals_estimate(estimate, frame->pos_local, n, NPG_PATCH);
    if (!status) repair_directions(frame->normals, &bad, estimate, n);
    npg_release(&estimate);
    NPG_TRY(status);
    frame->cleaning.normals_given = n - bad;
    frame->cleaning.normals_estimated = bad;
    if (frame->has_sure_normals && s->sensor_kind == SENSOR_AUTO) return NPG_OK;
    if (!sensor)
        return npg_normals_mend(frame->normals, &frame->cleaning.normals_flipped, frame->pos_local, n);
    npg_normals_face_sensor(frame->normals, &frame->cleaning.normals_flipped, frame->pos_local, n, sensor);
    return NPG_OK;
}

static npg_status make_or_mend_normals(npg_worker *worker, npg_frame *frame)
{
    outlier_state *s = npg_worker_state(worker);
    double since = npg_clock_s();
    if (s->normals == NORMALS_GIVEN && !frame->normals)
        return npg_error(NPG_BAD_INPUT, "there are no normals, but option normals is given");
    if (s->normals == NORMALS_ESTIMATE) npg_release(&frame->normals);
    NPG_TRY(frame->normals ? mend_normals(worker, frame) : make_normals(frame));
    s->normals_s += npg_clock_s() - since;
    const npg_cleaning *c = &frame->cleaning;
    if (c->normals_given)
        npg_worker_log(worker, NPG_LOG_INFO, frame->number, "%zu of %zu given normals were on the wrong side",
                       c->normals_flipped, c->normals_given);
    return NPG_OK;
}

static bool needs_normals(npg_worker *worker, const npg_frame *frame)
{
    const outlier_state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    if (npg_worker_pass(worker) == NPG_PASS_CHOOSE)
        return npg_choice_is_candidate(&facts->choice, frame->index);
    if (npg_worker_pass(worker) != NPG_PASS_SOLVE && npg_worker_pass(worker) != NPG_PASS_FUSE) return false;
    if (lone_sensor(frame)) return true; /* they face it: sure, and needed to grow */
    bool is_planned_key = facts->plan.frame_count && frame->index == facts->plan.key;
    return s->normals_for == FOR_ALL || frame->is_key || is_planned_key;
}

/* ---- the stage ---- */

static void add_counts(outlier_state *s, const npg_cleaning *c)
{
    npg_cleaning *sum = &s->sum;
    sum->read += c->read;
    sum->not_finite += c->not_finite;
    sum->duplicate += c->duplicate;
    sum->isolated += c->isolated;
    sum->thinned += c->thinned;
    sum->normals_given += c->normals_given;
    sum->normals_flipped += c->normals_flipped;
    sum->normals_estimated += c->normals_estimated;
    s->frames++;
}

static npg_status name_frame(npg_status status, const npg_frame *frame)
{
    return npg_error_prefix(status, "frame %lld (%s)", (long long)frame->number,
                            frame->path ? frame->path : "pushed");
}

/* A frame that can't be used is skipped under --keep-going, else it ends the run. */
static npg_status skip_or_fail(npg_worker *worker, npg_frame *frame, npg_status status)
{
    outlier_state *s = npg_worker_state(worker);
    if (status != NPG_BAD_INPUT) return name_frame(status, frame);
    if (!npg_worker_settings(worker)->keep_going)
        return npg_error_advise(name_frame(status, frame), NPG_ADVISE_KEEP_GOING);
    if (comes_first(worker, frame))
        npg_worker_warn(worker, true, frame->number, "skipped %s: %s",
                        frame->path ? frame->path : "what was pushed", npg_error_text());
    frame->is_skipped = true;
    frame->point_count = 0;
    npg_release(&frame->pos_local);
    npg_release(&frame->normals);
    npg_release(&frame->colours);
    npg_release(&frame->isolated);
    npg_frame_forget_sensors(frame);
    s->skipped++;
    return NPG_OK;
}

/* Clean already: an earlier pass has put it into the store. */
static bool is_done(const npg_frame *frame)
{
    return frame->is_skipped || (frame->fields & NPG_FIELD_CLEAN);
}

/* One sensor that saw the whole frame, at `place`: the frame's, if none is named. */
static npg_status add_sensor(npg_worker *worker, npg_frame *frame, const double place[3])
{
    outlier_state *s = npg_worker_state(worker);
    const double *world = npg_worker_facts(worker)->origin.world;
    NPG_TRY(npg_alloc_array(&frame->sensor_local, NPG_FOR_FRAMES, 1, 3 * sizeof(float)));
    frame->sensor_count = 1;
    for (int a = 0; a < 3; a++) frame->sensor_local[a] = (float)place[a];
    if (!s->has_found_sensor)
        npg_worker_log(worker, NPG_LOG_INFO, frame->number,
                       "the points look like one view, from about %.3g,%.3g,%.3g: a sensor's (option sensor)",
                       place[0] + world[0], place[1] + world[1], place[2] + world[2]);
    s->has_found_sensor = true;
    return NPG_OK;
}

/* A depth camera's points are in its own coordinates, as a rule.  Isolated points are gone by now: they would
 * make any cloud look like one view.  In other coordinates all frames have one sensor if the first has beyond doubt. */
static npg_status look_for_sensor(npg_worker *worker, npg_frame *frame)
{
    const outlier_state *s = npg_worker_state(worker);
    double place[3];
    bool is_measured = npg_worker_pass(worker) != NPG_PASS_MEASURE, is_found = false, is_sure;
    bool is_one = is_measured ? npg_worker_facts(worker)->sensor_count_max == 1 : s->has_found_sensor;
    if (frame->sensor_count || s->sensor_kind != SENSOR_AUTO) return NPG_OK;
    for (int a = 0; a < 3; a++) place[a] = -npg_worker_facts(worker)->origin.world[a];
    NPG_TRY(npg_cloud_is_single_view(&is_found, frame->pos_local, frame->point_count, place));
    if (!is_found && (is_one || (!is_measured && !s->frames))) {
        NPG_TRY(npg_one_view_find(&is_found, &is_sure, place, frame->pos_local, frame->point_count));
        is_found = is_found && (is_sure || is_one);
    }
    return is_found ? add_sensor(worker, frame, place) : NPG_OK;
}

/* As option sensor says; without it those that the frame brings. */
static npg_status set_sensors(npg_worker *worker, npg_frame *frame)
{
    const outlier_state *s = npg_worker_state(worker);
    if (frame->is_skipped || s->sensor_kind == SENSOR_AUTO) return NPG_OK;
    npg_frame_forget_sensors(frame);
    if (s->sensor_kind != SENSOR_GIVEN) return NPG_OK;
    return npg_sensors_set(&s->sensors, frame, &npg_worker_facts(worker)->origin);
}

static npg_status clean_frame(npg_worker *worker, npg_frame *frame)
{
    npg_status status = is_done(frame) ? NPG_OK : clean_points(worker, frame);
    if (!status) status = set_sensors(worker, frame);
    return status ? skip_or_fail(worker, frame, status) : NPG_OK;
}

static npg_status check_and_keep(npg_worker *worker, npg_frame *frame)
{
    const outlier_state *s = npg_worker_state(worker);
    NPG_TRY(npg_clean_check(frame));
    NPG_TRY(look_for_sensor(worker, frame));
    frame->fields |= NPG_FIELD_CLEAN;
    return s->store && s->keeps ? npg_frame_store_put(s->store, frame, true) : NPG_OK;
}

static npg_status find_normals(npg_worker *worker, npg_frame *frame)
{
    const outlier_state *s = npg_worker_state(worker);
    if (s->store && npg_frame_store_get_normals(s->store, frame)) return NPG_OK;
    NPG_TRY(make_or_mend_normals(worker, frame));
    if (s->store && s->keeps) npg_frame_store_put_normals(s->store, frame);
    return NPG_OK;
}

static npg_status check_frame_and_normals(npg_worker *worker, npg_frame *frame)
{
    if (frame->is_skipped) return NPG_OK;
    npg_status status = is_done(frame) ? NPG_OK : check_and_keep(worker, frame);
    if (!status && needs_normals(worker, frame)) status = find_normals(worker, frame);
    if (status) return skip_or_fail(worker, frame, status);
    add_counts(npg_worker_state(worker), &frame->cleaning);
    return NPG_OK;
}

static npg_status drop_isolated(npg_worker *worker, npg_chunk *chunk)
{
    const outlier_state *s = npg_worker_state(worker);
    size_t frame_count = npg_chunk_count(chunk), count = 0;
    npg_frame **frames;
    if (!s->drop_isolated) return NPG_OK;
    NPG_TRY(npg_alloc_array(&frames, NPG_FOR_FRAMES, frame_count + 1, sizeof *frames));
    for (size_t i = 0; i < frame_count; i++) {
        npg_frame *frame = npg_chunk_frame(chunk, i);
        if (!is_done(frame)) frames[count++] = frame;
    }
    npg_status status = npg_isolated_drop(frames, count, NPG_NEIGHBOURS, s->ratio);
    npg_release(&frames);
    return status;
}

/* Frames may be kept while a later pass brings them again, unless a custom stage before this one would then
 * see them twice. */
static void find_store(npg_worker *worker)
{
    outlier_state *s = npg_worker_state(worker);
    const npg_custom_stage *custom;
    s->store = npg_worker_fact(worker, &npg_fact_frame_store);
    s->keeps = npg_worker_pass(worker) != NPG_PASS_SOLVE;
    for (size_t i = 0; (custom = npg_options_custom_stage(npg_worker_options(worker), i)); i++)
        if (!strcmp(custom->after, "ingest")) s->store = NULL;
}

static npg_status outlier_process(npg_worker *worker, npg_chunk **chunk)
{
    find_store(worker);
    size_t frame_count = npg_chunk_count(*chunk);
    for (size_t i = 0; i < frame_count; i++) NPG_TRY(clean_frame(worker, npg_chunk_frame(*chunk, i)));
    NPG_TRY(drop_isolated(worker, *chunk));
    for (size_t i = 0; i < frame_count; i++) {
        if (npg_worker_stopping(worker)) return NPG_STOPPED;
        NPG_TRY(check_frame_and_normals(worker, npg_chunk_frame(*chunk, i)));
    }
    return NPG_OK;
}

/* The figures of the pass replace those of the pass before: they are the same points. */
static npg_status outlier_flush(npg_worker *worker)
{
    const outlier_state *s = npg_worker_state(worker);
    json_t *r = npg_worker_report(worker);
    const struct {
        const char *name;
        size_t value;
    } figures[] = {{"frames", s->frames},
                   {"frames_skipped", s->skipped},
                   {"points_read", s->sum.read},
                   {"not_finite", s->sum.not_finite},
                   {"duplicate", s->sum.duplicate},
                   {"thinned", s->sum.thinned},
                   {"isolated", s->sum.isolated},
                   {"normals_given", s->sum.normals_given},
                   {"normals_flipped", s->sum.normals_flipped},
                   {"normals_estimated", s->sum.normals_estimated}};
    for (size_t i = 0; i < sizeof figures / sizeof *figures; i++)
        json_object_set_new(r, figures[i].name, json_integer((json_int_t)figures[i].value));
    double before_s = json_real_value(json_object_get(r, "normals_s")); /* of the passes before */
    json_object_set_new(r, "normals_s", json_real(before_s + s->normals_s));
    return NPG_OK;
}

/* One frame at work: the hash table and the normals with their trials; as many as there are threads in the
 * search for isolated points. */
static size_t outlier_memory(const npg_worker *worker, size_t *chunks_held)
{
    const outlier_state *s = npg_worker_state(worker);
    size_t points = npg_worker_facts(worker)->point_count_max;
    size_t thinned = points < (size_t)s->point_max ? points : (size_t)s->point_max;
    size_t threads = npg_parallel_parts((size_t)npg_worker_settings(worker)->chunk_frames, 1, 0);
    *chunks_held = 1;
    return 17 * points + 60 * thinned + npg_winding_memory(thinned) + npg_one_view_memory() +
           threads * npg_find_isolated_memory(thinned);
}

const npg_stage npg_stage_outlier = {.name = "outlier",
                                     .help = "Cleans points, makes and mends normals",
                                     .options = outlier_options,
                                     .state_size = sizeof(outlier_state),
                                     .passes = NPG_PASS_MEASURE | NPG_PASS_SCORE | NPG_PASS_CHOOSE |
                                               NPG_PASS_FUSE | NPG_PASS_SOLVE,
                                     .needs = NPG_FIELD_POINTS,
                                     .gives = NPG_FIELD_CLEAN,
                                     .init = outlier_init,
                                     .process = outlier_process,
                                     .flush = outlier_flush,
                                     .uninit = outlier_uninit,
                                     .memory = outlier_memory};
