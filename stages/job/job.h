/* Job: what OUT/job/ holds so that a run which was stopped, killed or broken off goes on by itself.
 *
 *     OUT/job/lock                 empty; the run at work holds a lock (flock) on it, which ends with its
 *                                  process
 *     OUT/job/job.json             what the results are made of: version, options, and the inputs with their
 *                                  sizes, times and checksums
 *     OUT/job/window_000012.npg    state after the 12th closed window: an archive (pipeline/archive.h) with
 *                                  the facts of the capture, the reference mesh in unit coordinates, the
 *                                  optimiser, the coarse alignment's poses and the frames that the next
 *                                  windows share
 *     OUT/job/window_000012.vdb    the latent grids of the same moment (optimize/vdb_grids.h)
 *     OUT/job/motion_000012.npg    the motion of that window's frames at any time (optimize/record.h); those
 *                                  of all windows stay, for neupig apply
 *
 * The two newest windows stay, and the one that later frames go on from (neupig append); where grids are to
 * be exported, those of all.  Each file appears whole or not at all; the archive names the checksum of its
 * grids and of the list of frames, so that a damaged one is noticed and the one before it taken.  No file
 * says that a run is at work.
 *
 * Threads: the functions marked so may be called from any stage's thread;
 * the others are called by one stage alone. */
#ifndef NPG_JOB_H
#define NPG_JOB_H

#include "pipeline/archive.h"
#include "pipeline/stage.h"

typedef struct npg_job npg_job;

/* ---- the job as a whole (the stage job) ---- */

/* What a run finds of an earlier one. */
typedef enum npg_job_start {
    NPG_JOB_FRESH,  /* nothing that it could go on from           */
    NPG_JOB_RESUME, /* it goes on where the earlier one was       */
    NPG_JOB_APPEND, /* the earlier one is done, frames came since */
    NPG_JOB_DONE    /* nothing is left to do                      */
} npg_job_start;

/* Open OUT/job, lock it and compare.  NPG_USAGE: another run is at work there, or the inputs, options or the
 * version are others than those that what is there was made of; the text says which. */
npg_status npg_job_open(npg_job **job, npg_job_start *start, npg_worker *worker, bool restart, bool append);
void npg_job_close(npg_job **job);

/* Frames of the input, gaps included. */
int64_t npg_job_frame_count(const npg_job *job);

/* The newest state that is whole, NULL when there is none (NPG_JOB_FRESH); a loan. */
const npg_archive *npg_job_archive(const npg_job *job);

/* Its latent grids. */
const char *npg_job_grids_path(const npg_job *job);

/* From now on the job is of this run: forget older states and write job.json.  Any thread. */
npg_status npg_job_write(npg_job *job);

/* The job goes on with frames that came since: write job.json with them. */
npg_status npg_job_extend(npg_job *job);

/* ---- what the stages leave for a state ---- */

/* align: what it needs to go on after `read` frames of the plan (size bytes, copied).  Any thread. */
npg_status npg_job_leave_poses(npg_job *job, int64_t read, const void *bytes, size_t size);

/* Take it (give it to npg_release()), NULL when there is none; what was left for earlier
 * moments goes.  Any thread. */
void *npg_job_take_poses(npg_job *job, int64_t read, size_t *size);

/* evaluate: number and vertices (V x 3, unit, copied) of the frame that the truth is tied in.  Any thread. */
npg_status npg_job_leave_tied(npg_job *job, int64_t number, const float *vert_unit, size_t vert_count);

/* NULL before that; a loan while evaluate rests. */
const float *npg_job_tied(const npg_job *job, int64_t *number, size_t *vert_count);

/* export: the list of frames now has `count` lines and its file `list_bytes`.  Any thread. */
void npg_job_note_exported(npg_job *job, int64_t count, int64_t list_bytes);

/* What was noted last. */
void npg_job_exported(npg_job *job, int64_t *count, int64_t *list_bytes);

/* Wait until job.json is written and export has noted `count` frames; *list_bytes gets the list's size then.
 * NPG_STOPPED when the run stops before.  Any thread. */
npg_status npg_job_wait_exported(npg_job *job, const npg_worker *worker, int64_t count, int64_t *list_bytes);

/* ---- states ---- */

/* Block "list" of a state: the list of frames (OUT/frames.partial.jsonl) that goes with it. */
typedef struct npg_job_list {
    int64_t bytes, count;
    uint64_t hash; /* XXH3 of these bytes */
} npg_job_list;

/* The number and the paths (to npg_release()) of the next state. */
npg_status npg_job_next(const npg_job *job, int64_t *serial, char **archive_path, char **grids_path);

/* Where the record of the next window goes (record.h); to npg_release(). */
npg_status npg_job_motion_path(const npg_job *job, char **path);

/* Both files of the next state are in place: count it and remove states that nobody goes on from any more.
 * is_forward_end: later frames go on from it. */
npg_status npg_job_commit(npg_job *job, bool is_forward_end);

/* The state that later frames go on from; -1 while there is none. */
int64_t npg_job_forward_serial(const npg_job *job);

/* Open that state in place of the newest one. */
npg_status npg_job_open_forward(npg_job *job);

/* ---- what the results are made of (job_inputs.c) ---- */

/* A new JSON object.  */
npg_status npg_job_describe(json_t **description, const npg_options *options);

/* NPG_OK when both describe the same; *added gets the number of frames that `now` has more at its end.
 * NPG_USAGE says what differs first. */
npg_status npg_job_compare(int64_t *added, const json_t *then, const json_t *now);

#endif
