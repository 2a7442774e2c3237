/* Candidates: which frames the choosing pass reads, and whose surface carries the capture best. */
#include "keyframe/keyframe_internal.h"

#include <math.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "mesh/surface.h"
#include "pipeline/clock.h"
#include "pipeline/parallel.h"
#include "reference/reference.h"

#define SAMPLE_LEAST 24 /* frames: with fewer none is left out */
#define STRIDE_MOST  3  /* frames: the tracker must find from one to the next */

/* ---- which frames ---- */

/* The place in the choice of the frame in the fewest pieces, of those nearer to `at` than to what is tried beside it;
 * of several the nearest. */
static size_t least_cut(const npg_choice *choice, const uint8_t *pieces, size_t at)
{
    size_t best = at;
    for (size_t away = 1; away <= choice->count / (2 * NPG_CHOICE_MAX); away++)
        for (int side = 0; side < 2; side++) {
            size_t i = side ? at + away : at - away; /* below 0 it wraps */
            if (i < choice->count && pieces[choice->frames[i]] < pieces[choice->frames[best]]) best = i;
        }
    return best;
}

bool npg_candidates_is_whole(const npg_choice *choice, const uint8_t *pieces, int64_t index)
{
    bool is_whole = true;
    for (size_t i = 0; i < choice->count; i++) is_whole &= pieces[choice->frames[i]] >= pieces[index];
    return is_whole;
}

void npg_candidates_list(npg_choice *choice, int64_t key, int64_t frame_count, const uint8_t *pieces,
                         bool key_alone)
{
    int64_t stride = (frame_count + SAMPLE_LEAST - 1) / SAMPLE_LEAST;
    if (stride > STRIDE_MOST) stride = STRIDE_MOST;
    int64_t side = NPG_CHOICE_FRAMES / 2 * stride, first = key % stride;
    if (key - side > first) first = key - side;
    *choice = (npg_choice){.is_open = choice->is_open, .second = -1};
    for (int64_t i = first; i < frame_count && choice->count < NPG_CHOICE_FRAMES; i += stride) {
        choice->is_candidate[choice->count] = i == key;
        choice->frames[choice->count++] = i;
    }
    choice->candidate_count = 1;
    for (size_t i = 1; i < NPG_CHOICE_MAX && !key_alone; i++) {
        size_t at = (i * (choice->count - 1) + NPG_CHOICE_MAX / 2) / NPG_CHOICE_MAX;
        at = least_cut(choice, pieces, at);
        choice->candidate_count += !choice->is_candidate[at];
        choice->is_candidate[at] = true;
    }
}

/* ---- the choice ---- */

typedef struct choosing {
    const npg_candidate_clouds *clouds;
    const npg_poisson_settings *settings;
    npg_judge_settings judging;
    npg_candidate *list;
    size_t count;
} choosing;

static npg_status try_one(const choosing *c, npg_candidate *one)
{
    const npg_candidate_cloud *cloud = &c->clouds->list[one->at];
    npg_mesh *draft;
    NPG_TRY(npg_mesh_draft(&draft, cloud->fit, cloud->fit_normals, cloud->fit_count, c->judging.spacing_unit,
                           cloud->sensor_count > 0, c->settings));
    npg_status status = npg_mesh_handles(&one->handles, draft);
    if (!status)
        status = npg_mesh_unseen(&one->unseen_share, draft, cloud->fit, cloud->fit_count,
                                 NPG_SAMPLED * c->judging.spacing_unit);
    if (!status) status = npg_mesh_count_components(&one->pieces, draft);
    if (!status) status = npg_judge(&one->judgement, c->clouds, one->at, draft, &c->judging);
    one->is_followed = !status;
    npg_mesh_unref(&draft);
    return status;
}

static npg_status try_part(void *user, size_t part)
{
    const choosing *c = user;
    npg_candidate *one = &c->list[part];
    npg_status status = try_one(c, one);
    if (npg_mesh_is_none(status)) return NPG_OK;
    return npg_error_prefix(status, "frame %lld as a keyframe", (long long)one->number);
}

static void list_candidates(choosing *c)
{
    for (size_t i = 0; i < c->clouds->count && c->count < NPG_CHOICE_MAX; i++) {
        const npg_candidate_cloud *cloud = &c->clouds->list[i];
        if (cloud->is_candidate && cloud->normals)
            c->list[c->count++] = (npg_candidate){.at = i, .index = cloud->index, .number = cloud->number};
    }
}

/* Of those that could be followed, but for list[but], the one of the least figure; count: there is none. */
static size_t least_but(const npg_candidate *list, size_t count, size_t but)
{
    size_t least = count;
    for (size_t i = 0; i < count; i++)
        if (i != but && list[i].is_followed &&
            (least == count || list[i].judgement.mean < list[least].judgement.mean))
            least = i;
    return least;
}

/* Whether the frame by score gives way: to what is better clearly, or beyond chance.  One of them is enough: a candidate
 * does well near itself and badly far off, so the differences of two scatter whichever is better.  The figure of a side
 * says most of all what it lacks yet, and its reference grows: there "clearly" says nothing. */
static bool gives_way(const npg_candidate *scored, const npg_candidate *least, bool is_side)
{
    return !scored->is_followed || npg_judged_worse(&scored->judgement, &least->judgement) ||
           (!is_side && npg_judged_clearly(&least->judgement, &scored->judgement));
}

/* Parts that touch in one frame are joined in its surface, which is a handle more, and what a hole cuts off is a piece
 * more. */
static int64_t flaws(const npg_candidate *one)
{
    return one->handles + (int64_t)one->pieces;
}

