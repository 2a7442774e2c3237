/* job: the stage that, before anything else, finds out whether an earlier run of the same
 * job can be resumed. */
#include "job/job_internal.h"

#include <stdio.h>

#include "ingest/ingest.h"
#include "pipeline/file.h"

typedef struct job_state {
    bool restart, append;
} job_state;

#define AT(member) offsetof(job_state, member)

/* clang-format off */
static const npg_option options[] = {
    /* type               name       place        default */
    NPG_ROW_FLAG(         "restart", AT(restart), "no",
        "Forget what an earlier run of this job left. Without it a run of the same job goes on where that "
        "one was"),
    NPG_PROGRAM_ROW(FLAG, "append",  AT(append),  "no",
        "Go on with frames that came since the job was done (neupig append)"),
    {0}};
/* clang-format on */

npg_status npg_job_fusing_key(const npg_worker *worker, uint64_t *key)
{
    const npg_job *job = npg_job_of(worker);
    uint64_t frames = 0;
    NPG_TRY(npg_job_key(job, key));
    if (job->frames) NPG_TRY(npg_spool_key(job->frames, npg_worker_facts(worker)->planned_count, &frames));
    *key ^= frames;
    return NPG_OK;
}

static void release_job(void *value)
{
    npg_job *job = value;
    npg_job_close(&job);
}

static const npg_fact_kind job_fact = {"job", "job", release_job};

npg_job *npg_job_of(const npg_worker *worker)
{
    return npg_worker_fact(worker, &job_fact);
}

/* ---- resuming ---- */

static void report_place(npg_worker *worker, npg_job *job)
{
    const npg_facts *facts = npg_worker_facts(worker);
    int64_t count, bytes, solved = facts->plan.appended_at + facts->resumed_read;
    char of_all[32] = "";
    npg_job_exported(job, &count, &bytes);
    if (facts->frame_count >= 0) snprintf(of_all, sizeof of_all, "of %lld ", (long long)facts->frame_count);
    npg_worker_log(worker, NPG_LOG_INFO, -1,
                   "resumes an earlier run: %lld %sframes are solved and %lld written", (long long)solved,
                   of_all, (long long)count);
    json_object_set_new(npg_worker_report(worker), "resumed_frames", json_integer((json_int_t)solved));
}

/* Where a capture was one joint window, the frames that follow get windows as long, or as the options say. */
static void widen_plan(npg_plan *plan, int64_t window_asked, int64_t overlap_asked)
{
    if (plan->window < plan->frame_count) return;
    if (window_asked > plan->window) plan->window = window_asked;
    plan->overlap = overlap_asked < plan->frame_count ? overlap_asked : plan->frame_count - 1;
    if (plan->overlap >= plan->window) plan->overlap = plan->window - 1;
}

/* Each step can be broken off and done again: job.json first says that there are more frames. */
static npg_status begin_append(npg_worker *worker, npg_job *job)
{
    const npg_facts *facts = npg_worker_facts(worker);
    int64_t lines, bytes, frame_count = job->frame_count;
    NPG_TRY(npg_job_open_forward(job));
    NPG_TRY(npg_job_restore_facts(worker, job));
    npg_plan plan = facts->plan;
    widen_plan(&plan, facts->window_asked, facts->overlap_asked);
    *npg_own(worker, plan) = npg_plan_append(&plan, frame_count);
    *npg_own(worker, frame_count) = frame_count;
    *npg_own(worker, resumed_read) = 0;
    NPG_TRY(npg_job_extend(job));
    NPG_TRY(npg_file_remove(npg_worker_settings(worker)->output, "done.json"));
    NPG_TRY(npg_frame_log_shorten(npg_worker_settings(worker)->output,
                                  npg_plan_window(&facts->plan, 0, -1).first, &lines, &bytes));
    npg_job_set_exported(job, lines, bytes);
    return NPG_OK;
}

/* All that was pushed is kept. */
static npg_status want_next(npg_worker *worker, npg_store *frames)
{
    npg_spooled last;
    if (!npg_spool_count(frames)) return NPG_OK;
    NPG_TRY(npg_spool_get(frames, npg_spool_count(frames) - 1, &last, NULL));
    *npg_own(worker, wanted_number) = last.number + 1;
    return NPG_OK;
}

static npg_status begin(npg_worker *worker)
{
    const job_state *state = npg_worker_state(worker);
    const npg_settings *settings = npg_worker_settings(worker);
    const bool is_live = npg_worker_facts(worker)->is_live;
    npg_job_start start;
    npg_job *job;
    if (!settings->output[0] || settings->pull) return NPG_OK;
    if (is_live && state->append)
        return npg_error(NPG_USAGE, "frames can be appended to a job of files, not to one of a live source");
    NPG_TRY(npg_job_open(&job, &start, worker, state->restart, state->append));
    NPG_TRY(npg_worker_publish(worker, &job_fact, job));
    NPG_TRY(npg_job_publish_hashes(worker, job));
    if (is_live) NPG_TRY(npg_worker_publish(worker, &npg_fact_spool, job->frames));
    switch (start) {
    case NPG_JOB_FRESH: return NPG_OK;
    case NPG_JOB_DONE:
        if (is_live) NPG_TRY(npg_live_check_done(worker, job->frames));
        npg_worker_log(worker, NPG_LOG_INFO, -1, "%s is done already: nothing is left to do",
                       settings->output);
        return NPG_END;
    case NPG_JOB_RESUME:
        NPG_TRY(npg_job_restore_facts(worker, job));
        if (npg_job_source_of(settings) == NPG_JOB_PUSH) NPG_TRY(want_next(worker, job->frames));
        break;
    case NPG_JOB_APPEND: NPG_TRY(begin_append(worker, job)); break;
    }
    report_place(worker, job);
    return NPG_OK;
}

const npg_stage npg_stage_job = {.name = "job",
                                 .help = "resumes an earlier run of the same job",
                                 .options = options,
                                 .state_size = sizeof(job_state),
                                 .begin = begin};
