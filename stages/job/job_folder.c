/* Job: the folder OUT/job, its lock and its states. */
#include "job/job.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "ingest/input_log.h"
#include "job/frame_log.h"
#include "pipeline/file.h"

#define STATE_NAME  "window_%06lld.%s"
#define INSIDE_NAME "inside.npg"
#define POSES_NAME  "poses.bin"
#define POSES_NEW   "poses.new"
#define FOLLOWED    "followed_%lld.bin"
#define INPUTS_NAME "inputs.jsonl"
#define INPUTS_NEW  "inputs.new"

struct npg_job {
    char *output, *folder; /* owned */
    int lock_fd;
    json_t *then, *now;   /* owned; what an earlier run was made of, and this one; NULL once written */
    int64_t frame_count;  /* of the input, gaps included */
    npg_archive *archive; /* owned */
    char *grids_path;     /* of the archive, owned */
    int64_t serial;       /* of the newest state in place, -1: none */
    int64_t forward_serial;
    bool keeps_grids; /* of all windows, for the form vdb */
    bool forgets;     /* older states go when the job is written */
    bool is_restart;
    npg_job_source source;

    npg_latch *exported;  /* the run's: frames on disk, -1 until job.json is written */
    pthread_mutex_t lock; /* guards what follows */
    bool is_written;
    int64_t exported_count, log_bytes;
};

/* ---- paths ---- */

static npg_status state_path(char **path, const npg_job *job, int64_t serial, const char *ending)
{
    char name[64];
    snprintf(name, sizeof name, STATE_NAME, (long long)serial, ending);
    return npg_join_path(path, job->folder, name);
}

/* The serial of a state's file (also of its hidden, unfinished form), -1 for other files. */
static int64_t serial_of(const char *name)
{
    char ending[8], rest[8];
    long long serial;
    if (name[0] == '.') name++;
    int fields = sscanf(name, "window_%lld.%3[a-z]%7s", &serial, ending, rest);
    if (fields < 2 || serial < 0 || (strcmp(ending, "npg") != 0 && strcmp(ending, "vdb") != 0)) return -1;
    return fields == 2 || !strcmp(rest, ".part") ? serial : -1;
}

/* Call visit(job, name, serial) for every file of a state. */
static npg_status each_state(npg_job *job,
                             npg_status (*visit)(npg_job *job, const char *name, int64_t serial))
{
    npg_status status = NPG_OK;
    DIR *listing = opendir(job->folder);
    if (!listing) return npg_error_errno(NPG_DISK, "can't list %s", job->folder);
    for (struct dirent *entry; !status && (entry = readdir(listing));)
        if (serial_of(entry->d_name) >= 0) status = visit(job, entry->d_name, serial_of(entry->d_name));
    closedir(listing);
    return status;
}

static npg_status remove_file(const npg_job *job, const char *name)
{
    char *path;
    NPG_TRY(npg_join_path(&path, job->folder, name));
    npg_status status = NPG_OK;
    if (unlink(path) && errno != ENOENT) status = npg_error_errno(NPG_DISK, "can't remove %s", path);
    npg_release(&path);
    return status;
}

static npg_status remove_state(npg_job *job, const char *name, int64_t serial)
{
    (void)serial;
    return remove_file(job, name);
}

static bool is_followed(const char *name)
{
    return !strncmp(name, "followed_", 9);
}

/* Remove the files of the folder that are of a kind. */
static npg_status remove_kind(npg_job *job, bool (*is_it)(const char *name))
{
    npg_status status = NPG_OK;
    DIR *listing = opendir(job->folder);
    if (!listing) return npg_error_errno(NPG_DISK, "can't list %s", job->folder);
    for (struct dirent *entry; !status && (entry = readdir(listing));)
        if (is_it(entry->d_name)) status = remove_file(job, entry->d_name);
    closedir(listing);
    return status;
}

/* Keep the two newest and the one that later frames start from; grids that are to be exported stay, too. */
static npg_status remove_old(npg_job *job, const char *name, int64_t serial)
{
    bool stays = serial == job->serial || serial == job->serial - 1 || serial == job->forward_serial;
    stays = stays || (job->keeps_grids && strstr(name, ".vdb"));
    return stays && name[0] != '.' ? NPG_OK : remove_file(job, name);
}

/* ---- the lock ---- */

