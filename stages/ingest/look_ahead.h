/* Look-ahead: the first frames of a live source, kept so that passes can walk them as they walk a capture in
 * files; in the solving pass the source goes on behind them.
 *
 * The measuring pass brings them as they come, and one frame more: whether there is one decides whether the
 * source goes on.  That one waits for the solving pass, and behind it whatever the source holds back
 * meanwhile (files in a folder, a pipe that is full, a program that waits in npg_run_push()).  A run that is
 * resumed has no measuring pass: it takes the frames that it still needs of the look-ahead once more from the
 * source.
 *
 * Threads: that of stage ingest. */
#ifndef NPG_LOOK_AHEAD_H
#define NPG_LOOK_AHEAD_H

#include "ingest/frame_store.h"
#include "ingest/live_source.h"

typedef struct npg_look_ahead {
    npg_live_source source;
    npg_frame_store *store; /* of the look-ahead; owned                             */
    npg_chunk *behind;      /* the frame behind it, until its turn; owned, or NULL  */
    bool is_filled, is_ended;
} npg_look_ahead;

/* For the whole run.  The frames take byte_max bytes of memory, and beyond that a file in spill_folder
 * (frame_store.h).  NPG_USAGE, NPG_BAD_INPUT. */
npg_status npg_look_ahead_open(npg_look_ahead **look_ahead, npg_worker *worker,
                               const npg_live_settings *settings, size_t byte_max, const char *spill_folder);
void npg_look_ahead_close(npg_look_ahead **look_ahead);

/* Measuring pass: the next of the first `most` frames into the empty chunk.  NPG_END: these are all, and
 * facts.planned_count says how many; where the source has ended, facts.frame_count, too. */
npg_status npg_look_ahead_take(npg_look_ahead *look_ahead, npg_chunk *chunk, int64_t most);

/* Later passes: frame `index` into the empty chunk.  Any frame of the look-ahead, with is_last_use only once
 * more; behind it, in the solving pass, the next one that comes.  NPG_END: there is none with this index. */
npg_status npg_look_ahead_read(npg_look_ahead *look_ahead, npg_chunk *chunk, int64_t index, bool is_last_use);

/* Solving pass, when all its frames were read: the source's last word. */
npg_status npg_look_ahead_end(npg_look_ahead *look_ahead);

#endif
