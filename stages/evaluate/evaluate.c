/* Evaluate: says for every frame how well the deformed surface explains the points (measure.h), and whether
 * that is good enough. */
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "evaluate/evaluate_internal.h"
#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "geometry/sensor_space.h"
#include "job/job.h"
#include "pipeline/file.h"
#include "pipeline/options.h"
#include "pipeline/order.h"
#include "pipeline/stage.h"

#define WARNINGS_MAX 10 /* frames below the bar that get a warning of their own; set by trial */

typedef struct aggregate {
    double sum, worst;
    size_t count;
    int64_t worst_number;
} aggregate;

typedef struct fault {
    int kind;            /* NPG_FAULT_* */
    double value, bound; /* in per cent */
} fault;

typedef struct evaluate_state {
    /* options; the shares in per cent */
    double residual_max, coverage_min, flipped_max, stretched_max, unsupported_max, nowhere_max, lost_max;
    npg_measure_settings measured;
    npg_topology watch;
    /* of the run */
    npg_measure *measure; /* opened for the first frame that has a mesh */
    npg_verdict verdict;
    aggregate sums[NPG_FIGURE_ROWS];
    int64_t *bad; /* numbers of the frames below the bar, in a fusing pass their indices; owned */
    size_t bad_count, bad_capacity, good_count, skipped_count;
    fault worst; /* of the bad ones, by how often it is the bar */
    int64_t worst_number;
} evaluate_state;

/* ---- one frame ---- */

static npg_status check_vertices(const npg_frame *frame, const npg_mesh *reference)
{
    if (frame->vert_count != reference->vert_count)
        return npg_error(NPG_FAILED, "frame %" PRId64 " has %zu vertices, the reference %zu", frame->number,
                         frame->vert_count, reference->vert_count);
    for (size_t i = 0; i < 3 * frame->vert_count; i++)
        if (!isfinite(frame->vert_unit[i]))
            return npg_error(NPG_DIVERGED, "frame %" PRId64 ": vertex %zu is not finite", frame->number,
                             i / 3);
    return NPG_OK;
}

static npg_figures no_figures(void)
{
    npg_figures figures;
    for (int i = 0; i < NPG_FIGURE_ROWS; i++) *npg_figure_at(&figures, i) = (double)NAN;
    for (int i = 0; i < NPG_MISFITS; i++)
        figures.misfits[i] = (npg_misfit){(double)NAN, {(double)NAN, (double)NAN, (double)NAN}};
    for (int a = 0; a < 3; a++) figures.unsupported_at[a] = (double)NAN;
    for (size_t i = 0; i < 3 * NPG_MARKS; i++) figures.marks[i] = NAN;
    figures.fault = NPG_FAULT_NONE;
    figures.good = false;
    return figures;
}

static npg_status measure_frame(npg_worker *worker, npg_frame *frame)
{
    evaluate_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    if (!state->measure)
        NPG_TRY(npg_measure_open(&state->measure, facts->reference, facts->unseen_share, &state->measured));
    NPG_TRY(check_vertices(frame, facts->reference));
    return npg_measure_frame(state->measure, frame, &facts->box);
}

/* ---- the verdict ---- */

/* All in per cent. */
static const char *const fault_texts[NPG_FAULTS] = {
    "",
    "median distance of the points to the surface, in % of the diagonal,",
    "distance of 95 % of the points to the surface, at most, in % of the diagonal,",
    "share of the surface with points near it, in %,",
    "share of the surface that is turned over, in %,",
    "share of the surface that grew or shrank tenfold, in %,",
    "share of the surface that no points support, in %,",
    "share of the surface where sensors saw that nothing is, in %,",
    "share of the points that have no surface near them, in %,",
    "share of the surface without points near it, in %, unlike in other frames,",
    "mean distance of the surface to the points, in % of the diagonal, unlike in other frames,",
    "share of the surface that is torn in one place, in %, unlike in other frames,",
    "motion since the frame before, in % of the diagonal, unlike in the frames around,"};

/* What is wrong with a frame by itself.  A comparison with NaN fails, as it should, but for the support: there
 * it means that nobody knows which points the reference is of.  Of 95 % of the points good fits of noisy captures keep to
 * the bar on the median, a lost limb and a surface that follows noise are clearly above it.  Images know how far off a
 * point is missed; of their coarse depths 95 % are off by more. */
