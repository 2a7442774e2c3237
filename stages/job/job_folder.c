/* Job: the folder OUT/job, its lock and its states. */
#include "job/job_internal.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "ingest/ingest.h"
#include "pipeline/file.h"

#define STORE_NAME  "store.npg"
#define STORE_NEW   "store.new"
#define FRAMES_NAME "frames.npg"
#define FRAMES_NEW  "frames.new"

/* ---- files ---- */

/* The two newest states stay, and the one that later frames start from. */
static bool is_kept(const npg_job *job, int64_t serial)
{
    return serial >= 0 &&
           (serial == job->serial || serial == job->serial - 1 || serial == job->forward_serial);
}

/* Grids of states that went, unless they are kept for all, and grids that were not finished. */
static bool is_stale(const npg_job *job, const char *name)
{
    bool is_hidden = name[0] == '.';
    long long serial;
    name += is_hidden;
    if (sscanf(name, "window_%lld.", &serial) != 1) return false;
    return is_hidden || !strstr(name, ".vdb") || !(job->keeps_grids || is_kept(job, serial));
}

static npg_status remove_stale(void *user, const char *name)
{
    const npg_job *job = user;
    return is_stale(job, name) ? npg_file_remove(job->folder, name) : NPG_OK;
}

/* ---- the lock ---- */

static npg_status take_lock(npg_job *job)
{
    npg_status status = npg_file_lock(&job->lock_fd, job->folder, "lock", false);
    if (status != NPG_USAGE) return status;
    return npg_error(NPG_USAGE,
                     "another run is at work on %s: "
                     "wait for its end, or choose another output folder",
                     job->output);
}

/* ---- what is there ---- */

/* Whether the earlier run ended well, and how. */
static npg_status look_for_end(const npg_job *job, bool *is_done, bool *was_partial)
{
    json_t *done;
    npg_verified files = {.struct_size = sizeof files};
    *is_done = *was_partial = false;
    NPG_TRY(npg_json_load(&done, job->output, "done.json", NPG_USAGE));
    if (!done) return NPG_OK;
    size_t frames = json_array_size(json_object_get(job->then, "frames"));
    *is_done = job->source || json_integer_value(json_object_get(done, "frames")) == (json_int_t)frames;
    *was_partial = json_integer_value(json_object_get(done, "exit_code")) == 7;
    json_decref(done);
    npg_status status = *is_done ? npg_verify(&files, job->output, NULL, NULL) : NPG_OK;
    return status == NPG_BAD_INPUT ? npg_error_set(NPG_USAGE, npg_error_text()) : status;
}

/* ---- the store ---- */

static npg_status open_store(npg_store **store, const npg_job *job, const char *name)
{
    char path[NPG_PATH_SIZE];
    npg_store_close(store);
    NPG_TRY(npg_path_of(path, job->folder, name));
    return npg_store_open(store, path);
}

static npg_status rename_store(npg_store *store, const npg_job *job, const char *name)
{
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, job->folder, name));
    return npg_store_rename(store, path);
}

npg_store *npg_job_store(const npg_job *job)
{
    return job->store;
}

void npg_job_keep_poses(npg_job *job, uint64_t of)
{
    job->poses_of = of;
}

static bool is_needed(const npg_record_id *id, const void *user)
{
    const npg_job *job = user;
    if (!strcmp(id->kind, NPG_RECORD_STATE)) return is_kept(job, id->index);
    if (!strcmp(id->kind, NPG_RECORD_INSIDE)) return id->index == job->serial;
    return !strcmp(id->kind, NPG_RECORD_POSE) && id->of == job->poses_of;
}

/* ---- reading states ---- */

static npg_status check_log(const npg_job *job, const npg_record *record)
{
    npg_job_log log;
    int64_t planned;
    uint64_t now;
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_record_get(record, "planned", &planned, sizeof planned));
    /* frames are being appended: the log is made anew from that of the frames done */
    if (planned < (int64_t)json_array_size(json_object_get(job->then, "frames"))) return NPG_OK;
    NPG_TRY(npg_record_get(record, "log", &log, sizeof log));
    NPG_TRY(npg_path_of(path, job->output, NPG_FRAME_LOG_NAME));
    NPG_TRY(npg_hash_file(&now, path, (uint64_t)log.bytes));
    return now == log.hash ? NPG_OK : npg_error(NPG_BAD_INPUT, "%s was changed since it was written", path);
}