static npg_status take_lock(npg_job *job)
{
    char *path;
    NPG_TRY(npg_join_path(&path, job->folder, "lock"));
    npg_status status = NPG_OK;
    job->lock_fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (job->lock_fd < 0)
        status = npg_error_errno(NPG_DISK, "can't open %s", path);
    else if (flock(job->lock_fd, LOCK_EX | LOCK_NB))
        status = errno == EWOULDBLOCK ? npg_error(NPG_USAGE,
                                                  "another run is at work on %s: "
                                                  "wait for its end, or choose another output folder",
                                                  job->output)
                                      : npg_error_errno(NPG_DISK, "can't lock %s", path);
    npg_release(&path);
    return status;
}

/* ---- what is there ---- */

static npg_status read_json(json_t **value, const char *folder, const char *name)
{
    char *path;
    json_error_t error;
    *value = NULL;
    NPG_TRY(npg_join_path(&path, folder, name));
    npg_status status = NPG_OK;
    if (access(path, F_OK) == 0) {
        int fd;
        status = npg_file_open_plain(&fd, path, NPG_USAGE);
        *value = status ? NULL : json_loadfd(fd, 0, &error);
        if (fd >= 0) close(fd);
        if (!status && !json_is_object(*value))
            status = npg_error(NPG_USAGE, "%s is damaged (line %d: %s)", path, error.line, error.text);
    } else if (errno != ENOENT) {
        status = npg_error_errno(NPG_DISK, "can't look for %s", path);
    }
    if (status) json_decref(*value);
    if (status) *value = NULL;
    npg_release(&path);
    return status;
}

static npg_status check_listed(const npg_job *job, const json_t *files)
{
    for (size_t i = 0; i < json_array_size(files); i++) {
        const json_t *entry = json_array_get(files, i);
        const char *name = json_string_value(json_object_get(entry, "path"));
        struct stat info;
        char *path;
        NPG_TRY(npg_join_path(&path, job->output, name ? name : ""));
        bool is_there = name && npg_path_stays(name) && !stat(path, &info) &&
                        info.st_size == (off_t)json_integer_value(json_object_get(entry, "bytes"));
        npg_release(&path);
        if (!is_there)
            return npg_error(NPG_USAGE, "%s/%s is missing or has another size than when it was done",
                             job->output, name ? name : "?");
    }
    return NPG_OK;
}

/* Whether the earlier run ended well, and how. */
static npg_status look_for_end(const npg_job *job, bool *is_done, bool *was_partial)
{
    json_t *done;
    *is_done = *was_partial = false;
    NPG_TRY(read_json(&done, job->output, "done.json"));
    if (!done) return NPG_OK;
    size_t frames = json_array_size(json_object_get(job->then, "frames"));
    *is_done = job->source || json_integer_value(json_object_get(done, "frames")) == (json_int_t)frames;
    *was_partial = json_integer_value(json_object_get(done, "exit_code")) == 7;
    npg_status status = *is_done ? check_listed(job, json_object_get(done, "files")) : NPG_OK;
    json_decref(done);
    return status;
}

/* ---- reading states ---- */

static npg_status check_log(const npg_job *job, const npg_archive *archive)
{
    npg_job_log log;
    int64_t planned;
    NPG_TRY(npg_archive_get(archive, "planned", &planned, sizeof planned));
    /* frames are being appended: the log is made anew from that of the frames done */
    if (planned < (int64_t)json_array_size(json_object_get(job->then, "frames"))) return NPG_OK;
    NPG_TRY(npg_archive_get(archive, "log", &log, sizeof log));
    return npg_frame_log_check(job->output, log.bytes, log.hash);
}

/* Of a live source. */
static npg_status check_inputs(const npg_job *job, const npg_archive *archive)
{
    npg_input_place place;
    uint64_t hash;
    char *path;
    if (!job->source) return NPG_OK;
    NPG_TRY(npg_archive_get(archive, NPG_BLOCK_INPUTS, &place, sizeof place));
    NPG_TRY(npg_job_inputs_path(job, &path, false));
    npg_status status = npg_hash_file(&hash, path, (uint64_t)place.bytes);
    if (!status && hash != place.hash)
        status = npg_error(NPG_BAD_INPUT, "%s was changed since it was written", path);
    npg_release(&path);
    return status;
}