static fault fault_of(const evaluate_state *state, const npg_figures *f, double unseen_share)
{
    /* Without images only those that are missed in one place tell a limb from noise. */
    bool has_images = !isnan(f->lost_share);
    double far = isnan(f->misfits[NPG_MISFIT_FAR].share) ? 0 : f->misfits[NPG_MISFIT_FAR].share;
    const fault kinds[] = {
        {NPG_FAULT_MEDIAN, f->point_dist_median, state->residual_max},
        {NPG_FAULT_P95, has_images ? 0 : f->point_dist_p95, NPG_CLEARLY * state->residual_max},
        {NPG_FAULT_COVERAGE, f->coverage,
         state->coverage_min * (1 - unseen_share)}, /* of what the keyframe saw */
        {NPG_FAULT_FLIPPED, f->flipped_share, state->flipped_max},
        {NPG_FAULT_STRETCHED, f->stretched_share, state->stretched_max},
        {NPG_FAULT_UNSUPPORTED, isnan(f->unsupported_share) ? 0 : f->unsupported_share,
         state->unsupported_max},
        {NPG_FAULT_NOWHERE, isnan(f->nowhere_share) ? 0 : f->nowhere_share, state->nowhere_max},
        {NPG_FAULT_LOST, has_images ? f->lost_share : far,
         has_images ? state->lost_max : state->lost_max / NPG_CLEARLY}};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        double value = 100 * kinds[i].value, bound = kinds[i].bound;
        bool is_above = kinds[i].kind == NPG_FAULT_COVERAGE ? value >= bound : value <= bound;
        if (!is_above) return (fault){kinds[i].kind, value, bound};
    }
    return (fault){0};
}

static void add_up(evaluate_state *state, npg_frame *frame)
{
    for (int i = 0; i < NPG_FIGURE_ROWS; i++) {
        double value = *npg_figure_at(&frame->figures, i);
        aggregate *sum = &state->sums[i];
        if (!isfinite(value)) continue;
        bool is_worse = npg_figure_rows[i].is_small_bad ? value < sum->worst : value > sum->worst;
        bool is_tie = value == sum->worst && frame->number < sum->worst_number;
        if (!sum->count++ || is_worse || is_tie) {
            sum->worst = value;
            sum->worst_number = frame->number;
        }
        sum->sum += value;
    }
}

/* How many times its bar a fault is. */
static double times_of(const fault *f)
{
    return f->kind == NPG_FAULT_COVERAGE ? f->bound / fmax(f->value, 1e-9) : f->value / fmax(f->bound, 1e-9);
}

static npg_status note_bad(evaluate_state *state, int64_t number, const fault *f)
{
    double more = times_of(f) - times_of(&state->worst);
    if (!state->bad_count || more > 0 || (more >= 0 && number < state->worst_number)) {
        state->worst = *f;
        state->worst_number = number;
    }
    NPG_TRY(
        npg_grow(&state->bad, &state->bad_capacity, state->bad_count + 1, sizeof *state->bad, NPG_FOR_RUN));
    state->bad[state->bad_count++] = number;
    return NPG_OK;
}

/* A warning of its own for each of the first ones.  at: the place of what has no support, or NULL. */
static void warn_of_bad(npg_worker *worker, int64_t number, const fault *f, const double *at)
{
    const evaluate_state *state = npg_worker_state(worker);
    char place[128] = "";
    if (state->bad_count > WARNINGS_MAX) return;
    if (at && f->kind == NPG_FAULT_UNSUPPORTED)
        snprintf(place, sizeof place, ", the largest part around (%.4g, %.4g, %.4g)", at[0], at[1], at[2]);
    npg_worker_warn(worker, true, number, "below the bar: %s is %.3g, the bar %.3g%s", fault_texts[f->kind],
                    f->value, f->bound, place);
}

/* What a frame is known by: of a fusing pass nobody is told but the reference's owner, who asks for places in time. */
static int64_t name_of(const npg_worker *worker, int64_t number, int64_t index)
{
    return npg_worker_pass(worker) == NPG_PASS_FUSE ? index : number;
}

/* Of a frame that a resumed run restores, too: the same faults follow from the same figures. */
static npg_status take_frame(npg_worker *worker, npg_frame *frame, bool is_new)
{
    evaluate_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    fault found = fault_of(state, &frame->figures, facts->unseen_share);
    frame->figures.fault = frame->is_skipped ? 0 : found.kind;
    frame->figures.good = !found.kind && !frame->is_skipped;
    if (frame->is_shared) return NPG_OK;
    add_up(state, frame);
    state->good_count += frame->figures.good;
    state->skipped_count += frame->is_skipped;
    if (frame->is_skipped) return NPG_OK;
    if (found.kind) NPG_TRY(note_bad(state, name_of(worker, frame->number, frame->index), &found));
    if (found.kind && is_new) warn_of_bad(worker, frame->number, &found, frame->figures.unsupported_at);
    return npg_verdict_add(&state->verdict, frame);
}

