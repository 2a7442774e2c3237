/* reference: the owner of the reference, which alone decides between passes how the next one is walked.
 *
 * No frame is changed here.  The stage sees what frames have (points, sensors, images), watches how the keyframe's
 * surface fares in the frames of the sample while it is tried (judge.c), and after each pass tells the loop
 * (loop.c) what that came to; what the loop decides is the brief of the next.
 *
 * Not in the paper, whose reference is the surface of one frame. */
#include "reference/reference.h"

#include <stdlib.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "outlier/normals.h"
#include "pipeline/options.h"
#include "pipeline/stage.h"
#include "reference/loop.h"

enum { FROM_KEY, FROM_ALL };

typedef struct state {
    int from;                 /* option */
    int64_t rounds, attempts; /* options */
    int64_t usable;           /* frames with points: of the measuring pass */
    npg_judging *judging;     /* of the keyframe that is tried; NULL: it stays in any case */
} state;

#define AT(member) offsetof(state, member)

/* clang-format off */
static const npg_option options[] = {
    /* type         name                place       default least most  shown as or words */
    NPG_KEY(CHOICE, "reference-from",   AT(from),   "all", "key|all",
        "What the reference is made from: the keyframe's points alone, "
        "or those of all frames (of a live source those of the look-ahead), brought to its pose"),
    NPG_KEY(INT,    "reference-rounds", AT(rounds), "1",   1, 20, "N",
        "Times that the points of all frames are gathered with the reference so far"),
    NPG_KEY(INT,    "attempts",         AT(attempts), "1", 0, NPG_ATTEMPTS_MOST, "N",
        "Other keyframes that are tried where frames are below the bar with the one chosen, frames that fail first; "
        "the one with the fewest such frames is kept"),
    {0}};
/* clang-format on */

/* ---- what a pass comes to ---- */

/* How the reference of a keyframe that is tried fares in a frame of the sample, its own first. */
static npg_status judge(npg_worker *worker, int64_t index, const float *vert_unit)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_candidate_clouds *clouds = npg_worker_fact(worker, &npg_fact_candidate_clouds);
    npg_judge_settings settings = {0};
    size_t at = clouds ? npg_candidate_clouds_find(clouds, index) : 0;
    if (!facts->choice.is_tried || !clouds || at == clouds->count) return NPG_OK;
    const npg_candidate_cloud *seen = &clouds->list[at];
    if (index == facts->plan.key) {
        NPG_TRY(npg_cloud_spacing(&settings.spacing_unit, seen->points, seen->point_count));
        NPG_TRY(npg_judging_open(&s->judging, clouds, at, facts->reference, &settings));
    }
    return s->judging ? npg_judging_see(s->judging, seen, vert_unit) : NPG_OK;
}

/* The sample's frames are known before the passes, what frames have after the first. */
static npg_status process(npg_worker *worker, npg_chunk **chunk)
{
    state *s = npg_worker_state(worker);
    for (size_t i = 0; i < npg_chunk_count(*chunk); i++) {
        const npg_frame *frame = npg_chunk_frame(*chunk, i);
        if (npg_worker_pass(worker) == NPG_PASS_MEASURE) {
            s->usable += !frame->is_skipped;
        } else if (npg_worker_pass(worker) == NPG_PASS_FUSE && !frame->is_skipped && frame->point_count) {
            NPG_TRY(judge(worker, frame->index, frame->vert_unit));
        }
        if (npg_worker_stopping(worker)) return NPG_STOPPED;
    }
    return NPG_OK;
}

/* Whether another keyframe could do better than the one that is tried: parts that touch in it are joined, or points
 * are farther from its surface than their own would be. */
static npg_status is_beatable(bool *beatable, npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    int64_t handles;
    *beatable = false;
    if (!s->judging) return NPG_OK;
    const npg_judgement *found = npg_judging_found(s->judging);
    NPG_TRY(npg_mesh_handles(&handles, npg_worker_facts(worker)->reference));
    *beatable = handles > 0 || !npg_judged_least(found);
    json_object_update_new(npg_worker_report(worker),
                           json_pack("{sf sf}", "judged", found->mean, "judged_own", found->own));
    return NPG_OK;
}

