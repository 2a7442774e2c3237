/* Capture: the frames of a capture in files, readable in any order, with a store of what was read. */
#ifndef NPG_CAPTURE_H
#define NPG_CAPTURE_H

#include "ingest/frame_files.h"
#include "ingest/frame_store.h"
#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/options.h"

/* What to do about numbers that no file has. */
typedef enum npg_missing {
    NPG_MISSING_ERROR, /* refuse the capture                                    */
    NPG_MISSING_SKIP,  /* a frame without points, is_skipped                    */
    NPG_MISSING_HOLD,  /* the points of the frame before it (or after), is_held */
    NPG_MISSING_IGNORE /* numbers mean nothing: frames follow each other        */
} npg_missing;

typedef struct npg_capture {
    npg_frame_files *list; /* owned */
    npg_missing missing;
    bool keep_going;
    uint8_t *is_bad;        /* per slot: could not be read; owned */
    npg_frame_store *store; /* of what was read; owned            */
    uint64_t reads;         /* files parsed so far                */
} npg_capture;

/* Over a list that is at hand; takes it.  NPG_BAD_INPUT with the numbers of the gaps under
 * NPG_MISSING_ERROR; input is for messages.  What was read is kept in cache_limit bytes, and beyond that in
 * spill_folder (frame_store.h). */
npg_status npg_capture_open_list(npg_capture **capture, npg_frame_files **list, const char *input,
                                 npg_missing missing, bool keep_going, size_t cache_limit,
                                 const char *spill_folder);

/* Over the list of an input that is no rig. */
npg_status npg_capture_open(npg_capture **capture, const char *input, const char *selection,
                            npg_missing missing, bool keep_going, size_t cache_limit,
                            const char *spill_folder);
void npg_capture_close(npg_capture **capture);

/* Frame `index` (0 <= index < list->count) into the empty *frame.  NPG_PARTIAL: with keep_going, a file that
 * can't be used for the first time; the frame is_skipped and npg_error_text() says why.  is_last_use: the
 * store may give its copy away.  frame->fields has NPG_FIELD_CLEAN where the store has it clean. */
npg_status npg_capture_read(npg_capture *capture, npg_frame *frame, int64_t index, npg_origin *origin,
                            bool is_last_use);

#endif