/* When all frames are there: what is wrong with some beside the others. */
static npg_status find_late(npg_worker *worker, npg_late_faults *late)
{
    evaluate_state *state = npg_worker_state(worker);
    state->verdict.key = npg_worker_facts(worker)->plan.key;
    state->verdict.bars =
        (npg_verdict_bars){state->coverage_min > 0 ? (1 - state->coverage_min / 100) / 2 : 1,
                           fmax(state->measured.cover_dist, state->residual_max) / 100,
                           state->residual_max / 100, npg_worker_facts(worker)->sensor_count_max > 0};
    NPG_TRY(npg_verdict_finish(&state->verdict, late));
    for (size_t i = 0; i < late->count; i++) {
        const struct npg_late_fault *one = &late->faults[i];
        const fault found = {one->fault, one->value, one->bound};
        NPG_TRY(note_bad(state, name_of(worker, one->number, one->index), &found));
        if (npg_worker_pass(worker) == NPG_PASS_SOLVE) warn_of_bad(worker, one->number, &found, NULL);
    }
    return NPG_OK;
}

static npg_status judge_together(npg_worker *worker)
{
    evaluate_state *state = npg_worker_state(worker);
    npg_late_faults *late;
    NPG_TRY(npg_alloc(&late, NPG_FOR_RUN, sizeof *late));
    npg_status status = find_late(worker, late);
    state->good_count -= late->count;
    npg_status published = npg_worker_publish(worker, &npg_fact_late_faults, late);
    return status ? status : published;
}

/* ---- the report ---- */

static json_t *json_of_sums(const evaluate_state *state)
{
    json_t *figures = json_object();
    for (size_t i = 0; i < NPG_FIGURE_ROWS; i++) {
        const aggregate *sum = &state->sums[i];
        if (!sum->count) continue;
        json_object_set_new(figures, npg_figure_rows[i].name,
                            json_pack("{sf sf sI}", "mean", sum->sum / (double)sum->count, "worst",
                                      sum->worst, "worst_frame", (json_int_t)sum->worst_number));
    }
    return figures;
}

/* The verdict in figures, and in words.  unseen: of the area of the reference, what no point that it is made
 * of lies near. */
static void report_verdict(json_t *report, const evaluate_state *state, double unseen)
{
    const aggregate *p95 = &state->sums[NPG_FIGURE_P95];
    size_t frames = state->good_count + state->bad_count + state->skipped_count;
    double percent = state->verdict.count ? 100 * state->verdict.fit : (double)NAN;
    int64_t worst = state->bad_count ? state->worst_number : p95->worst_number;
    char why[256], middle[128] = "", text[512];
    int length = 0;
    if (state->bad_count)
        snprintf(why, sizeof why, "%s %.3g, the bar %.3g", fault_texts[state->worst.kind], state->worst.value,
                 state->worst.bound);
    else
        snprintf(why, sizeof why, "95 %% of its points within %.2g %%", 100 * p95->worst);
    json_t *quality =
        json_pack("{sI sI so sf}", "good", (json_int_t)state->good_count, "frames", (json_int_t)frames,
                  "median_percent", npg_json_real(percent), "unseen_percent", 100 * unseen);
    if (state->verdict.count) length = snprintf(middle, sizeof middle, ", median %.2g %%", percent);
    if (unseen > NPG_FEW)
        snprintf(middle + length, sizeof middle - (size_t)length, ", %.2g %% of the surface without points",
                 100 * unseen);
    length = snprintf(text, sizeof text, "%zu of %zu frames good%s", state->good_count, frames, middle);
    if (state->bad_count || p95->count) {
        json_object_update_new(quality, json_pack("{sI ss}", "worst_frame", (json_int_t)worst, "worst", why));
        snprintf(text + length, sizeof text - (size_t)length, ", worst frame %" PRId64 " (%s)", worst, why);
    }
    json_object_set_new(report, "quality", quality);
    json_object_set_new(report, "verdict", json_string(text));
}

static npg_status end_fusing(npg_worker *worker)
{
    evaluate_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    npg_late_faults late = {0};
    int64_t within = 0;
    npg_status status = find_late(worker, &late);
    npg_release(&late.faults);
    if (!status) status = npg_topology_finish(&state->watch, worker);
    for (size_t i = 0; i < state->bad_count; i++)
        within += (!facts->has_changed[0] || state->bad[i] < facts->changed_at[0]) &&
                  (!facts->has_changed[1] || state->bad[i] > facts->changed_at[1]);
    *npg_own(worker, unfit_count) = (int64_t)state->bad_count;
    *npg_own(worker, unfit_within) = within;
    *npg_own(worker, unfit_worst) = state->worst_number;
    return status;
}