/* Of a live source: what had come is there. */
static npg_status check_frames(const npg_job *job, const npg_record *record)
{
    int64_t count;
    if (!job->source) return NPG_OK;
    NPG_TRY(npg_record_get(record, NPG_BLOCK_FRAMES, &count, sizeof count));
    if (npg_spool_count(job->frames) >= count) return NPG_OK;
    const char *damage = npg_store_damage(job->frames);
    return npg_error(NPG_BAD_INPUT, "%s", *damage ? damage : "frames that came are not there any more");
}

/* A state of aligned frames has none. */
static npg_status check_grids(const npg_job *job, const npg_record *record, int64_t serial)
{
    char name[64], path[NPG_PATH_SIZE];
    size_t size;
    uint64_t wanted, hash;
    if (!npg_record_find(record, "grids.hash", &size)) return NPG_OK;
    NPG_TRY(npg_record_get(record, "grids.hash", &wanted, sizeof wanted));
    snprintf(name, sizeof name, NPG_GRIDS_NAME, (long long)serial);
    NPG_TRY(npg_path_of(path, job->folder, name));
    NPG_TRY(npg_hash_file(&hash, path, UINT64_MAX));
    return hash == wanted ? NPG_OK
                          : npg_error(NPG_BAD_INPUT, "%s is damaged: its checksum does not match", path);
}

/* A state behind a solved window, or inside the one after it, in the place of that which is open. */
static npg_status open_state(npg_job *job, const char *kind, int64_t serial, bool with_log)
{
    npg_record *state = NULL;
    int64_t forward;
    npg_status status = npg_store_read(job->store, &state, kind, serial, 0);
    if (!status && !strcmp(kind, NPG_RECORD_STATE)) status = check_grids(job, state, serial);
    if (!status && with_log) status = check_log(job, state);
    if (!status && with_log) status = check_frames(job, state);
    if (!status) status = npg_record_get(state, "forward", &forward, sizeof forward);
    if (status) {
        npg_record_close(&state);
        return status;
    }
    npg_record_close(&job->state);
    job->state = state;
    job->forward_serial = forward;
    return NPG_OK;
}

static void warn_of_damage(npg_worker *worker, const char *what, bool is_over)
{
    npg_worker_warn(worker, false, -1, "%s; the job %s", what,
                    is_over ? "starts over" : "resumes from the window before");
}

/* The newest state that is whole, and one inside the window after it, which is newer.  A damaged one is passed
 * over with a warning: the work since is done again. */
static npg_status open_newest(npg_job *job, npg_worker *worker, bool is_done)
{
    npg_status status = NPG_OK;
    int64_t newest = npg_store_last(job->store, NPG_RECORD_STATE);
    for (int64_t serial = newest; serial >= 0 && serial > newest - 2 && !job->state; serial--) {
        status = open_state(job, NPG_RECORD_STATE, serial, !is_done);
        if (!status) job->serial = serial;
        if (status == NPG_MEMORY) return status;
        if (status) warn_of_damage(worker, npg_error_text(), serial == 0);
    }
    if (!is_done && npg_store_has(job->store, NPG_RECORD_INSIDE, job->serial, 0)) {
        status = open_state(job, NPG_RECORD_INSIDE, job->serial, true);
        if (status == NPG_MEMORY) return status;
        if (status) warn_of_damage(worker, npg_error_text(), !job->state);
    }
    const char *damage = npg_store_damage(job->store);
    if (*damage) warn_of_damage(worker, damage, !job->state);
    return NPG_OK;
}

npg_status npg_job_key(const npg_job *job, uint64_t *key)
{
    char *text = json_dumps(job->now, JSON_COMPACT | JSON_SORT_KEYS);
    if (!text) return npg_error(NPG_MEMORY, "no memory for the job's description");
    *key = XXH3_64bits(text, strlen(text));
    free(text);
    return NPG_OK;
}

bool npg_job_is_restart(const npg_job *job)
{
    return job->is_restart;
}

const npg_record *npg_job_state(const npg_job *job)
{
    return job->state;
}

