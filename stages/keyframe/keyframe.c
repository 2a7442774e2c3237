/* Keyframe: finds the box of the capture, scores every frame and chooses the one whose surface
 * becomes the reference.
 *
 * Based on: the keyframe selection of the Neu-PiG paper.  The score of frame t of T is the number of cells of
 * a 512^3 grid over [-1, 1]^3 that hold a point, times exp(-0.001 (t - T/2)^2): the frame that shows most
 * surface, near the middle in time.
 *
 * Not in the paper: the frame that is found is only the first of several candidates, of which the choosing
 * pass takes the one whose surface does best in the others (candidates.c).
 * A mesh of the user's own has a pose already: its keyframe is the frame that it is nearest to
 * (likeness.c). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "job/job.h"
#include "keyframe/keyframe_internal.h"
#include "pipeline/cost.h"
#include "pipeline/order.h"
#include "pipeline/plan.h"

#define SHOWN_SCORES 5
#define NO_NUMBER    (-1)

enum { CHOICE_PAPER, CHOICE_JUDGED };

typedef struct candidate {
    int64_t index, number;
    size_t cell_count;
    double score; /* with a mesh of the user's own: minus its distance from it, unit */
} candidate;

typedef struct keyframe_state {
    int64_t number, window, overlap; /* options */
    int choice;                      /* option */
    double box_margin;               /* option */
    npg_extent *extent;              /* from the first usable frame on; owned */
    candidate best[SHOWN_SCORES];    /* best first */
    size_t best_count;
    npg_likeness *likeness; /* of the user's own mesh; owned */
    npg_choose_pass choosing;
    candidate chosen; /* the frame the user named */
    bool is_chosen, is_chosen_skipped;
    double *diagonals; /* of the boxes of the frames so far; owned   */
    size_t diagonal_count, diagonal_room;
    int64_t usable_count; /* frames that were not skipped               */
    int64_t passed_count; /* frames of the solving pass so far          */
    npg_outside outside;  /* of a live source, behind the look-ahead    */
} keyframe_state;

/* Whether a live source goes on behind the look-ahead; known once that is measured. */
static bool is_open(const npg_facts *facts)
{
    return facts->frame_count < 0;
}

/* ---- measuring ---- */

static npg_status note_diagonal(keyframe_state *state, double diagonal)
{
    NPG_TRY(npg_grow(&state->diagonals, &state->diagonal_room, state->diagonal_count + 1,
                     sizeof *state->diagonals, NPG_FOR_RUN));
    state->diagonals[state->diagonal_count++] = diagonal;
    return NPG_OK;
}

static npg_status measure_frame(npg_worker *worker, const npg_frame *frame)
{
    keyframe_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    npg_bounds bounds = npg_bounds_empty();
    if (frame->number < facts->number_min) *npg_own(worker, number_min) = frame->number;
    if (frame->number > facts->number_max) *npg_own(worker, number_max) = frame->number;
    if (frame->point_count > facts->point_count_max) *npg_own(worker, point_count_max) = frame->point_count;
    if (frame->point_count && !frame->normals) *npg_own(worker, has_normals) = false;
    if (frame->sensor_count > facts->sensor_count_max)
        *npg_own(worker, sensor_count_max) = frame->sensor_count;
    if (frame->views && frame->sensor_count > facts->view_count_max)
        *npg_own(worker, view_count_max) = frame->sensor_count;
    if (frame->is_skipped) return NPG_OK;
    state->usable_count++;
    for (size_t i = 0; i < frame->point_count; i++)
        if (npg_vec3_is_finitef(frame->pos_local + 3 * i))
            npg_bounds_add_points(&bounds, frame->pos_local + 3 * i, 1);
    npg_bounds_add(npg_own(worker, bounds_local), &bounds);
    return bounds.lo[0] <= bounds.hi[0] ? note_diagonal(state, npg_bounds_diagonal(&bounds)) : NPG_OK;
}

/* A figure that walks through its capture is smaller than the box of its way.  The median, because a few
 * frames may hold strays far off, or a part of the figure. */