/* A state of aligned frames has none. */
static npg_status check_grids(const npg_archive *archive, const char *path)
{
    size_t size;
    if (!npg_archive_find(archive, "grids.hash", &size)) return NPG_OK;
    uint64_t wanted, hash;
    NPG_TRY(npg_archive_get(archive, "grids.hash", &wanted, sizeof wanted));
    NPG_TRY(npg_hash_file(&hash, path, UINT64_MAX));
    return hash == wanted ? NPG_OK
                          : npg_error(NPG_BAD_INPUT, "%s is damaged: its checksum does not match", path);
}

static npg_status open_state(npg_job *job, int64_t serial, bool with_log)
{
    char *path = NULL, *grids = NULL;
    npg_archive *archive = NULL;
    npg_status status = state_path(&path, job, serial, "npg");
    if (!status) status = state_path(&grids, job, serial, "vdb");
    if (!status) status = npg_archive_open(&archive, path);
    if (!status) status = npg_error_prefix(check_grids(archive, grids), "%s", path);
    if (!status) status = npg_archive_get(archive, "forward", &job->forward_serial, sizeof(int64_t));
    if (!status && with_log) status = npg_error_prefix(check_log(job, archive), "%s", path);
    if (!status && with_log) status = npg_error_prefix(check_inputs(job, archive), "%s", path);
    npg_release(&path);
    if (status) {
        npg_archive_close(&archive);
        npg_release(&grids);
        return status;
    }
    npg_archive_close(&job->archive);
    npg_release(&job->grids_path);
    job->archive = archive;
    job->grids_path = grids;
    return NPG_OK;
}

static npg_status note_serial(npg_job *job, const char *name, int64_t serial)
{
    /* the archive comes last: without it the state was never whole */
    if (name[0] != '.' && strstr(name, ".npg") && serial > job->serial) job->serial = serial;
    return NPG_OK;
}

/* The newest state that is whole.  A damaged one is passed over with a warning: the work since is done
 * again. */
static npg_status open_newest(npg_job *job, npg_worker *worker, bool with_log)
{
    NPG_TRY(each_state(job, note_serial));
    int64_t newest = job->serial;
    for (int64_t serial = newest; serial >= 0 && serial > newest - 2 && !job->archive; serial--) {
        npg_status status = open_state(job, serial, with_log);
        if (status == NPG_MEMORY) return status;
        if (status && serial == 0)
            npg_worker_warn(worker, false, -1, "%s; the job starts over", npg_error_text());
        else if (status)
            npg_worker_warn(worker, false, -1, "%s; the job resumes from the window before",
                            npg_error_text());
        else
            job->serial = serial;
    }
    if (job->archive || newest < 0) return NPG_OK;
    if (newest > 0)
        npg_worker_warn(worker, false, -1, "%s: no state is whole; the job starts over", job->folder);
    return NPG_OK;
}

/* A state inside the window that follows the newest state is newer than that. */
static npg_status open_inside(npg_job *job, npg_worker *worker, bool with_log)
{
    npg_archive *archive = NULL;
    int64_t after = -1;
    char *path;
    NPG_TRY(npg_job_inside_path(job, &path));
    bool is_there = npg_is_there(path);
    npg_status status = is_there ? npg_archive_open(&archive, path) : NPG_END;
    if (!status) status = npg_archive_get(archive, "after", &after, sizeof after);
    if (!status && after != (job->archive ? job->serial : -1)) status = NPG_END;
    if (!status && with_log) status = npg_error_prefix(check_log(job, archive), "%s", path);
    if (!status && with_log) status = npg_error_prefix(check_inputs(job, archive), "%s", path);
    if (!status) status = npg_archive_get(archive, "forward", &job->forward_serial, sizeof(int64_t));
    npg_release(&path);
    if (status) {
        npg_archive_close(&archive);
        if (status < 0 && status != NPG_MEMORY)
            npg_worker_warn(worker, false, -1, "%s; the job resumes from the window before",
                            npg_error_text());
        return status == NPG_MEMORY ? status : NPG_OK;
    }
    npg_archive_close(&job->archive);
    npg_release(&job->grids_path);
    job->archive = archive;
    return NPG_OK;
}

npg_status npg_job_inside_path(const npg_job *job, char **path)
{
    return npg_join_path(path, job->folder, INSIDE_NAME);
}

npg_status npg_job_poses_path(const npg_job *job, char **path, bool is_new)
{
    return npg_join_path(path, job->folder, is_new ? POSES_NEW : POSES_NAME);
}

