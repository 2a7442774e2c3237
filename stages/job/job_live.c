/* Job: the inputs of a live run, which are not known before they come. */
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "ingest/follow.h"
#include "ingest/input_log.h"
#include "job/job.h"
#include "pipeline/file.h"
#include "pipeline/live_plan.h"

npg_status npg_job_begin_inputs(npg_worker *worker, npg_job *job)
{
    npg_input_log *log;
    char *path;
    NPG_TRY(npg_job_inputs_path(job, &path, true));
    npg_status status = npg_input_log_open(&log, path);
    npg_release(&path);
    return status ? status : npg_worker_publish(worker, &npg_fact_input_log, log);
}

npg_status npg_job_fusing_key(const npg_worker *worker, uint64_t *key)
{
    const npg_job *job = npg_job_of(worker);
    npg_input_log *log = npg_worker_fact(worker, &npg_fact_input_log);
    npg_input_place place;
    uint64_t hash;
    char *path;
    NPG_TRY(npg_job_key(job, key));
    if (!log) return NPG_OK;
    npg_input_log_place(log, npg_worker_facts(worker)->planned_count - 1, &place);
    NPG_TRY(npg_job_inputs_path(job, &path, true));
    npg_status status = npg_hash_file(&hash, path, (uint64_t)place.bytes);
    npg_release(&path);
    if (!status) *key ^= hash;
    return status;
}

/* ---- the files of a folder that is followed ---- */

static npg_status open_folder(npg_follow **follow, const npg_worker *worker)
{
    const npg_settings *settings = npg_worker_settings(worker);
    const npg_follow_settings of_folder = {.where = settings->follow,
                                           .confine = settings->confine,
                                           .end_name =
                                               npg_options_get(npg_worker_options(worker), "follow-end.name")};
    return npg_follow_open(follow, &of_folder);
}

/* A file that is gone matters where its points are needed once more. */
static npg_status check_file(const npg_input_entry *entry, const char *path, bool is_needed, size_t *gone)
{
    struct stat info;
    uint64_t hash;
    if (stat(path, &info)) {
        ++*gone;
        if (!is_needed) return NPG_OK;
        return npg_error(NPG_USAGE, "the input %s is missing (frame %lld)", entry->name,
                         (long long)entry->number);
    }
    bool is_same = (int64_t)info.st_size == entry->bytes;
    if (is_same) NPG_TRY(npg_hash_file(&hash, path, UINT64_MAX));
    if (is_same && hash == entry->hash) return NPG_OK;
    return npg_error(NPG_USAGE, "the input %s is not the one it was (frame %lld)", entry->name,
                     (long long)entry->number);
}

static bool holds(const npg_worker *worker)
{
    return !strcmp(npg_options_get(npg_worker_options(worker), "missing"), "hold");
}

/* What could not be used then stays left out, whatever it is now. */
static npg_status check_files(npg_worker *worker, const npg_input_log *log, const npg_follow *follow,
                              size_t *gone)
{
    size_t count;
    const npg_input_entry *entries = npg_input_log_entries(log, &count);
    npg_status status = NPG_OK;
    for (size_t i = 0; i < count && !status; i++) {
        const npg_input_entry *entry = &entries[i];
        char *path;
        if (!entry->name || entry->is_skipped || entry->bytes < 0) continue;
        NPG_TRY(npg_follow_path(follow, &path, entry->name));
        status = check_file(entry, path, npg_input_log_needs(log, i, holds(worker)), gone);
        npg_release(&path);
    }
    return status;
}

static npg_status check_folder(npg_worker *worker, npg_job *job, const npg_input_log *log)
{
    npg_follow *follow;
    size_t gone = 0;
    if (!npg_worker_settings(worker)->follow[0]) return NPG_OK;
    NPG_TRY(open_folder(&follow, worker));
    npg_status status = check_files(worker, log, follow, &gone);
    npg_follow_close(&follow);
    if (status == NPG_USAGE) return npg_job_differs(job);
    if (!status && gone)
        npg_worker_warn(worker, false, -1,
                        "%zu files of frames that are solved are gone: whether they are those of then can't "
                        "be compared",
                        gone);
    return status;
}