static void set_diagonal(keyframe_state *state, npg_frame_box *box)
{
    size_t count = state->diagonal_count;
    if (!count) return;
    qsort(state->diagonals, count, sizeof *state->diagonals, npg_order_double);
    double median = state->diagonals[count / 2];
    if (median > 0) box->diagonal = median;
}

static void report_box(json_t *report, const npg_facts *facts)
{
    const npg_frame_box *box = &facts->box;
    json_t *lo = json_array(), *hi = json_array();
    for (int a = 0; a < 3; a++) {
        json_array_append_new(lo, json_real(facts->bounds_local.lo[a] + box->origin[a]));
        json_array_append_new(hi, json_real(facts->bounds_local.hi[a] + box->origin[a]));
    }
    json_object_set_new(report, "box_lo", lo);
    json_object_set_new(report, "box_hi", hi);
    json_object_set_new(report, "box_diagonal", json_real(npg_bounds_diagonal(&facts->bounds_local)));
    json_object_set_new(report, "figure_diagonal", json_real(box->diagonal));
    json_object_set_new(report, "point_count_max", json_integer((json_int_t)facts->point_count_max));
}

/* The source goes on: what comes later needs room, too. */
static void widen_box(const keyframe_state *state, npg_bounds *bounds)
{
    double longest = 0;
    for (int a = 0; a < 3; a++) longest = fmax(longest, bounds->hi[a] - bounds->lo[a]);
    for (int a = 0; a < 3; a++) {
        bounds->lo[a] -= state->box_margin / 100 * longest;
        bounds->hi[a] += state->box_margin / 100 * longest;
    }
}

static npg_status refuse_one_window(const npg_facts *facts)
{
    return npg_error(NPG_USAGE,
                     "the live capture is longer than the look-ahead of %lld frames, "
                     "and one window over all frames needs all of them: "
                     "set the option window, raise look-ahead, "
                     "or write the frames to files and give those as input",
                     (long long)facts->planned_count);
}

/* What was skipped, has no finite point or was not asked for is as if it were in more than any other. */
static npg_status open_pieces(npg_worker *worker)
{
    uint8_t *pieces;
    size_t frame_count = (size_t)npg_worker_facts(worker)->planned_count;
    NPG_TRY(npg_alloc_array(&pieces, NPG_FOR_RUN, frame_count, 1));
    memset(pieces, UINT8_MAX, frame_count);
    npg_worker_keep(worker, pieces, NULL);
    return NPG_OK;
}

static npg_status close_measuring(npg_worker *worker)
{
    keyframe_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    if (is_open(facts) && !state->window) return refuse_one_window(facts);
    if (!state->usable_count)
        return npg_error(NPG_BAD_INPUT, "no frame is left: every frame was skipped or the input has none");
    if (is_open(facts)) widen_box(state, npg_own(worker, bounds_local));
    NPG_TRY(npg_frame_box_set(npg_own(worker, box), &facts->origin, &facts->bounds_local));
    set_diagonal(state, npg_own(worker, box));
    report_box(npg_worker_report(worker), facts);
    return open_pieces(worker);
}

/* ---- scoring ---- */

static bool is_better(const candidate *a, const candidate *b)
{
    return a->score > b->score || (a->score == b->score && a->index < b->index);
}

static void offer(keyframe_state *state, candidate scored)
{
    size_t at = state->best_count;
    if (at < SHOWN_SCORES)
        state->best_count++;
    else if (is_better(&scored, &state->best[at - 1]))
        at--;
    else
        return;
    for (; at > 0 && is_better(&scored, &state->best[at - 1]); at--) state->best[at] = state->best[at - 1];
    state->best[at] = scored;
}

/* Path of the user's own mesh; "" where the reference is to be made. */
static const char *own_mesh(const npg_worker *worker)
{
    return npg_worker_settings(worker)->reference;
}

/* Whether the keyframe is to be chosen among candidates: it is neither named nor that of a mesh. */
static bool has_candidates(const npg_worker *worker)
{
    const keyframe_state *state = npg_worker_state(worker);
    return state->choice == CHOICE_JUDGED && state->number == NO_NUMBER && !*own_mesh(worker);
}