npg_status npg_job_followed_path(const npg_job *job, char **path, int64_t pass)
{
    char name[64];
    snprintf(name, sizeof name, FOLLOWED, (long long)pass);
    return npg_join_path(path, job->folder, name);
}

npg_status npg_job_key(const npg_job *job, uint64_t *key)
{
    char *text = json_dumps(job->now, JSON_COMPACT | JSON_SORT_KEYS);
    if (!text) return npg_error(NPG_MEMORY, "no memory for the job's description");
    *key = XXH3_64bits(text, strlen(text));
    free(text);
    return NPG_OK;
}

/* What was written under another name while an earlier run's file had this one. */
static npg_status rename_file(const npg_job *job, const char *name, const char *new_name)
{
    char *from, *to = NULL;
    NPG_TRY(npg_join_path(&from, job->folder, name));
    npg_status status = npg_join_path(&to, job->folder, new_name);
    if (!status && rename(from, to)) status = npg_error_errno(NPG_DISK, "can't rename %s", from);
    npg_release(&from);
    npg_release(&to);
    return status;
}

npg_status npg_job_keep_poses(const npg_job *job)
{
    return rename_file(job, POSES_NEW, POSES_NAME);
}

npg_status npg_job_remove_new_poses(const npg_job *job)
{
    return remove_file(job, POSES_NEW);
}

npg_status npg_job_inputs_path(const npg_job *job, char **path, bool is_new)
{
    return npg_join_path(path, job->folder, is_new ? INPUTS_NEW : INPUTS_NAME);
}

/* The log is open: what is added to it goes on under the new name. */
static npg_status keep_inputs(const npg_job *job)
{
    return job->source ? rename_file(job, INPUTS_NEW, INPUTS_NAME) : remove_file(job, INPUTS_NAME);
}

int64_t npg_job_serial(const npg_job *job)
{
    return job->serial;
}

bool npg_job_is_restart(const npg_job *job)
{
    return job->is_restart;
}

int64_t npg_job_frame_count(const npg_job *job)
{
    return job->frame_count;
}

const npg_archive *npg_job_archive(const npg_job *job)
{
    return job->archive;
}

const char *npg_job_grids_path(const npg_job *job)
{
    return job->grids_path;
}

npg_status npg_job_open_forward(npg_job *job)
{
    if (job->forward_serial < 0)
        return npg_error(NPG_USAGE, "%s: there is no state that later frames can start from", job->folder);
    return open_state(job, job->forward_serial, false);
}

/* ---- opening ---- */

npg_status npg_job_differs(const npg_job *job)
{
    char text[1024];
    snprintf(text, sizeof text, "%s", npg_error_text());
    return npg_error(NPG_USAGE,
                     "%s holds another job: %s; "
                     "give --restart to discard what is there, or choose another output folder",
                     job->output, text);
}

/* What a run of the same job does that was begun before, whose state is open if there is one. */
static npg_status choose_start(npg_job *job, npg_job_start *start, npg_worker *worker, bool is_done,
                               bool append)
{
    int64_t added, planned;
    npg_status status = npg_job_compare(&added, job->then, job->now);
    if (status == NPG_USAGE) return npg_job_differs(job);
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
    if (job->archive) NPG_TRY(npg_archive_get(job->archive, "planned", &planned, sizeof planned));
    bool is_longer = job->archive && planned < (int64_t)json_array_size(json_object_get(job->then, "frames"));
    if ((added && is_done) || (is_longer && !is_done)) *start = NPG_JOB_APPEND;
    if (*start == NPG_JOB_APPEND && !job->archive)
        return npg_error(NPG_USAGE, "%s: there is no state left to resume from; --restart starts over",
                         job->folder);
    return NPG_OK;
}

