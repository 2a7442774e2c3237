/* Frame log: one line (JSON) for every frame whose results are on disk, in the order of solving.
 *
 *     OUT/frames.partial.jsonl     while the run is at work; a resumed run reads what came before from it
 *     OUT/frames.jsonl             the same lines in the order of time, once all frames are there
 *
 * Stage export writes it; stage evaluate reads the figures of the frames before a resumed run's.
 *
 * Threads: one at a time, but for reading the lines that were there before. */
#ifndef NPG_FRAME_LOG_H
#define NPG_FRAME_LOG_H

#include "pipeline/json_file.h"
#include "pipeline/stage.h"

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

/* Append one line for a frame.  file: its mesh relative to OUT, NULL if it has none. */
npg_status npg_frame_log_add(npg_frame_log *log, const npg_frame *frame, const char *output,
                             const char *file);

/* Lines so far and their bytes. */
void npg_frame_log_size(const npg_frame_log *log, int64_t *lines, int64_t *bytes);

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

/* The lines in the first `bytes` bytes of OUT/frames.partial.jsonl.  NPG_DISK, NPG_BAD_INPUT where
 * they are no such lines. */
npg_status npg_frame_log_each(const char *output, int64_t bytes, npg_json_line_visit *visit, void *user);

/* Misfits and marks of a line, exactly as they were; NaN where it has none. */
void npg_frame_line_read(npg_figures *figures, const json_t *line);

/* Their bytes on disk for good, and their checksum.  NPG_DISK. */
npg_status npg_frame_log_sync(const char *output, int64_t bytes, uint64_t *hash);

/* NPG_BAD_INPUT where the first `bytes` bytes have another checksum. */
npg_status npg_frame_log_check(const char *output, int64_t bytes, uint64_t hash);

/* Make OUT/frames.partial.jsonl of the frames before index `below` from the whole list of a run that is done
 * (or from the partial one, where this was broken off), which goes. */
npg_status npg_frame_log_shorten(const char *output, int64_t below, int64_t *lines, int64_t *bytes);

#endif
