/* Job: a state to the job's folder, and the facts of the run back. */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "ingest/ingest.h"
#include "job/job_internal.h"
#include "pipeline/file.h"

/* ---- saving ---- */

static npg_status put_reports(npg_store *out, npg_worker *worker)
{
    json_t *reports = npg_worker_save_reports(worker);
    char *text = reports ? json_dumps(reports, JSON_COMPACT) : NULL;
    json_decref(reports);
    if (!text) return npg_error(NPG_MEMORY, "no memory for the report");
    npg_status status = npg_store_put(out, "reports", text, strlen(text) + 1);
    free(text);
    return status;
}

static npg_status put_facts(npg_store *out, npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    npg_facts plain;
    size_t tail = offsetof(npg_facts, point_count_max);
    memset(&plain, 0, sizeof plain);
    /* with its padding: the same bytes every time */
    memcpy(&plain, facts, offsetof(npg_facts, frame_count));
    memcpy((char *)&plain + tail, (const char *)facts + tail, sizeof plain - tail);
    plain.frame_count = facts->frame_count; /* stage ingest may be about to write it, and skipped_count */
    if (!facts->is_live) plain.skipped_count = facts->skipped_count;
    plain.reference = NULL;
    plain.is_resumed = false;
    plain.resumed_read = 0;
    NPG_TRY(npg_store_put(out, "planned", &facts->plan.frame_count, sizeof(int64_t)));
    NPG_TRY(npg_store_put(out, "facts", &plain, sizeof plain));
    NPG_TRY(put_reports(out, worker));
    return npg_state_put_mesh(out, facts->reference);
}

/* The frame log goes with the state: it has to be on disk before. */
static npg_status put_log(npg_store *out, const npg_worker *worker, int64_t emitted)
{
    npg_job_log log = {.count = emitted};
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, npg_worker_settings(worker)->output, NPG_FRAME_LOG_NAME));
    NPG_TRY(npg_job_wait_exported(npg_job_of(worker), emitted, &log.bytes));
    int fd = open(path, O_RDWR | O_CLOEXEC);
    npg_status status = NPG_OK;
    if (fd < 0 || fdatasync(fd)) status = npg_error_errno(NPG_DISK, "can't sync %s", path);
    if (fd >= 0) close(fd);
    NPG_TRY(status);
    NPG_TRY(npg_hash_file(&log.hash, path, (uint64_t)log.bytes));
    return npg_store_put(out, "log", &log, sizeof log);
}

/* So do the frames of a live source. */
static npg_status put_frames(npg_store *out, const npg_worker *worker)
{
    npg_store *frames = npg_job_of(worker)->frames;
    if (!frames) return NPG_OK;
    const int64_t count = npg_spool_count(frames);
    NPG_TRY(npg_store_sync(frames));
    return npg_store_put(out, NPG_BLOCK_FRAMES, &count, sizeof count);
}

static npg_status put_all(npg_store *out, npg_worker *worker, const npg_job_moment *moment)
{
    const npg_job *job = npg_job_of(worker);
    int64_t forward = moment->is_forward_end ? job->serial + 1 : job->forward_serial;
    NPG_TRY(put_log(out, worker, moment->emitted));
    NPG_TRY(put_frames(out, worker));
    NPG_TRY(npg_store_put(out, "forward", &forward, sizeof forward));
    NPG_TRY(npg_store_put(out, "read", &moment->read, sizeof moment->read));
    NPG_TRY(put_facts(out, worker));
    /* the stages behind have no frame in hand: those passed on before are on disk
     * (put_log), no other followed */
    return npg_worker_save_stages(worker, out, moment->read);
}

npg_status npg_job_save_state(npg_worker *worker, const npg_job_moment *moment, npg_job_write_state *write,
                              void *user)
{
    npg_job *job = npg_job_of(worker);
    char name[64], grids[NPG_PATH_SIZE];
    snprintf(name, sizeof name, NPG_GRIDS_NAME, (long long)job->serial + 1);
    NPG_TRY(npg_path_of(grids, job->folder, name));
    npg_store_begin(job->store, moment->is_inside ? NPG_RECORD_INSIDE : NPG_RECORD_STATE,
                    job->serial + !moment->is_inside, 0);
    npg_status status = put_all(job->store, worker, moment);
    if (!status) status = write(user, job->store, moment->is_inside ? NULL : grids);
    NPG_TRY(npg_store_end(job->store, status, true));
    return npg_job_commit(job, moment);
}

/* ---- restoring ---- */

static npg_status get_reports(npg_worker *worker, const npg_record *in)
{
    size_t size;
    const char *text = npg_record_find(in, "reports", &size);
    json_t *reports = text && size ? json_loadb(text, size - 1, 0, NULL) : NULL;
    if (!reports) return npg_error(NPG_BAD_INPUT, "the report so far is missing");
    npg_worker_restore_reports(worker, reports);
    json_decref(reports);
    return NPG_OK;
}

npg_status npg_job_restore_facts(npg_worker *worker, npg_job *job)
{
    npg_facts restored;
    const npg_record *in = job->state;
    int64_t read;
    npg_job_log log;
    NPG_TRY(npg_record_get(in, "facts", &restored, sizeof restored));
    NPG_TRY(npg_record_get(in, "read", &read, sizeof read));
    NPG_TRY(npg_record_get(in, "log", &log, sizeof log));
    NPG_TRY(get_reports(worker, in));
    NPG_TRY(npg_state_get_mesh(&restored.reference, in));
    restored.is_resumed = true;
    restored.resumed_read = read;
    NPG_TRY(npg_worker_restore_facts(worker, &restored)); /* the run owns the reference now */
    npg_job_set_exported(job, log.count, log.bytes);
    return NPG_OK;
}