/* ---- resuming ---- */

static void mark_solved(const npg_facts *facts, const npg_input_log *log)
{
    size_t count;
    npg_input_entry *entries = npg_input_log_entries(log, &count);
    for (size_t i = 0; i < count; i++)
        entries[i].is_solved =
            entries[i].index < 0 ||
            npg_live_is_read(&facts->plan, entries[i].index, facts->resumed_read, facts->frame_count);
}

static int64_t wanted_number(const npg_input_log *log, bool with_held)
{
    size_t count;
    const npg_input_entry *entries = npg_input_log_entries(log, &count);
    for (size_t i = 0; i < count; i++)
        if (npg_input_log_needs(log, i, with_held)) return entries[i].number;
    return count ? entries[count - 1].number + 1 : INT64_MIN;
}

npg_status npg_job_resume_inputs(npg_worker *worker, npg_job *job)
{
    const npg_facts *facts = npg_worker_facts(worker);
    npg_input_place place;
    npg_input_log *log;
    char *path;
    NPG_TRY(npg_record_get(npg_job_state(job), NPG_BLOCK_INPUTS, &place, sizeof place));
    NPG_TRY(npg_job_inputs_path(job, &path, false));
    npg_status status = npg_input_log_resume(&log, path, &place);
    npg_release(&path);
    NPG_TRY(status);
    NPG_TRY(npg_worker_publish(worker, &npg_fact_input_log, log));
    mark_solved(facts, log);
    if (npg_job_source_of(npg_worker_settings(worker)) == NPG_JOB_PUSH)
        *npg_own(worker, wanted_number) = wanted_number(log, holds(worker));
    return check_folder(worker, job, log);
}

/* ---- a run that is done ---- */

/* The file that was taken last has its entry last but for frames that are missing. */
static npg_status count_new(npg_worker *worker, const npg_input_log *log, size_t *fresh)
{
    size_t count, taken = 0;
    const npg_input_entry *entries = npg_input_log_entries(log, &count), *last = NULL;
    npg_follow *follow;
    *fresh = 0;
    for (size_t i = 0; i < count; i++) {
        if (entries[i].name) last = &entries[i];
        taken += entries[i].name != NULL;
    }
    if (!last) return NPG_OK;
    const npg_follow_place place = {last->name, (size_t)last->digits, last->number, 0, taken};
    NPG_TRY(open_folder(&follow, worker));
    npg_status status = npg_follow_resume(follow, &place);
    if (!status) status = npg_follow_count_new(follow, fresh);
    npg_follow_close(&follow);
    return status;
}

static npg_status read_whole_log(npg_input_log **log, const npg_job *job)
{
    struct stat info;
    char *path;
    NPG_TRY(npg_job_inputs_path(job, &path, false));
    npg_status status = stat(path, &info) ? npg_error(NPG_USAGE, "%s is missing", path)
                                          : npg_input_log_read(log, path, (int64_t)info.st_size);
    npg_release(&path);
    return status;
}

npg_status npg_job_check_inputs(npg_worker *worker, npg_job *job)
{
    npg_input_log *log = NULL;
    size_t fresh, count;
    npg_status status = read_whole_log(&log, job);
    if (status) return status == NPG_USAGE || status == NPG_BAD_INPUT ? npg_job_differs(job) : status;
    npg_input_entry *entries = npg_input_log_entries(log, &count);
    for (size_t i = 0; i < count; i++) entries[i].is_solved = true;
    status = check_folder(worker, job, log);
    if (!status) status = count_new(worker, log, &fresh);
    npg_input_log_close(&log);
    if (!status && fresh)
        status = npg_error(NPG_USAGE,
                           "%s is done, but %zu files came since: --restart starts over, "
                           "another output folder begins a new run",
                           npg_worker_settings(worker)->output, fresh);
    return status;
}