/* The keyframe to try next; -1: none, or it is not in question.  Of the sample the frame that fails most clearly: in the
 * middle of the longer stretch that the reference does not explain; without one, nearest to the worst of those below
 * the bar.  Where most frames fail none of them says more than the others, and the second of the choice is next. */
static int64_t find_next(const npg_worker *worker, const npg_pass_result *result)
{
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_candidate_clouds *clouds = npg_worker_fact(worker, &npg_fact_candidate_clouds);
    int64_t before = result->explained_from, behind = facts->planned_count - 1 - result->explained_to;
    int64_t first = before > behind ? 0 : result->explained_to + 1, found = -1;
    int64_t end = before > behind ? before : facts->planned_count, twice = first + end - 1;
    bool is_by_worst = facts->unfit_count && (result->is_side || !result->has_changed);
    if (!clouds || !facts->choice.is_open || (!result->has_changed && !facts->unfit_count)) return -1;
    if ((double)result->bad_count > NPG_MAJORITY * (double)facts->planned_count &&
        npg_reference_is_new(npg_worker_kept(worker), facts->choice.second))
        return facts->choice.second;
    if (is_by_worst) first = 0, end = facts->planned_count, twice = 2 * facts->unfit_worst;
    for (size_t i = 0; i < clouds->count; i++) {
        int64_t index = clouds->list[i].index;
        bool is_in = index >= first && index < end && index != result->key;
        if (is_in && (found < 0 || llabs(2 * index - twice) < llabs(2 * found - twice))) found = index;
    }
    return found;
}

/* A surface with a border, where sensors saw it, is a side of the body. */
static npg_status result_of(npg_pass_result *result, npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    npg_manifold edges;
    int64_t last = facts->planned_count - 1;
    NPG_TRY(npg_mesh_manifold(&edges, facts->reference));
    *result = (npg_pass_result){.key = facts->plan.key,
                                .frame_count = facts->planned_count,
                                .unreached_count = facts->unreached_count,
                                .has_changed = facts->has_changed[0] || facts->has_changed[1],
                                .explained_from = facts->has_changed[1] ? facts->changed_at[1] + 1 : 0,
                                .explained_to = facts->has_changed[0] ? facts->changed_at[0] - 1 : last,
                                .is_side = facts->sensor_count_max && edges.border_edges,
                                .has_images = facts->view_count_max > 0};
    result->has_no_surface = facts->reference_key != facts->plan.key;
    if (result->has_no_surface)
        result->bad_count = facts->planned_count;
    else if (result->is_side)
        result->bad_count = facts->unfit_count + facts->unreached_count;
    else
        result->bad_count = facts->unfit_within + last - result->explained_to + result->explained_from;
    result->next = find_next(worker, result);
    NPG_TRY(is_beatable(&result->is_beatable, worker));
    result->is_beatable |= result->bad_count && facts->choice.is_tried;
    return NPG_OK;
}

/* ---- words ---- */

/* What each keyframe came to, where more than one was tried. */
static void report_attempts(npg_worker *worker, const npg_reference_loop *loop)
{
    const npg_candidate_clouds *clouds = npg_worker_fact(worker, &npg_fact_candidate_clouds);
    json_t *list = json_array();
    for (size_t i = 0; i < loop->tried_count; i++) {
        const npg_pass_result *one = &loop->tried[i];
        size_t at = npg_candidate_clouds_find(clouds, one->key);
        json_array_append_new(list, json_pack("{sI sI sb}", "keyframe", (json_int_t)clouds->list[at].number,
                                              "frames_bad", (json_int_t)one->bad_count, "kept",
                                              loop->is_settled && i == loop->kept));
    }
    json_object_set_new(npg_worker_report(worker), "attempts", list);
    npg_worker_log(worker, NPG_LOG_INFO, -1, "with this keyframe %lld frames are below the bar: %s",
                   (long long)loop->tried[loop->tried_count - 1].bad_count,
                   loop->is_key_back || !loop->now.brief.keeps_gathered ? "the one before is taken back"
                   : loop->now.brief.is_attempt                         ? "another is tried"
                                                                        : "it is kept");
}