/* Of those that points can't tell apart the one of fewest flaws; a side is cut by what stands before it. */
size_t npg_candidates_best(const npg_candidate *list, size_t count, size_t scored, bool is_side)
{
    size_t least = least_but(list, count, count), first = scored < count ? scored : 0;
    if (least < count && !is_side && list[first].is_followed && list[first].unseen_share > NPG_FEW)
        return first;
    if (least == count || !gives_way(&list[first], &list[least], is_side)) least = first;
    size_t best = least;
    for (size_t i = 0; i < count && list[least].is_followed && !is_side; i++) {
        const npg_candidate *one = &list[i], *so_far = &list[best];
        bool is_as_good = one->is_followed && !npg_judged_worse(&one->judgement, &list[least].judgement);
        bool is_nearer =
            best != least && flaws(one) == flaws(so_far) && one->judgement.mean < so_far->judgement.mean;
        if (is_as_good && (flaws(one) < flaws(so_far) || is_nearer)) best = i;
    }
    return best;
}

npg_status npg_candidates_try(npg_candidate list[NPG_CHOICE_MAX], size_t *count, size_t *best,
                              const npg_candidate_clouds *clouds, int64_t scored,
                              const npg_poisson_settings *settings)
{
    choosing c = {.clouds = clouds,
                  .settings = settings,
                  .judging = {.should_stop = settings->should_stop, .user = settings->user},
                  .list = list};
    const npg_candidate_cloud *middle = &clouds->list[clouds->count / 2];
    NPG_TRY(npg_cloud_spacing(&c.judging.spacing_unit, middle->points, middle->point_count));
    list_candidates(&c);
    npg_status status = npg_parallel(try_part, &c, c.count);
    size_t at = 0;
    while (at < c.count && list[at].index != scored) at++;
    *count = c.count;
    *best = npg_candidates_best(list, c.count, at, npg_judge_is_by_images(middle));
    return status;
}

/* ---- the pass ---- */

npg_status npg_choose_pass_add(npg_choose_pass *pass, const npg_facts *facts, npg_chunk *chunk)
{
    if (!pass->clouds) NPG_TRY(npg_candidate_clouds_open(&pass->clouds));
    for (size_t i = 0; i < npg_chunk_count(chunk); i++) {
        npg_frame *frame = npg_chunk_frame(chunk, i);
        frame->is_key = facts->choice.is_tried && frame->index == facts->plan.key;
        NPG_TRY(npg_candidate_clouds_add(pass->clouds, frame, &facts->box,
                                         npg_choice_is_candidate(&facts->choice, frame->index)));
    }
    return NPG_OK;
}

static void report_candidates(npg_worker *worker, const npg_candidate *list, size_t count, double seconds)
{
    json_t *of = json_array();
    for (size_t i = 0; i < count; i++)
        json_array_append_new(
            of, json_pack("{sI sb so sI sI sI sf}", "number", (json_int_t)list[i].number, "followed",
                          list[i].is_followed, "judged",
                          npg_json_real(list[i].is_followed ? list[i].judgement.mean : (double)NAN), "frames",
                          (json_int_t)list[i].judgement.count, "handles", (json_int_t)list[i].handles,
                          "pieces", (json_int_t)list[i].pieces, "unseen_share", list[i].unseen_share));
    json_object_set_new(npg_worker_report(worker), "candidates", of);
    json_object_set_new(npg_worker_report(worker), "choosing_s", json_real(seconds));
}

static npg_status compare(npg_worker *worker, npg_candidate *chosen, const npg_candidate_clouds *clouds)
{
    const npg_facts *facts = npg_worker_facts(worker);
    npg_poisson_settings settings = npg_poisson_settings_of(npg_worker_options(worker));
    npg_candidate list[NPG_CHOICE_MAX];
    size_t count, best;
    double since = npg_clock_s();
    settings.should_stop = npg_worker_should_stop;
    settings.user = worker;
    NPG_TRY(npg_candidates_try(list, &count, &best, clouds, facts->plan.key, &settings));
    if (!count) return NPG_OK;
    *chosen = list[best];
    size_t second = least_but(list, count, best);
    if (second < count) npg_own(worker, choice)->second = list[second].index;
    /* Of sides the one by score shows most. */
    if (npg_judge_is_by_images(&clouds->list[chosen->at]) && chosen->index != facts->plan.key)
        npg_own(worker, choice)->second = facts->plan.key;
    report_candidates(worker, list, count, npg_clock_s() - since);
    npg_worker_log(worker, NPG_LOG_INFO, chosen->number, "is the keyframe, of %zu candidates (judged %.3f)",
                   count, chosen->judgement.mean);
    return NPG_OK;
}

npg_status npg_choose_pass_end(npg_choose_pass *pass, npg_worker *worker, npg_candidate *chosen)
{
    npg_candidate_clouds *clouds = pass->clouds;
    *chosen = (npg_candidate){.index = -1};
    if (!clouds || !clouds->count) return NPG_OK;
    if (npg_worker_facts(worker)->choice.candidate_count > 1) NPG_TRY(compare(worker, chosen, clouds));
    pass->clouds = NULL; /* the run's, from here on */
    npg_candidate_clouds *before = npg_worker_take_fact(worker, &npg_fact_candidate_clouds);
    npg_candidate_clouds_close(&before);
    return npg_worker_publish(worker, &npg_fact_candidate_clouds, clouds);
}

void npg_choose_pass_clear(npg_choose_pass *pass)
{
    npg_candidate_clouds_close(&pass->clouds);
}