static npg_status flush(npg_worker *worker)
{
    evaluate_state *state = npg_worker_state(worker);
    if (npg_worker_pass(worker) == NPG_PASS_FUSE) return end_fusing(worker);
    NPG_TRY(judge_together(worker));
    json_t *report = npg_worker_report(worker), *bad = json_array();
    if (state->bad_count) qsort(state->bad, state->bad_count, sizeof *state->bad, npg_order_int64);
    for (size_t i = 0; i < state->bad_count; i++)
        json_array_append_new(bad, json_integer((json_int_t)state->bad[i]));
    json_object_update_new(report, json_pack("{so sI sI so}", "figures", json_of_sums(state), "good",
                                             (json_int_t)state->good_count, "skipped",
                                             (json_int_t)state->skipped_count, "bad", bad));
    report_verdict(report, state, npg_worker_facts(worker)->unseen_share);
    /* A resumed run has not warned itself of those that it restored. */
    if (state->bad_count > (npg_worker_facts(worker)->is_resumed ? 0 : WARNINGS_MAX))
        npg_worker_warn(worker, true, -1, "%zu frames are below the bar; the report lists them",
                        state->bad_count);
    if (state->skipped_count)
        npg_worker_warn(worker, true, -1, "%zu frames were skipped", state->skipped_count);
    return npg_topology_finish(&state->watch, worker);
}

/* ---- what an earlier run of the same job has measured ---- */

static npg_status restore_line(void *user, const json_t *line, const char *text, size_t size)
{
    npg_worker *worker = user;
    evaluate_state *state = npg_worker_state(worker);
    npg_frame frame = {.index = (int64_t)json_integer_value(json_object_get(line, "index")),
                       .number = (int64_t)json_integer_value(json_object_get(line, "number")),
                       .is_shared = json_is_true(json_object_get(line, "shared")),
                       .is_skipped = json_is_true(json_object_get(line, "skipped")),
                       .figures = no_figures()};
    (void)text, (void)size;
    if (!json_object_get(line, "figures") || frame.is_shared) return NPG_OK;
    npg_frame_line_read(&frame.figures, line);
    NPG_TRY(take_frame(worker, &frame, false));
    return npg_topology_add(&state->watch, worker, &frame);
}

static npg_status restore(npg_worker *worker)
{
    npg_job *job = npg_job_of(worker);
    int64_t count, bytes;
    npg_job_exported(job, &count, &bytes);
    return npg_json_lines(npg_worker_settings(worker)->output, NPG_FRAME_LOG_NAME, bytes, restore_line,
                          worker);
}

/* ---- the stage ---- */

static npg_status init(npg_worker *worker)
{
    evaluate_state *state = npg_worker_state(worker);
    const char *unseen = npg_options_get(npg_worker_options(worker), "unseen");
    state->measured.lies_as_key = !npg_worker_settings(worker)->reference[0];
    /* A back that nobody saw was asked for. */
    if (unseen && !strcmp(unseen, "close")) state->unsupported_max = 100;
    if (npg_worker_pass(worker) == NPG_PASS_FUSE) return NPG_OK;
    return npg_worker_facts(worker)->is_resumed ? restore(worker) : NPG_OK;
}

/* In a fusing pass only to know whether the reference explains the capture to its ends, so that what all frames
 * saw may be taken together. */
static npg_status see_frame(npg_worker *worker, npg_frame *frame)
{
    evaluate_state *state = npg_worker_state(worker);
    bool is_judged = npg_worker_pass(worker) == NPG_PASS_SOLVE;
    frame->figures = no_figures();
    frame->is_shared = npg_topology_is_shared(&state->watch, npg_worker_facts(worker), frame->index);
    if (frame->vert_unit && (!is_judged || frame->fields & NPG_FIELD_VERTICES))
        NPG_TRY(measure_frame(worker, frame));
    if (is_judged) frame->fields |= NPG_FIELD_FIGURES;
    if (is_judged || !isnan(frame->figures.coverage)) NPG_TRY(take_frame(worker, frame, is_judged));
    return npg_topology_add(&state->watch, worker, frame);
}

static npg_status process(npg_worker *worker, npg_chunk **chunk)
{
    for (size_t i = 0; i < npg_chunk_count(*chunk); i++)
        NPG_TRY(see_frame(worker, npg_chunk_frame(*chunk, i)));
    return NPG_OK;
}