static void tell(npg_worker *worker, const npg_reference_loop *loop, const npg_pass_result *result,
                 bool was_open)
{
    const npg_brief *brief = &loop->now.brief;
    bool was_compared =
        result->is_side ? brief->is_attempt || (!brief->rounds_left && !loop->is_key_back) : was_open;
    if (was_compared && (brief->is_attempt || loop->tried_count > 1)) report_attempts(worker, loop);
    if (!brief->is_attempt && !brief->takes_gathered)
        npg_worker_log(worker, NPG_LOG_INFO, -1,
                       "the keyframe's surface does not explain all frames: what others show is left out");
    if (result->unreached_count)
        npg_worker_log(worker, NPG_LOG_INFO, -1,
                       "%lld frames see too much that the reference does not have yet%s",
                       (long long)result->unreached_count,
                       brief->leaves_open ? ": it grows, and they are followed again" : "");
}

/* ---- decisions ---- */

static npg_status begin(npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    npg_reference_loop *loop;
    NPG_TRY(npg_alloc(&loop, NPG_FOR_MESH, sizeof *loop));
    npg_worker_keep(worker, loop, NULL);
    *npg_own(worker, brief) = npg_reference_begin(loop, s->usable > 1 ? s->rounds : 0, (size_t)s->attempts);
    return NPG_OK;
}

/* The keyframe's surface is there, or candidates were compared. */
static npg_status settle_choice(npg_worker *worker, npg_reference_loop *loop)
{
    const npg_facts *facts = npg_worker_facts(worker);
    bool beatable, was_open = !loop->is_settled;
    if (loop->now.brief.compares) {
        *npg_own(worker, brief) = npg_reference_compared(loop, facts->plan.key);
        if (loop->tried_count) tell(worker, loop, &loop->trial, was_open);
        return NPG_OK;
    }
    if (facts->reference) NPG_TRY(judge(worker, facts->plan.key, facts->reference->vert_pos));
    NPG_TRY(is_beatable(&beatable, worker));
    if (beatable) *npg_own(worker, brief) = npg_reference_doubt(loop);
    return NPG_OK;
}

static npg_status settle_pass(npg_worker *worker, npg_reference_loop *loop)
{
    npg_pass_result result;
    bool was_open = !loop->is_settled;
    NPG_TRY(result_of(&result, worker));
    *npg_own(worker, brief) = npg_reference_next(loop, &result);
    json_object_set_new(npg_worker_report(worker), "passes_grown", json_integer((json_int_t)loop->now.grown));
    if (loop->tried_count) tell(worker, loop, &result, was_open);
    if (result.is_side)
        npg_worker_log(worker, NPG_LOG_INFO, -1, "%lld frames are below the bar with the side so far%s",
                       (long long)result.bad_count,
                       loop->is_ending && loop->now.brief.takes_back ? ": it is taken back to a better one"
                                                                     : "");
    return NPG_OK;
}

static npg_status settle(npg_worker *worker)
{
    npg_reference_loop *loop = npg_worker_kept(worker);
    switch (npg_worker_pass(worker)) {
    case NPG_PASS_MEASURE: return begin(worker);
    case NPG_PASS_CHOOSE: return settle_choice(worker, loop);
    default: return settle_pass(worker, loop);
    }
}

static void uninit(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    npg_judging_close(&s->judging);
}

/* Without alignment nothing is known to carry points by. */
static bool takes_part(const npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    return s->from == FROM_ALL && !npg_worker_settings(worker)->reference[0] &&
           npg_worker_has_field(worker, NPG_FIELD_POSE);
}

const npg_stage npg_stage_reference = {.name = "reference",
                                       .help = "decides between passes what the reference is made of",
                                       .options = options,
                                       .state_size = sizeof(state),
                                       .passes = NPG_PASS_MEASURE | NPG_PASS_CHOOSE | NPG_PASS_FUSE,
                                       .takes_part = takes_part,
                                       .process = process,
                                       .settle = settle,
                                       .uninit = uninit};