/* The user's own mesh has the pose of a frame: the nearest one is the keyframe. */
static npg_status score_by_mesh(npg_worker *worker, candidate *c, const npg_frame *frame)
{
    keyframe_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    if (!state->likeness) {
        NPG_TRY(npg_likeness_open(&state->likeness, own_mesh(worker), &facts->origin, &facts->box));
        *npg_own(worker, own_verts) = npg_likeness_vert_count(state->likeness);
    }
    double dist_unit;
    NPG_TRY(npg_likeness_dist(&dist_unit, state->likeness, frame, &facts->box));
    c->score = -dist_unit;
    return NPG_OK;
}

/* Whether surfaces of several frames may be compared for the keyframe. */
static bool compares(const npg_worker *worker)
{
    return has_candidates(worker) && npg_worker_facts(worker)->sensor_count_max < 2;
}

/* The paper's score: many cells, near the middle in time.  Before several sensors, known or not, bodies hide parts of
 * themselves, the more the narrower they stand (one shows most of what it sees best): there area counts, and as areas differ
 * by a few per cent only, the middle less, by a fifth at the ends. */
static npg_status measure_extent(npg_worker *worker, candidate *scored, const npg_frame *frame)
{
    keyframe_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    bool by_area = has_candidates(worker) && facts->sensor_count_max != 1;
    double away = (double)frame->index - (double)facts->planned_count / 2;
    double share = away / (double)facts->planned_count;
    if (!state->extent) NPG_TRY(npg_extent_open(&state->extent, &facts->box, frame));
    *scored = (candidate){.index = frame->index, .number = frame->number};
    scored->cell_count =
        by_area ? npg_extent_area(state->extent, frame) : npg_extent_papers(state->extent, frame);
    scored->score =
        (double)scored->cell_count * (by_area ? 1 / (1 + share * share) : exp(-0.001 * away * away));
    return NPG_OK;
}

static npg_status note_pieces(npg_worker *worker, const npg_frame *frame)
{
    const keyframe_state *state = npg_worker_state(worker);
    uint8_t *pieces = npg_worker_kept(worker);
    size_t count;
    NPG_TRY(npg_extent_pieces(&count, state->extent, frame));
    pieces[frame->index] = (uint8_t)(count && count < UINT8_MAX ? count : UINT8_MAX);
    return NPG_OK;
}

static npg_status score_frame(npg_worker *worker, const npg_frame *frame)
{
    keyframe_state *state = npg_worker_state(worker);
    bool is_named = frame->number == state->number && state->number != NO_NUMBER;
    if (is_named && frame->is_skipped) state->is_chosen_skipped = true;
    if (frame->is_skipped) return NPG_OK;
    candidate scored;
    NPG_TRY(measure_extent(worker, &scored, frame));
    if (compares(worker)) NPG_TRY(note_pieces(worker, frame));
    if (scored.cell_count && *own_mesh(worker)) NPG_TRY(score_by_mesh(worker, &scored, frame));
    if (scored.cell_count) offer(state, scored);
    if (is_named && scored.cell_count && !state->is_chosen) {
        state->chosen = scored;
        state->is_chosen = true;
    }
    return NPG_OK;
}

static json_t *json_of(const candidate *c, bool is_by_mesh)
{
    json_t *json = json_pack("{sI sI sI}", "index", (json_int_t)c->index, "number", (json_int_t)c->number,
                             "cells", (json_int_t)c->cell_count);
    json_object_set_new(json, is_by_mesh ? "reference_dist_unit" : "score",
                        json_real(is_by_mesh ? -c->score : c->score));
    return json;
}

static npg_status choose(const keyframe_state *state, candidate *key)
{
    if (!state->best_count) return npg_error(NPG_BAD_INPUT, "no frame has a usable point");
    *key = state->best[0];
    if (state->number == NO_NUMBER) return NPG_OK;
    *key = state->chosen;
    if (state->is_chosen) return NPG_OK;
    if (state->is_chosen_skipped)
        return npg_error(NPG_BAD_INPUT, "keyframe %lld: this frame was skipped and can't be the keyframe",
                         (long long)state->number);
    return npg_error(NPG_USAGE, "keyframe %lld: no usable frame has this number", (long long)state->number);
}

