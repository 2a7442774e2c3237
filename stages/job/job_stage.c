/* job: before anything else, finds out whether an earlier run of the same job can be gone on from;
 * takes part in no pass. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "export/export.h"
#include "optimize/checkpoint.h"
#include "pipeline/file.h"

typedef struct job_state {
    bool restart, append;
} job_state;

#define AT(member) offsetof(job_state, member)

/* clang-format off */
static const npg_option options[] = {
    /* type      name       place        default */
    NPG_ROW_FLAG("restart", AT(restart), "no",
        "Discard what an earlier run left in the output folder; "
        "without it a run of the same job goes on where that one was"),
    NPG_ROW_FLAG("append",  AT(append),  "no",
        "Go on with frames that came since the job was done (neupig append)"),
    {0}};
/* clang-format on */

static void release_job(void *thing)
{
    npg_job *job = thing;
    npg_job_close(&job);
}

/* ---- going on ---- */

static void tell_place(npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    int64_t count, bytes;
    npg_job_exported(facts->job, &count, &bytes);
    npg_worker_log(worker, NPG_LOG_INFO, -1,
                   "goes on where an earlier run was: %lld of %lld frames are solved and %lld written",
                   (long long)(facts->plan.appended_at + facts->resumed_read), (long long)facts->frame_count,
                   (long long)count);
    json_object_set_new(npg_worker_report(worker), "resumed_frames",
                        json_integer((json_int_t)(facts->plan.appended_at + facts->resumed_read)));
}

/* Where a capture was one joint window, the frames that follow get windows as long, or as the options say. */
static void widen_plan(npg_worker *worker, npg_plan *plan)
{
    const npg_options *given = npg_worker_options(worker);
    int64_t window = strtoll(npg_options_get(given, "window"), NULL, 10);
    int64_t overlap = strtoll(npg_options_get(given, "overlap"), NULL, 10);
    if (plan->window < plan->frame_count) return;
    if (window > plan->window) plan->window = window;
    plan->overlap = overlap < plan->frame_count ? overlap : plan->frame_count - 1;
    if (plan->overlap >= plan->window) plan->overlap = plan->window - 1;
}

static npg_status remove_done(npg_worker *worker)
{
    char *path;
    NPG_TRY(npg_join_path(&path, npg_worker_settings(worker)->output, "done.json"));
    npg_status status = NPG_OK;
    if (unlink(path) && errno != ENOENT) status = npg_error_errno(NPG_DISK, "can't remove %s", path);
    npg_release(&path);
    return status;
}

/* Each step can be broken off and done again: job.json first says that there are more frames. */
static npg_status begin_append(npg_worker *worker, int64_t frame_count)
{
    npg_facts *facts = npg_worker_facts(worker);
    int64_t lines, bytes;
    NPG_TRY(npg_job_open_forward(facts->job));
    NPG_TRY(npg_checkpoint_restore_facts(worker));
    npg_plan plan = facts->plan;
    widen_plan(worker, &plan);
    facts->plan = npg_plan_append(&plan, frame_count);
    facts->frame_count = frame_count;
    facts->resumed_read = 0;
    NPG_TRY(npg_job_extend(facts->job));
    NPG_TRY(remove_done(worker));
    NPG_TRY(npg_frame_log_go_back(npg_worker_settings(worker)->output, npg_plan_window(&facts->plan, 0).first,
                                  &lines, &bytes));
    npg_job_note_exported(facts->job, lines, bytes);
    return NPG_OK;
}

static npg_status begin(npg_worker *worker)
{
    const job_state *state = npg_worker_state(worker);
    npg_facts *facts = npg_worker_facts(worker);
    const npg_settings *settings = npg_worker_settings(worker);
    npg_job_start start;
    npg_job *job;
    if (facts->is_live || !settings->output[0] || settings->pull) return NPG_OK;
    NPG_TRY(npg_job_open(&job, &start, worker, state->restart, state->append));
    npg_worker_keep(worker, job, release_job);
    facts->job = job;
    switch (start) {
    case NPG_JOB_FRESH: return NPG_OK;
    case NPG_JOB_DONE:
        npg_worker_log(worker, NPG_LOG_INFO, -1, "%s is done already: nothing is left to do",
                       settings->output);
        return NPG_END;
    case NPG_JOB_RESUME: NPG_TRY(npg_checkpoint_restore_facts(worker)); break;
    case NPG_JOB_APPEND: NPG_TRY(begin_append(worker, npg_job_frame_count(job))); break;
    }
    tell_place(worker);
    return NPG_OK;
}

extern const npg_stage npg_stage_job;
const npg_stage npg_stage_job = {.name = "job",
                                 .help = "goes on where an earlier run of the same job was",
                                 .options = options,
                                 .state_size = sizeof(job_state),
                                 .begin = begin};
