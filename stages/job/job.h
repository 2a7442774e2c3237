/* Job: what OUT/job/ holds so that a run which was stopped, killed or broken off is resumed by itself.
 * A service of the run, not a stage: no frame passes through it.
 *
 *     OUT/job/lock                 empty; the run at work holds a lock (flock) on it, which ends with its
 *                                  process
 *     OUT/job/job.json             what the results are made of: version, options, and the inputs with their
 *                                  sizes, times and checksums
 *     OUT/job/frames.npg           what came from a live source, frame by frame (ingest/spool.c)
 *     OUT/job/store.npg            one file of records with checksums, each whole or not there (store.h): after
 *                                  each solved window a state, with the facts of the capture, the reference
 *                                  mesh in unit coordinates, what stages need to be resumed, the optimiser,
 *                                  and the frames that the next windows share; a state inside the window at
 *                                  work, where that takes long; and what stage align found in fusing passes
 *     OUT/job/store.new            that of a run which has no state yet: until then what an earlier run left
 *                                  stays
 *     OUT/job/window_000012.vdb    the latent grids of the 12th state (optimize/grids/vdb_grids.h)
 *
 * The two newest states stay, and the one that later frames start from (neupig append); where grids are to be
 * exported, those of all.  A state names the checksum of its grids and of the frame log, so that a damaged one
 * is noticed and the one before it used.
 * No file says that a run is at work.
 *
 * Threads: a run's npg_job belongs to the service until the passes begin.
 * From then on stage optimize writes states, stage export says how many frames are on disk;
 * functions marked so may be called from any thread. */
#ifndef NPG_JOB_H
#define NPG_JOB_H

#include "pipeline/stage.h"
#include "pipeline/store.h"

typedef struct npg_job npg_job;

/* The job of the worker's run; NULL where nothing is kept on disk (pulled from, or no output).
 * Written by the service job before the first pass. */
npg_job *npg_job_of(const npg_worker *worker);

/* ---- the job as a whole (job_folder.c) ---- */

/* What a run finds of an earlier one. */
typedef enum npg_job_start {
    NPG_JOB_FRESH,  /* nothing that it could be resumed from      */
    NPG_JOB_RESUME, /* it continues where the earlier one was     */
    NPG_JOB_APPEND, /* the earlier one is done, frames came since */
    NPG_JOB_DONE    /* nothing is left to do                      */
} npg_job_start;

/* Open OUT/job, lock it and compare.  NPG_USAGE: another run is at work there, or the inputs,
 * options or the version are others than those that what is there was made of; the text says which. */
npg_status npg_job_open(npg_job **job, npg_job_start *start, npg_worker *worker, bool restart, bool append);
void npg_job_close(npg_job **job);

/* Whether this run discards what is there (option restart). */
bool npg_job_is_restart(const npg_job *job);

/* Frames of the input, gaps included. */
int64_t npg_job_frame_count(const npg_job *job);

/* The newest state that is whole, NULL when there is none (NPG_JOB_FRESH); a loan. */
const npg_record *npg_job_state(const npg_job *job);

/* From now on the job is of this run: forget older states and write job.json.  keeps_grids:
 * those of all windows stay.  Any thread. */
npg_status npg_job_write(npg_job *job, bool keeps_grids);

/* The job is extended by frames that came since: write job.json with them. */
npg_status npg_job_extend(npg_job *job);

/* <folder>/<name>, which the program wrote; NULL where there is none.  NPG_USAGE: it is damaged. */
npg_status npg_job_read_json(json_t **value, const char *folder, const char *name);

/* Open the state that later frames start from in place of the newest one. */
npg_status npg_job_open_forward(npg_job *job);

/* ---- frames on disk ---- */

/* Stage export: the results of `count` frames are on disk, the frame log has `log_bytes`.  Any thread. */
void npg_job_set_exported(npg_job *job, int64_t count, int64_t log_bytes);