npg_status npg_job_open_forward(npg_job *job)
{
    if (job->forward_serial < 0)
        return npg_error(NPG_USAGE, "%s: there is no state that later frames can start from", job->folder);
    return open_state(job, NPG_RECORD_STATE, job->forward_serial, false);
}

/* ---- opening ---- */

/* What a run of the same job does that was begun before, whose state is open if there is one. */
static npg_status choose_start(npg_job *job, npg_job_start *start, npg_worker *worker, bool is_done,
                               bool append)
{
    int64_t added, planned;
    npg_status status = npg_job_compare(&added, job->then, job->now, is_done);
    if (status == NPG_USAGE) return npg_worker_refuse_job(worker);
    NPG_TRY(status);
    *start = is_done ? NPG_JOB_DONE : NPG_JOB_RESUME;
    if (added && is_done && !append)
        return npg_error(NPG_USAGE,
                         "%s is done, but the input has %lld frames more than then: "
                         "neupig append %s adds them, --restart starts over",
                         job->output, (long long)added, job->output);
    if (added && !is_done)
        npg_worker_warn(worker, false, -1,
                        "%lld frames came since the job was begun; "
                        "neupig append adds them when it is done",
                        (long long)added);
    if (job->state) NPG_TRY(npg_record_get(job->state, "planned", &planned, sizeof planned));
    bool is_longer = job->state && planned < (int64_t)json_array_size(json_object_get(job->then, "frames"));
    if ((added && is_done) || (is_longer && !is_done)) *start = NPG_JOB_APPEND;
    if (*start == NPG_JOB_APPEND && !job->state)
        return npg_error(NPG_USAGE, "%s: there is no state left to resume from; --restart starts over",
                         job->folder);
    return NPG_OK;
}

static npg_status look_around(npg_job *job, npg_job_start *start, npg_worker *worker, bool append)
{
    bool is_done, was_partial;
    *start = NPG_JOB_FRESH;
    npg_status status = npg_json_load(&job->then, job->folder, "job.json", NPG_USAGE);
    if (!status && !job->then) return NPG_OK;
    if (!status && !json_equal(json_object_get(job->then, "layout"), json_object_get(job->now, "layout")))
        status = npg_error(NPG_USAGE, "it was begun by another version of neupig");
    if (!status) status = look_for_end(job, &is_done, &was_partial);
    if (status == NPG_USAGE) return npg_worker_refuse_job(worker);
    NPG_TRY(status);
    /* a stream, or frames that are pushed, may be others: stage export has the word on what is there */
    if (is_done && job->source > NPG_JOB_FOLLOW) return NPG_OK;
    NPG_TRY(open_store(&job->store, job, STORE_NAME));
    if (job->source) NPG_TRY(open_store(&job->frames, job, FRAMES_NAME));
    NPG_TRY(open_newest(job, worker, is_done));
    if (!job->state && !is_done)
        return rename_store(job->store, job, STORE_NEW); /* it may hold what was followed */
    NPG_TRY(choose_start(job, start, worker, is_done, append));
    if (*start == NPG_JOB_DONE && was_partial)
        npg_worker_warn(worker, true, -1, "the job was done with frames skipped or below the quality bar");
    return NPG_OK;
}

static npg_status fill(npg_job *job, npg_job_start *start, npg_worker *worker, bool restart, bool append)
{
    job->lock_fd = -1;
    job->serial = job->forward_serial = -1;
    job->is_restart = restart;
    job->source = npg_job_source_of(npg_worker_settings(worker));
    pthread_mutex_init(&job->lock, NULL);
    NPG_TRY(npg_worker_open_latch(worker, &job->exported, -1));
    job->output = npg_arena_text(&job->arena, npg_worker_settings(worker)->output);
    job->folder = npg_arena_path(&job->arena, npg_worker_settings(worker)->output, "job");
    NPG_TRY(npg_arena_status(&job->arena));
    NPG_TRY(npg_job_describe(&job->now, npg_worker_options(worker)));
    job->frame_count = (int64_t)json_array_size(json_object_get(job->now, "frames"));
    if (npg_worker_settings(worker)->confine) NPG_TRY(npg_folder_is_own(job->folder));
    NPG_TRY(take_lock(job));
    *start = NPG_JOB_FRESH;
    if (!restart) NPG_TRY(look_around(job, start, worker, append));
    job->forgets = *start == NPG_JOB_FRESH;
    if (restart || !job->forgets) NPG_TRY(npg_file_remove(job->folder, STORE_NEW));
    if (!job->store) NPG_TRY(open_store(&job->store, job, STORE_NEW));
    if (!job->source || !job->forgets) return NPG_OK;
    NPG_TRY(npg_file_remove(job->folder, FRAMES_NEW));
    return open_store(&job->frames, job, FRAMES_NEW);
}

