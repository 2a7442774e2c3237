/* Spool: what came from a live source, frame by frame, so that passes can walk it again and a run that is broken
 * off is resumed with it: records of a store (pipeline/store.h),
 *
 *     OUT/job/frames.npg     one for every frame that came or is missing, in order of arrival
 *
 * With the points, where they came from standard input or were pushed, or repeat those of another frame; a frame of
 * a folder is its file's name, size and checksum.
 *
 * Threads: stage ingest adds frames, any thread may look at them. */
#ifndef NPG_SPOOL_H
#define NPG_SPOOL_H

#include "pipeline/stage.h"
#include "pipeline/store.h"

typedef struct npg_spooled {
    int64_t number;
    int64_t index;       /* -1: it was not selected (option frames)                                   */
    int64_t digits;      /* npg_follow_digits() at the time                                           */
    int64_t bytes;       /* of its file; of other frames the number of points; -1: not known          */
    uint64_t hash;       /* XXH3 of the file, or of what came; means nothing where bytes is -1        */
    uint64_t key;        /* of this and all that came before                                          */
    uint32_t is_missing; /* no frame came with this number; it is skipped, or held                    */
    uint32_t is_held, is_skipped, has_file;
} npg_spooled;

/* A store, written by the service job where a live run keeps state. */
extern const npg_fact_kind npg_fact_spool;

/* How many are there. */
int64_t npg_spool_count(npg_store *spool);

/* Add the next one, which has the key of the one before it (0: there is none) and gets its own; frame gives path
 * and, with_points, the points; cause (or NULL) is why it is skipped.  NPG_DISK. */
npg_status npg_spool_add(npg_store *spool, npg_spooled *entry, const npg_frame *frame, bool with_points,
                         const char *cause);

/* The i-th that came; *record, which may be NULL, to npg_record_close().  NPG_BAD_INPUT where it is damaged. */
npg_status npg_spool_get(npg_store *spool, int64_t i, npg_spooled *entry, npg_record **record);

/* The path that the frame had, NULL for none; a loan of the record. */
const char *npg_spool_path(const npg_record *record);

/* Number, index, marks, path and points of it into an empty frame. */
npg_status npg_spool_frame(const npg_spooled *entry, const npg_record *record, npg_frame *frame);

/* Key of the look-ahead: what the first `count` frames are.  0 where there are none. */
npg_status npg_spool_key(npg_store *spool, int64_t count, uint64_t *key);

/* Of the points of a frame. */
uint64_t npg_spool_hash(const npg_frame *frame);

#endif
