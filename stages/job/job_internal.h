/* Job, inside: the folder OUT/job, what it is compared by, and the blocks of a state. */
#ifndef NPG_JOB_INTERNAL_H
#define NPG_JOB_INTERNAL_H

#include <pthread.h>

#include "job/job.h"

#define NPG_GRIDS_NAME "window_%06lld.vdb"

/* Where frames come from.  Words of job.json. */
typedef enum npg_job_source { NPG_JOB_FILES, NPG_JOB_FOLLOW, NPG_JOB_STREAM, NPG_JOB_PUSH } npg_job_source;
npg_job_source npg_job_source_of(const npg_settings *settings);

struct npg_job {
    npg_arena arena; /* of its paths */
    char *output, *folder;
    int lock_fd;
    json_t *then, *now;  /* owned; what an earlier run was made of, and this one; NULL once written */
    int64_t frame_count; /* of the input, gaps included */
    npg_store *store;    /* owned */
    /* of a live source (ingest/spool.c), under another name until the job is written; owned, NULL without one */
    npg_store *frames;
    npg_record *state; /* that the run is resumed from; owned */
    int64_t serial;    /* of the newest window's state in place, -1: none */
    int64_t forward_serial;
    uint64_t poses_of; /* what the poses that states go with were found from */
    bool keeps_grids;  /* of all windows, for the form vdb */
    bool forgets;      /* older states go when the job is written */
    bool is_restart;
    npg_job_source source;

    npg_latch *exported;  /* the run's: frames on disk, -1 until job.json is written */
    pthread_mutex_t lock; /* guards what follows */
    bool is_written;
    int64_t exported_count, log_bytes;
};

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

/* The job is extended by frames that came since: write job.json with them. */
npg_status npg_job_extend(npg_job *job);

/* Open the state that later frames start from in place of the newest one. */
npg_status npg_job_open_forward(npg_job *job);

/* Wait until job.json is written and `count` frames are on disk; *log_bytes gets the frame log's size then.
 * NPG_ABORTED when the run stops before.  Any thread. */
npg_status npg_job_wait_exported(npg_job *job, int64_t count, int64_t *log_bytes);

/* Facts, reference, reports and warnings from the open state; before the first pass.  NPG_BAD_INPUT. */
npg_status npg_job_restore_facts(npg_worker *worker, npg_job *job);

/* Hash of options and input, to be asked before the job is written: what of an earlier run has the same is of
 * the same job. */
npg_status npg_job_key(const npg_job *job, uint64_t *key);

/* Block "log" of a state. */
typedef struct npg_job_log {
    int64_t bytes, count; /* of the frame log that goes with the state */
    uint64_t hash;        /* XXH3 of these bytes                       */
} npg_job_log;

/* A state is in the store: what nobody needs any more goes. */
npg_status npg_job_commit(npg_job *job, const npg_job_moment *moment);

/* ---- the frames of a live run (ingest/spool.c) ---- */

#define NPG_BLOCK_FRAMES "frames" /* of a state: how many had come */

/* ---- what the results are made of (job_inputs.c) ---- */

/* A new JSON object.  */
npg_status npg_job_describe(json_t **description, const npg_options *options);

/* The checksums of its frames, for stage ingest (npg_fact_input_hashes); of files alone. */
npg_status npg_job_publish_hashes(npg_worker *worker, const npg_job *job);

/* NPG_OK when both describe the same; *added gets the number of frames that `now` has more at its end.  What is
 * done may be asked for other exports.  NPG_USAGE says what differs first. */
npg_status npg_job_compare(int64_t *added, const json_t *then, const json_t *now, bool is_done);

/* State mesh: the reference mesh as blocks of a state on disk. */

/* Add the blocks "reference", "reference.vertices", ... */
npg_status npg_state_put_mesh(npg_store *out, const npg_mesh *mesh);

/* The mesh of these blocks.  Sizes are compared before memory is taken, and indices are checked:
 * NPG_BAD_INPUT where they don't fit together, NPG_MEMORY. */
npg_status npg_state_get_mesh(npg_mesh **mesh, const npg_record *in);

#endif
