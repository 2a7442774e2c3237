/* Choosing pass: what its frames show, and the candidate to take. */
#include "keyframe/keyframe_internal.h"

#include "pipeline/clock.h"

static bool is_candidate(const npg_choice *choice, int64_t index)
{
    for (size_t i = 0; i < choice->count; i++)
        if (choice->frames[i] == index) return choice->is_candidate[i];
    return false;
}

npg_status npg_choose_pass_add(npg_choose_pass *pass, const npg_facts *facts, npg_chunk *chunk)
{
    if (!pass->clouds) NPG_TRY(npg_candidate_clouds_open(&pass->clouds));
    for (size_t i = 0; i < npg_chunk_count(chunk); i++) {
        const npg_frame *frame = npg_chunk_frame(chunk, i);
        NPG_TRY(npg_candidate_clouds_add(pass->clouds, frame, &facts->box,
                                         is_candidate(&facts->choice, frame->index)));
    }
    return NPG_OK;
}

static void report_candidates(npg_worker *worker, const npg_draft_result *results, size_t count,
                              double seconds)
{
    json_t *list = json_array();
    for (size_t i = 0; i < count; i++)
        json_array_append_new(
            list, json_pack("{sI sb sf sf sf sf sI sf}", "number", (json_int_t)results[i].number, "followed",
                            results[i].is_followed, "point_dist_unit", results[i].point_dist_unit,
                            "vert_dist_unit", results[i].vert_dist_unit, "stretched_share",
                            results[i].stretched_share, "contact", results[i].contact, "handles",
                            (json_int_t)results[i].handles, "cost", results[i].cost));
    json_object_set_new(npg_worker_report(worker), "candidates", list);
    json_object_set_new(npg_worker_report(worker), "choosing_s", json_real(seconds));
}

static npg_status compare(npg_worker *worker, npg_draft_result *result, const npg_candidate_clouds *clouds)
{
    const npg_facts *facts = npg_worker_facts(worker);
    npg_poisson_settings settings = npg_poisson_settings_of(npg_worker_options(worker));
    npg_draft_result results[NPG_CHOICE_MAX];
    size_t count, best;
    double since = npg_clock_s();
    settings.should_stop = npg_worker_should_stop;
    settings.user = worker;
    NPG_TRY(npg_choose(results, &count, &best, clouds, facts->plan.key, facts->frame_count, &settings));
    if (!count) return NPG_OK;
    *result = results[best];
    report_candidates(worker, results, count, npg_clock_s() - since);
    npg_worker_log(worker, NPG_LOG_INFO, result->number,
                   "is the keyframe, of %zu candidates (%.2f %% of its points in contact)", count,
                   100 * result->contact);
    return NPG_OK;
}

npg_status npg_choose_pass_end(npg_choose_pass *pass, npg_worker *worker, npg_draft_result *result)
{
    const npg_choice *choice = &npg_worker_facts(worker)->choice;
    npg_candidate_clouds *clouds = pass->clouds;
    *result = (npg_draft_result){.index = -1};
    if (!clouds) return NPG_OK;
    if (choice->candidate_count > 1) NPG_TRY(compare(worker, result, clouds));
    if (!choice->cut_welds) return NPG_OK;
    pass->clouds = NULL; /* the run's, from here on */
    return npg_worker_publish(worker, &npg_fact_candidate_clouds, clouds);
}

void npg_choose_pass_clear(npg_choose_pass *pass)
{
    npg_candidate_clouds_close(&pass->clouds);
}