/* What was set last.  Any thread. */
void npg_job_exported(npg_job *job, int64_t *count, int64_t *log_bytes);

/* Wait until job.json is written and `count` frames are on disk; *log_bytes gets the frame log's size then.
 * NPG_ABORTED when the run stops before.  Any thread. */
npg_status npg_job_wait_exported(npg_job *job, int64_t count, int64_t *log_bytes);

/* ---- states (job_state.c) ---- */

/* Where a run is when a state is written. */
typedef struct npg_job_moment {
    int64_t emitted;     /* frames that have been passed on to evaluate and export */
    int64_t read;        /* frames of the plan that need not be read again         */
    bool is_forward_end; /* later frames start from this state (neupig append)     */
    bool is_inside;      /* the window at work, which is not solved yet            */
} npg_job_moment;

/* Adds to the state what the stage that writes it knows; grids_path is where its latent grids go, NULL inside a
 * window. */
typedef npg_status npg_job_write_state(void *user, npg_store *out, const char *grids_path);

/* Write the next state: waits until the frames passed on are on disk, so that what is solved is never lost,
 * then facts, reports, reference, what stages save (npg_stage.save), and what write() adds.
 * It is in the store whole or not at all.  NPG_DISK, NPG_ABORTED. */
npg_status npg_job_save_state(npg_worker *worker, const npg_job_moment *moment, npg_job_write_state *write,
                              void *user);

/* Facts, reference, reports and warnings from the open state; before the first pass.  NPG_BAD_INPUT. */
npg_status npg_job_restore_facts(npg_worker *worker, npg_job *job);

/* Where stage align keeps what it finds in fusing passes; a loan. */
npg_store *npg_job_store(const npg_job *job);

/* The solving pass starts from the poses in the store that are `of` this: they stay with its states. */
void npg_job_keep_poses(npg_job *job, uint64_t of);

/* Hash of options and input, to be asked before the job is written: what of an earlier run has the same is of
 * the same job. */
npg_status npg_job_key(const npg_job *job, uint64_t *key);

/* The same in a fusing pass: of a live source the input is the look-ahead that has come. */
npg_status npg_job_fusing_key(const npg_worker *worker, uint64_t *key);

/* What job_state.c needs of the folder: block "log" of a state, the path of the next one's grids, what is kept. */
typedef struct npg_job_log {
    int64_t bytes, count; /* of the frame log that goes with the state */
    uint64_t hash;        /* XXH3 of these bytes                       */
} npg_job_log;
npg_status npg_job_next_grids(const npg_job *job, char **path);
npg_status npg_job_commit(npg_job *job, const npg_job_moment *moment);
int64_t npg_job_serial(const npg_job *job);         /* of the newest window's state, -1 while there is none */
int64_t npg_job_forward_serial(const npg_job *job); /* -1 while there is none */

/* ---- the frames of a live run (ingest/spool.c) ---- */

#define NPG_BLOCK_FRAMES "frames" /* of a state: how many had come */

/* A loan; NULL where the job is one of files.  Its file has another name until the job is written. */
npg_store *npg_job_frames(const npg_job *job);

/* The job is not the one that lies there: npg_error_text() with what to do about it.  NPG_USAGE. */
npg_status npg_job_differs(const npg_job *job);

/* ---- what the results are made of (job_inputs.c) ---- */

/* Where frames come from.  Words of job.json. */
typedef enum npg_job_source { NPG_JOB_FILES, NPG_JOB_FOLLOW, NPG_JOB_STREAM, NPG_JOB_PUSH } npg_job_source;
npg_job_source npg_job_source_of(const npg_settings *settings);

/* A new JSON object.  */
npg_status npg_job_describe(json_t **description, const npg_options *options);

/* NPG_OK when both describe the same; *added gets the number of frames that `now` has more at its end.
 * NPG_USAGE says what differs first. */
npg_status npg_job_compare(int64_t *added, const json_t *then, const json_t *now);

#endif