static npg_status look_around(npg_job *job, npg_job_start *start, npg_worker *worker, bool append)
{
    bool is_done, was_partial;
    *start = NPG_JOB_FRESH;
    npg_status status = read_json(&job->then, job->folder, "job.json");
    if (!status && !job->then) return NPG_OK;
    if (!status) status = look_for_end(job, &is_done, &was_partial);
    if (status == NPG_USAGE) return npg_job_differs(job);
    NPG_TRY(status);
    /* a stream, or frames that are pushed, may be others: stage export has the word on what is there */
    if (is_done && job->source > NPG_JOB_FOLLOW) return NPG_OK;
    NPG_TRY(open_newest(job, worker, !is_done));
    if (!is_done) NPG_TRY(open_inside(job, worker, true));
    if (!job->archive && !is_done) return NPG_OK;
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
    NPG_TRY(npg_copy_text(&job->output, npg_worker_settings(worker)->output));
    NPG_TRY(npg_join_path(&job->folder, job->output, "job"));
    NPG_TRY(npg_job_describe(&job->now, npg_worker_options(worker)));
    job->frame_count = (int64_t)json_array_size(json_object_get(job->now, "frames"));
    if (npg_worker_settings(worker)->confine) NPG_TRY(npg_folder_is_own(job->folder));
    NPG_TRY(npg_make_folder(job->folder));
    NPG_TRY(take_lock(job));
    *start = NPG_JOB_FRESH;
    if (restart) NPG_TRY(remove_kind(job, is_followed));
    if (!restart) NPG_TRY(look_around(job, start, worker, append));
    job->forgets = *start == NPG_JOB_FRESH;
    return NPG_OK;
}

npg_status npg_job_open(npg_job **out, npg_job_start *start, npg_worker *worker, bool restart, bool append)
{
    npg_job *job;
    *out = NULL;
    NPG_TRY(npg_alloc(&job, NPG_FOR_RUN, sizeof *job));
    npg_status status = fill(job, start, worker, restart, append);
    if (status) npg_job_close(&job);
    *out = job;
    return status;
}

void npg_job_close(npg_job **slot)
{
    npg_job *job = *slot;
    if (!job) return;
    npg_archive_close(&job->archive);
    npg_release(&job->grids_path);
    json_decref(job->then);
    json_decref(job->now);
    if (job->source && job->folder && !job->is_written) remove_file(job, INPUTS_NEW);
    if (job->lock_fd >= 0) close(job->lock_fd);
    npg_release(&job->folder);
    npg_release(&job->output);
    pthread_mutex_destroy(&job->lock);
    npg_release(slot);
}

/* ---- writing ---- */

static npg_status write_description(const npg_job *job)
{
    char *path;
    npg_file *file = NULL;
    char *text = json_dumps(job->now, JSON_INDENT(1));
    if (!text) return npg_error(NPG_MEMORY, "no memory for job.json");
    npg_status status = npg_join_path(&path, job->folder, "job.json");
    if (!status) status = npg_file_open(&file, path);
    if (!status) {
        npg_file_write(file, text, strlen(text));
        npg_file_write(file, "\n", 1);
        status = npg_file_commit(&file);
    }
    npg_release(&path);
    free(text);
    return status;
}

/* They have about a KiB for every frame, and nobody asks for them any more. */
static void forget_descriptions(npg_job *job)
{
    json_decref(job->then);
    json_decref(job->now);
    job->then = job->now = NULL;
}

npg_status npg_job_write(npg_job *job, bool keeps_grids)
{
    job->keeps_grids = keeps_grids;
    if (job->forgets) {
        NPG_TRY(remove_file(job, "job.json"));
        NPG_TRY(each_state(job, remove_state));
        NPG_TRY(remove_file(job, INSIDE_NAME));
        NPG_TRY(remove_file(job, POSES_NAME));
        NPG_TRY(keep_inputs(job));
        job->serial = job->forward_serial = -1;
        NPG_TRY(write_description(job));
    }
    forget_descriptions(job);
    pthread_mutex_lock(&job->lock);
    job->is_written = true;
    npg_latch_raise(job->exported, job->exported_count);
    pthread_mutex_unlock(&job->lock);
    return NPG_OK;
}

npg_status npg_job_extend(npg_job *job)
{
    return write_description(job);
}

npg_status npg_job_next(const npg_job *job, int64_t *serial, char **archive_path, char **grids_path)
{
    *serial = job->serial + 1;
    *archive_path = *grids_path = NULL;
    NPG_TRY(state_path(archive_path, job, *serial, "npg"));
    npg_status status = state_path(grids_path, job, *serial, "vdb");
    if (status) npg_release(archive_path);
    return status;
}

npg_status npg_job_commit(npg_job *job, bool is_forward_end)
{
    job->serial++;
    if (is_forward_end) job->forward_serial = job->serial;
    NPG_TRY(remove_file(job, INSIDE_NAME));
    NPG_TRY(remove_kind(job, is_followed));
    return each_state(job, remove_old);
}

int64_t npg_job_forward_serial(const npg_job *job)
{
    return job->forward_serial;
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