static void uninit(npg_worker *worker)
{
    evaluate_state *state = npg_worker_state(worker);
    npg_measure_close(&state->measure);
    npg_alarm_close(&state->watch.alarm);
    npg_release(&state->verdict.records);
    npg_release(&state->bad);
}

static size_t memory(const npg_worker *worker, size_t *chunks_held)
{
    const evaluate_state *state = npg_worker_state(worker);
    *chunks_held = 1;
    return npg_measure_memory(&state->measured, npg_worker_facts(worker)->point_count_max,
                              npg_worker_verts_at_most(worker)) +
           npg_free_space_memory(npg_worker_facts(worker)->view_count_max);
}

#define AT(member) offsetof(evaluate_state, member)

/* clang-format off */
static const npg_option options[] = {
    /* type                 name                place                   default   least most  shown as or words */
    NPG_PART(REAL,          "bars.residual",    AT(residual_max),       "0.5",    0, 100,  "PERCENT",
        "most median distance of a frame's points to the surface, in per cent of the figure's diagonal; "
        "where no depth images are known, 95 % of them lie within twice that"),
    NPG_PART(REAL,          "bars.coverage",    AT(coverage_min),       "50",     0, 100,  "PERCENT",
        "least share of the surface that the keyframe saw and that is in sight, with points near it, in per "
        "cent. A frame with clearly more of it without points than the best quarter of the frames is bad, too; "
        "0: none is"),
    NPG_PART(REAL,          "bars.flipped",     AT(flipped_max),        "1",      0, 100,  "PERCENT",
        "most of its surface that is turned over, in per cent"),
    NPG_PART(REAL,          "bars.stretched",   AT(stretched_max),      "5",      0, 100,  "PERCENT",
        "most of its surface that grew or shrank tenfold, in per cent"),
    NPG_PART(REAL,          "bars.unsupported", AT(unsupported_max),    "10",     0, 100,  "PERCENT",
        "most of its surface that has no points near it, neither of the frames that the reference was made "
        "from (of a given mesh: of the keyframe, where its sensors could see it) nor of its own, in per "
        "cent"),
    NPG_PART(REAL,          "bars.nowhere",     AT(nowhere_max),        "1",      0, 100,  "PERCENT",
        "most of its surface in space that a depth image shows to be empty: clearly before what was measured, "
        "or outside the outline of a body whose background was removed, each by itself, in per cent"),
    NPG_PART(REAL,          "bars.lost",        AT(lost_max),           "2",      0, 100,  "PERCENT",
        "most of its points that lie farther from the surface than depth images are sure of, three cells of "
        "160 along an image, in per cent; without images half of that, of points that are missed in one place"),
    NPG_PART(REAL,          "bars.cover",       AT(measured.cover_dist), "1",      0, 100,  "PERCENT",
        "how near a point must be to cover the surface, in per cent of the diagonal"),
    NPG_KEY(INT,            "evaluate-points",  AT(measured.point_limit), "100000", 0, 1e12, NULL,
        "Points per frame that figures are taken from, evenly spread over the file; 0: all"),
    NPG_PROGRAM_ROW(CHOICE, "alarm",            AT(watch.mode),         "report", "report|split",
        "Where the reference no longer explains the points: "
        "say so and go on, or end there (what --segments auto asks for)"),
    NPG_KEY(INT,            "segment-min",      AT(watch.segment_min),  "8",      1, 1e9,  NULL,
        "Frames that a segment has at least; shorter ones are left to their neighbour, with exit code 7"),
    NPG_PROGRAM_ROW(INT,    "shared-first",     AT(watch.shared_first), "0",      0, 1e9,  NULL,
        "Frames at the beginning that another segment explains: solved, but not judged"),
    NPG_PROGRAM_ROW(INT,    "shared-last",      AT(watch.shared_last),  "0",      0, 1e9,  NULL,
        "The same at the end"),
    {0}};
/* clang-format on */

const npg_stage npg_stage_evaluate = {.name = "evaluate",
                                      .help = "Measure every frame and judge it",
                                      .options = options,
                                      .state_size = sizeof(evaluate_state),
                                      .passes = NPG_PASS_FUSE | NPG_PASS_SOLVE,
                                      .needs = NPG_FIELD_CLEAN | NPG_FIELD_KEY | NPG_FIELD_REFERENCE |
                                               NPG_FIELD_VERTICES,
                                      .gives = NPG_FIELD_FIGURES,
                                      .init = init,
                                      .process = process,
                                      .flush = flush,
                                      .uninit = uninit,
                                      .memory = memory};
