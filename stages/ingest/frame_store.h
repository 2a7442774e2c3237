/* Frame store: frames kept for the passes that bring them again, in memory up to a limit and beyond it in a
 * file without a name, which is gone with the run whatever ends it.
 *
 * A frame is kept as it was read until stage outlier puts it back clean, with NPG_FIELD_CLEAN.  One that finds no
 * room, in memory or on disk, is left out without harm: it is read again, from its file or the spool of a live
 * source (spool.h).  What comes out is the same bytes as what went in.
 *
 * Threads: all functions but open and close may be called from any thread. */
#ifndef NPG_FRAME_STORE_H
#define NPG_FRAME_STORE_H

#include "pipeline/stage.h"

typedef struct npg_frame_store npg_frame_store;

typedef struct npg_frame_store_use {
    size_t memory_bytes, disk_bytes; /* now; of the file so far */
} npg_frame_store_use;

/* spill_folder: where the file is made when it is needed; NULL: nothing goes to disk.  NPG_MEMORY. */
npg_status npg_frame_store_open(npg_frame_store **store, size_t byte_max, const char *spill_folder);
void npg_frame_store_close(npg_frame_store **store);
npg_frame_store_use npg_frame_store_used(npg_frame_store *store);

/* Keep a copy under frame->index, in place of what is there.  is_final: it may go to disk; one that is not
 * clean yet will be put again, and must not take the room twice.  NPG_MEMORY where all are kept; else what
 * has no points or is held (the copy of a frame that is kept under its own index) is not. */
npg_status npg_frame_store_put(npg_frame_store *store, const npg_frame *frame, bool is_final);

/* A copy of what is kept into the empty *frame, or with give_away the thing itself.  NPG_END: nothing is;
 * NPG_MEMORY, NPG_DISK. */
npg_status npg_frame_store_get(npg_frame_store *store, npg_frame *frame, int64_t index, bool give_away);

/* Keep the normals of a clean frame that is kept, which were made or mended, with frame->cleaning's figures
 * of them; and put them into a frame.  False: none are kept. */
void npg_frame_store_put_normals(npg_frame_store *store, const npg_frame *frame);
bool npg_frame_store_get_normals(npg_frame_store *store, npg_frame *frame);

/* Written by stage ingest before its first chunk, for stage outlier. */
extern const npg_fact_kind npg_fact_frame_store;

#endif