/* Of an open source at its end. */
static void report_windows(npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    if (is_open(facts)) return;
    json_object_set_new(npg_worker_report(worker), "windows",
                        json_integer((json_int_t)npg_plan_window_count(&facts->plan, facts->frame_count)));
}

static npg_plan plan_around(const keyframe_state *state, const npg_facts *facts, int64_t key)
{
    int64_t count = is_open(facts) ? NPG_FRAMES_OPEN : facts->planned_count;
    int64_t asked = npg_plan_window_asked(state->window, is_open(facts) ? INT64_MAX : count);
    int64_t window = asked && asked < count ? asked : count;
    return (npg_plan){
        .frame_count = count, .key = key, .window = window, .overlap = window < count ? state->overlap : 0};
}

/* What the choosing pass is to look at. */
static void set_choice(npg_worker *worker)
{
    const keyframe_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    bool chooses = compares(worker);
    npg_choice *choice = npg_own(worker, choice);
    const uint8_t *pieces = npg_worker_kept(worker);
    if (facts->planned_count < 2 || *own_mesh(worker) || state->choice == CHOICE_PAPER) return;
    choice->is_open = has_candidates(worker);
    npg_candidates_list(choice, facts->plan.key, facts->planned_count, pieces, true);
    /* A pass that follows one side of the body says little of what other frames see, a sample little of all, and a key
     * in more pieces than others explains what it lacks by stretching. */
    bool is_tried = chooses && npg_candidates_is_whole(choice, pieces, facts->plan.key) &&
                    facts->brief.rounds_left && !facts->sensor_count_max &&
                    (int64_t)choice->count == facts->planned_count;
    if (chooses && !is_tried)
        npg_candidates_list(choice, facts->plan.key, facts->planned_count, pieces, false);
    choice->is_tried = is_tried;
}

static void report_key(npg_worker *worker, const candidate *key)
{
    const keyframe_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    bool is_own = *own_mesh(worker) != 0, is_named = state->number != NO_NUMBER;
    json_t *report = npg_worker_report(worker), *scores = json_array();
    for (size_t i = 0; i < state->best_count; i++)
        json_array_append_new(scores, json_of(&state->best[i], is_own));
    json_object_set_new(report, "key", json_of(key, is_own));
    json_object_set_new(report, "best", scores);
    if (facts->is_live) json_object_set_new(report, "open", json_boolean(is_open(facts)));
    report_windows(worker);
    const char *what = is_own && !is_named                 ? "is the keyframe, nearest to the reference"
                       : facts->choice.candidate_count > 1 ? "has the best score"
                                                           : "is the keyframe";
    npg_worker_log(worker, NPG_LOG_INFO, key->number, "%s of %lld frames (%zu cells, score %.4g)", what,
                   (long long)facts->planned_count, key->cell_count, key->score);
}

static npg_status set_plan(npg_worker *worker)
{
    keyframe_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    candidate key = {0};
    npg_status status = choose(state, &key);
    if (status && is_open(facts))
        return npg_error_prefix(status, "look-ahead of %lld frames", (long long)facts->planned_count);
    NPG_TRY(status);
    *npg_own(worker, plan) = plan_around(state, facts, key.index);
    *npg_own(worker, window_asked) = npg_plan_window_asked(state->window, INT64_MAX);
    *npg_own(worker, overlap_asked) = state->overlap;
    set_choice(worker);
    report_key(worker, &key);
    return NPG_OK;
}

/* ---- choosing pass: the last word on the keyframe ---- */

/* The windows lie around it. */
static void take_key(npg_worker *worker, int64_t index, int64_t number)
{
    json_t *key = json_pack("{sI sI}", "index", (json_int_t)index, "number", (json_int_t)number);
    npg_own(worker, plan)->key = index;
    json_object_set_new(npg_worker_report(worker), "key", key);
    report_windows(worker);
}

static npg_status close_choosing(npg_worker *worker)
{
    keyframe_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    json_t *report = npg_worker_report(worker), *by_score = json_object_get(report, "key");
    npg_candidate chosen;
    NPG_TRY(npg_choose_pass_end(&state->choosing, worker, &chosen));
    if (chosen.index < 0 || chosen.index == facts->plan.key) return NPG_OK;
    json_object_set(report, "key_by_score", by_score);
    take_key(worker, chosen.index, chosen.number);
    json_object_set_new(json_object_get(report, "key"), "judged", json_real(chosen.judgement.mean));
    return NPG_OK;
}