npg_status npg_job_open(npg_job **out, npg_job_start *start, npg_worker *worker, bool restart, bool append)
{
    NPG_TRY(npg_object_open(out, NPG_FOR_RUN, sizeof **out));
    npg_status status = fill(*out, start, worker, restart, append);
    if (status) npg_job_close(out);
    return status;
}

void npg_job_close(npg_job **slot)
{
    npg_job *job = *slot;
    if (!job) return;
    npg_record_close(&job->state);
    npg_store_close(&job->store);
    npg_store_close(&job->frames);
    json_decref(job->then);
    json_decref(job->now);
    if (job->source && job->folder && !job->is_written) npg_file_remove(job->folder, FRAMES_NEW);
    if (job->lock_fd >= 0) close(job->lock_fd);
    pthread_mutex_destroy(&job->lock);
    npg_object_close(slot);
}

/* ---- writing ---- */

/* They have about a KiB for every frame, and nobody asks for them any more. */
static void forget_descriptions(npg_job *job)
{
    json_decref(job->then);
    json_decref(job->now);
    job->then = job->now = NULL;
}

npg_status npg_job_write(npg_job *job, bool keeps_grids)
{
    if (job->forgets) {
        NPG_TRY(npg_file_remove(job->folder, "job.json"));
        NPG_TRY(rename_store(job->store, job, STORE_NAME));
        NPG_TRY(npg_folder_each(job->folder, NPG_DISK, remove_stale, job));
        NPG_TRY(job->frames ? rename_store(job->frames, job, FRAMES_NAME)
                            : npg_file_remove(job->folder, FRAMES_NAME));
        NPG_TRY(npg_json_write(job->folder, "job.json", job->now));
    }
    job->keeps_grids = keeps_grids;
    forget_descriptions(job);
    pthread_mutex_lock(&job->lock);
    job->is_written = true;
    npg_latch_raise(job->exported, job->exported_count);
    pthread_mutex_unlock(&job->lock);
    return NPG_OK;
}

npg_status npg_job_extend(npg_job *job)
{
    return npg_json_write(job->folder, "job.json", job->now);
}

npg_status npg_job_end(npg_job *job)
{
    return job && job->source > NPG_JOB_FOLLOW ? npg_file_remove(job->folder, FRAMES_NAME) : NPG_OK;
}

npg_status npg_job_commit(npg_job *job, const npg_job_moment *moment)
{
    job->serial += !moment->is_inside;
    if (moment->is_forward_end) job->forward_serial = job->serial;
    NPG_TRY(npg_store_forget(job->store, is_needed, job));
    return npg_folder_each(job->folder, NPG_DISK, remove_stale, job);
}

/* ---- frames on disk ---- */

void npg_job_set_exported(npg_job *job, int64_t count, int64_t log_bytes)
{
    pthread_mutex_lock(&job->lock);
    job->exported_count = count;
    job->log_bytes = log_bytes;
    if (job->is_written) npg_latch_raise(job->exported, count);
    pthread_mutex_unlock(&job->lock);
}

void npg_job_exported(npg_job *job, int64_t *count, int64_t *log_bytes)
{
    pthread_mutex_lock(&job->lock);
    *count = job->exported_count;
    *log_bytes = job->log_bytes;
    pthread_mutex_unlock(&job->lock);
}

npg_status npg_job_wait_exported(npg_job *job, int64_t count, int64_t *log_bytes)
{
    int64_t exported;
    NPG_TRY(npg_latch_wait(job->exported, count));
    npg_job_exported(job, &exported, log_bytes);
    return NPG_OK;
}
