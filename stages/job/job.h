/* Job: what OUT/job/ holds so that a run which was stopped, killed or broken off is resumed by itself.
 * A stage that no frame passes through: it begins before the first pass.
 *
 *     OUT/job/lock                 empty; the run at work holds a lock (flock) on it, which ends with its
 *                                  process
 *     OUT/job/job.json             what the results are made of: version, options, and the inputs with their
 *                                  sizes, times and checksums
 *     OUT/job/frames.npg           what came from a live source, frame by frame (ingest/spool.c); that of a pipe, or
 *                                  of pushed frames, goes when the run is done
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
 * Threads: a run's npg_job belongs to stage job until the passes begin.
 * From then on stage optimize writes states, stage export says how many frames are on disk;
 * functions marked so may be called from any thread. */
#ifndef NPG_JOB_H
#define NPG_JOB_H

#include "pipeline/json_file.h"
#include "pipeline/stage.h"
#include "pipeline/store.h"

typedef struct npg_job npg_job;

/* The job of the worker's run; NULL where nothing is kept on disk (pulled from, or no output).
 * Written by stage job before the first pass. */
npg_job *npg_job_of(const npg_worker *worker);

/* Whether this run discards what is there (option restart). */
bool npg_job_is_restart(const npg_job *job);

/* The newest state that is whole, NULL when there is none; a loan. */
const npg_record *npg_job_state(const npg_job *job);

/* From now on the job is of this run: forget older states and write job.json.  keeps_grids:
 * those of all windows stay.  Any thread. */
npg_status npg_job_write(npg_job *job, bool keeps_grids);

/* The run is done: what came from a pipe or was pushed is not needed any more.  NULL is fine. */
npg_status npg_job_end(npg_job *job);

/* ---- frames on disk ---- */

/* Stage export: the results of `count` frames are on disk, the frame log has `log_bytes`.  Any thread. */
void npg_job_set_exported(npg_job *job, int64_t count, int64_t log_bytes);

/* What was set last.  Any thread. */
void npg_job_exported(npg_job *job, int64_t *count, int64_t *log_bytes);

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

/* Where stage align keeps what it finds in fusing passes; a loan. */
npg_store *npg_job_store(const npg_job *job);

/* The solving pass starts from the poses in the store that are `of` this: they stay with its states. */
void npg_job_keep_poses(npg_job *job, uint64_t of);

/* Hash of options and input: what of an earlier run has the same is of the same job.  Of a live source the input is
 * the look-ahead that has come, and so this is asked in fusing passes alone. */
npg_status npg_job_fusing_key(const npg_worker *worker, uint64_t *key);

/* Frame log: one line (JSON) for every frame whose results are on disk, in the order of solving.
 *
 *     OUT/frames.partial.jsonl     while the run is at work; a resumed run reads what came before from it
 *     OUT/frames.jsonl             the same lines in the order of time, once all frames are there
 *
 * Stage export writes it; stage evaluate reads the figures of the frames before a resumed run's.
 *
 * Threads: one at a time, but for reading the lines that were there before. */

#define NPG_FRAME_LOG_NAME "frames.partial.jsonl"

typedef struct npg_frame_log npg_frame_log;

/* Begin OUT/frames.partial.jsonl. */
npg_status npg_frame_log_open(npg_frame_log **log, const char *output);

/* Continue OUT/frames.partial.jsonl where it has `bytes` bytes; what comes after them goes.  Every mesh that
 * the lines name must be as it was written: NPG_BAD_INPUT.  *mesh_count and *skipped_count: of the lines. */
npg_status npg_frame_log_resume(npg_frame_log **log, const char *output, int64_t bytes, int64_t *mesh_count,
                                int64_t *skipped_count);

/* The partial file stays when finish has not been called.  NULL is fine. */
void npg_frame_log_close(npg_frame_log **log);

/* Append one line for a frame.  file: its mesh relative to OUT, NULL if it has none.  *lines, *bytes: so far. */
npg_status npg_frame_log_add(npg_frame_log *log, const npg_frame *frame, const char *file, int64_t *lines,
                             int64_t *bytes);

/* Faults that only showed when all frames were there, in the order of the indices. */
typedef struct npg_late_faults {
    struct npg_late_fault {
        int64_t index, number;
        int fault;           /* NPG_FAULT_*                                        */
        double value, bound; /* in per cent of what the fault's text says, see evaluate.c */
    } * faults;              /* owned */
    size_t count;
} npg_late_faults;

/* Published by stage evaluate before the last frame's line is asked for. */
extern const npg_fact_kind npg_fact_late_faults;

/* Write OUT/frames.jsonl in the order of the indices; the partial one stays until the run is done.  Frames
 * that the reference does not explain (facts->changed_at), and those with late faults (NULL: none), are
 * marked. */
npg_status npg_frame_log_finish(npg_frame_log *log, const npg_facts *facts, const npg_late_faults *late);

/* ---- the log of an earlier run ---- */

/* The figures of a frame that are one number each, as a line has them and a report sums them up. */
typedef struct npg_figure_row {
    const char *name;
    size_t offset; /* of a double in npg_figures */
    bool is_small_bad;
} npg_figure_row;
enum { NPG_FIGURE_ROWS = 12, NPG_FIGURE_P95 = 2 };
extern const npg_figure_row npg_figure_rows[NPG_FIGURE_ROWS];
static inline double *npg_figure_at(npg_figures *figures, int row)
{
    return (double *)((char *)figures + npg_figure_rows[row].offset);
}

/* Figures that a line has; its misfits and marks exactly as they were, NaN where it has none. */
void npg_frame_line_read(npg_figures *figures, const json_t *line);

/* Make OUT/frames.partial.jsonl of the frames before index `below` from the whole list of a run that is done
 * (or from the partial one, where this was broken off), which goes. */
npg_status npg_frame_log_shorten(const char *output, int64_t below, int64_t *lines, int64_t *bytes);

#endif