/* ---- another keyframe, where the reference's owner wants one ---- */

static npg_status settle(npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_candidate_clouds *clouds = npg_worker_fact(worker, &npg_fact_candidate_clouds);
    int64_t key = facts->brief.key;
    if (facts->brief.compares)
        npg_candidates_list(npg_own(worker, choice), facts->plan.key, facts->planned_count,
                            npg_worker_kept(worker), false);
    /* Before the first fusing pass the brief may be all zeros, unless it asks for another try. */
    if (npg_worker_pass(worker) != NPG_PASS_FUSE && !facts->brief.is_attempt) return NPG_OK;
    if (key < 0 || key == facts->plan.key) return NPG_OK;
    int64_t number = clouds->list[npg_candidate_clouds_find(clouds, key)].number;
    take_key(worker, key, number);
    npg_worker_log(worker, NPG_LOG_INFO, number, "is the keyframe now");
    return NPG_OK;
}

/* ---- fusing and solving pass ---- */

static npg_status mark_key(npg_worker *worker, npg_frame *frame)
{
    keyframe_state *state = npg_worker_state(worker);
    int64_t key = npg_worker_facts(worker)->plan.key;
    const npg_facts *facts = npg_worker_facts(worker);
    bool is_begun = facts->is_resumed && (facts->resumed_read || facts->plan.appended_at);
    bool is_first = state->passed_count++ == 0 && !is_begun;
    frame->is_key = frame->index == key;
    frame->fields |= NPG_FIELD_KEY;
    if (is_first != frame->is_key)
        return npg_error(NPG_FAILED, "frame %lld came %s the keyframe (index %lld) of the solving pass",
                         (long long)frame->index, is_first ? "before" : "again as", (long long)key);
    if (frame->is_key && frame->is_skipped)
        return npg_error(NPG_BAD_INPUT, "%s: the keyframe could be read before but not any more",
                         frame->path ? frame->path : "frame");
    return NPG_OK;
}

/* What comes behind the look-ahead had no part in the box. */
static npg_status pass_frame(npg_worker *worker, npg_frame *frame)
{
    keyframe_state *state = npg_worker_state(worker);
    NPG_TRY(mark_key(worker, frame));
    const npg_facts *facts = npg_worker_facts(worker);
    bool is_behind = facts->is_live && frame->index >= facts->planned_count;
    return is_behind ? npg_outside_watch(worker, &state->outside, frame) : NPG_OK;
}

static npg_status end_live(npg_worker *worker)
{
    const keyframe_state *state = npg_worker_state(worker);
    report_windows(worker);
    npg_outside_tell(worker, &state->outside);
    return NPG_OK;
}

/* ---- the stage ---- */

static npg_status init(npg_worker *worker)
{
    keyframe_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    npg_pass pass = npg_worker_pass(worker);
    int64_t window = npg_plan_window_asked(state->window, INT64_MAX);
    npg_outside_open(&state->outside);
    if (window && state->overlap >= window)
        return npg_error(NPG_USAGE, "option overlap: %lld frames don't fit in windows of %lld",
                         (long long)state->overlap, (long long)window);
    if (pass == NPG_PASS_SOLVE && facts->is_live && facts->is_resumed)
        return npg_outside_restore(&state->outside, npg_job_state(npg_job_of(worker)), facts);
    if (pass == NPG_PASS_MEASURE) {
        *npg_own(worker, bounds_local) = npg_bounds_empty();
        *npg_own(worker, point_count_max) = 0;
        *npg_own(worker, sensor_count_max) = *npg_own(worker, view_count_max) = 0;
        *npg_own(worker, has_normals) = true;
        *npg_own(worker, number_min) = INT64_MAX;
        *npg_own(worker, number_max) = INT64_MIN;
    }
    return NPG_OK;
}

