/* Input log: what came from a live source, frame by frame, so that a run which is broken off can be resumed.
 *
 *     OUT/job/inputs.jsonl     one line (JSON) for every frame that came or is missing, in order of arrival
 *
 * A live source has no list of inputs before it ends; this is the list so far.  A state on disk names how
 * much of it belongs to it (npg_input_log_place), with a checksum.
 *
 * Threads: stage ingest adds lines; npg_input_log_place() and npg_input_log_sync() from any thread. */
#ifndef NPG_INPUT_LOG_H
#define NPG_INPUT_LOG_H

#include "pipeline/stage.h"

/* One line.  A frame that can't be used (keep-going) is skipped; one that is missing is skipped or held. */
typedef struct npg_input_entry {
    int64_t number;
    int64_t index;   /* -1: it was not selected (option frames)                                       */
    char *name;      /* of its file; owned by the log, NULL where frames have no files                */
    int64_t digits;  /* npg_follow_digits() at the time                                               */
    int64_t bytes;   /* of its file; of other frames the number of points; -1: not known              */
    uint64_t hash;   /* XXH3 of the file, or of what came; means nothing where bytes is -1            */
    bool is_missing; /* no frame came with this number                                                */
    bool is_held, is_skipped;
    bool is_solved; /* of a resumed run: it need not be read again; not on disk                      */
} npg_input_entry;

typedef struct npg_input_log npg_input_log;

/* How much of the log belongs to a state: a block of the state. */
typedef struct npg_input_place {
    int64_t lines, bytes;
    uint64_t hash; /* XXH3 of these bytes */
} npg_input_place;

/* Written by the service job where a live run keeps state; no such fact: nothing is logged. */
extern const npg_fact_kind npg_fact_input_log;

/* Begin the file at `path`, in place of what is there.  NPG_DISK. */
npg_status npg_input_log_open(npg_input_log **log, const char *path);

/* Continue the file where it has place->bytes bytes; what comes after them goes.  NPG_BAD_INPUT where these
 * are not such lines, NPG_DISK. */
npg_status npg_input_log_resume(npg_input_log **log, const char *path, const npg_input_place *place);

/* Only look at the first `bytes` bytes: nothing can be added. */
npg_status npg_input_log_read(npg_input_log **log, const char *path, int64_t bytes);
void npg_input_log_close(npg_input_log **log);

/* What was there when the log was resumed; in order of arrival. */
npg_input_entry *npg_input_log_entries(const npg_input_log *log, size_t *count);

/* Whether the frame of entry i must be had once more: it is not solved, or (holds: option missing = hold)
 * frames that are missing behind it repeat its points. */
bool npg_input_log_needs(const npg_input_log *log, size_t i, bool holds);

/* Give these back once they are replayed. */
void npg_input_log_forget(npg_input_log *log);

/* Append a line.  entry->name is a loan.  NPG_DISK. */
npg_status npg_input_log_add(npg_input_log *log, const npg_input_entry *entry);

/* How much of the log there is up to the frame with this index, which has come; without the checksum. */
void npg_input_log_place(npg_input_log *log, int64_t index, npg_input_place *place);

/* Its bytes on disk for good.  NPG_DISK. */
npg_status npg_input_log_sync(npg_input_log *log);

#endif