static npg_status process(npg_worker *worker, npg_chunk **chunk)
{
    keyframe_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    npg_pass pass = npg_worker_pass(worker);
    if (pass == NPG_PASS_CHOOSE) return npg_choose_pass_add(&state->choosing, facts, *chunk);
    for (size_t i = 0; i < npg_chunk_count(*chunk); i++) {
        npg_frame *frame = npg_chunk_frame(*chunk, i);
        if (pass == NPG_PASS_MEASURE)
            NPG_TRY(measure_frame(worker, frame));
        else if (pass == NPG_PASS_SCORE)
            NPG_TRY(score_frame(worker, frame));
        else
            NPG_TRY(pass_frame(worker, frame));
    }
    return NPG_OK;
}

static npg_status flush(npg_worker *worker)
{
    switch (npg_worker_pass(worker)) {
    case NPG_PASS_MEASURE: return close_measuring(worker);
    case NPG_PASS_SCORE: return set_plan(worker);
    case NPG_PASS_CHOOSE:
        NPG_TRY(close_choosing(worker));
        npg_worker_step(worker, 1, 1, 1);
        return NPG_OK;
    case NPG_PASS_FUSE: return NPG_OK;
    case NPG_PASS_SOLVE: break;
    }
    return npg_worker_facts(worker)->is_live ? end_live(worker) : NPG_OK;
}

static void uninit(npg_worker *worker)
{
    keyframe_state *state = npg_worker_state(worker);
    npg_outside_close(&state->outside);
    npg_likeness_close(&state->likeness);
    npg_choose_pass_clear(&state->choosing);
    npg_extent_close(&state->extent);
    npg_release(&state->diagonals);
}

/* Of a state on disk: the plan and the box are facts. */
static npg_status save(const npg_worker *worker, npg_store *out, int64_t read)
{
    (void)read;
    keyframe_state *state = npg_worker_state(worker);
    return npg_worker_facts(worker)->is_live ? npg_outside_save(&state->outside, out) : NPG_OK;
}

#define AT(member) offsetof(keyframe_state, member)

/* clang-format off */
static const npg_option options[] = {
    /* type         name               place           default  least most  shown as or words */
    NPG_ROW_INT(    "keyframe",        AT(number),     "-1",    -1, 1e15, NULL,
        "Number of the frame that the reference is made around. As in the file names; -1: chosen, or, with "
        "--reference, the frame that it is nearest to"),
    NPG_KEY(CHOICE, "keyframe-choice", AT(choice),     "judged", "paper|judged",
        "Take the frame with the paper's score (paper), "
        "or the one that shows most surface, unless that of another fares better in the others (judged)"),
    NPG_KEY(INT,    "window",          AT(window),     "24",    -1, 1e6,  NULL,
        "Frames that are solved together; 0: all of them in one window; "
        "-1: so up to 60 frames, and windows of 24 where there are more"),
    NPG_KEY(INT,    "overlap",         AT(overlap),    "4",     0,  1e6,  NULL,
        "Frames that a window shares with its neighbour"),
    NPG_KEY(REAL,   "box-margin",      AT(box_margin), "10",    0,  1000, "PERCENT",
        "Live runs that go on behind the look-ahead: "
        "room left around its box, in per cent of its longest side"),
    {0}};
/* clang-format on */

/* The candidates' normals, which the stage before makes, are counted here. */
static double expects(const npg_worker *worker, npg_pass pass)
{
    const npg_facts *facts = npg_worker_facts(worker);
    if (pass != NPG_PASS_CHOOSE || facts->choice.candidate_count < 2) return 0;
    return npg_cost_choice_s((double)facts->point_count_max, facts->has_normals);
}

const npg_stage npg_stage_keyframe = {.name = "keyframe",
                                      .help = "Find the capture's box and choose the keyframe",
                                      .options = options,
                                      .state_size = sizeof(keyframe_state),
                                      .passes = NPG_PASS_MEASURE | NPG_PASS_SCORE | NPG_PASS_CHOOSE |
                                                NPG_PASS_FUSE | NPG_PASS_SOLVE,
                                      .needs = NPG_FIELD_POINTS,
                                      .gives = NPG_FIELD_KEY,
                                      .init = init,
                                      .process = process,
                                      .flush = flush,
                                      .settle = settle,
                                      .uninit = uninit,
                                      .expects = expects,
                                      .save = save};
