/* Live source: frames from standard input, from a folder that grows, or from those that are pushed, each as
 * soon as it is there, with the numbers that are left out between them.
 *
 * What comes is noted in the input log (input_log.h) where the run keeps one.  A run that is resumed goes
 * through the log first (live_replay.c): a frame that is solved is not brought again, but compared where it
 * comes again; the others are.  Then the source goes on behind it.  A source that had ended ends there again.
 * Which frames a pass brings, and in what order, look_ahead.h says.
 *
 * Threads: that of stage ingest. */
#ifndef NPG_LIVE_SOURCE_H
#define NPG_LIVE_SOURCE_H

#include "ingest/capture.h"
#include "ingest/follow.h"
#include "ingest/formats/reader.h"
#include "ingest/input_log.h"

typedef struct npg_live_settings {
    const char *frames, *follow_end;
    double follow_idle_s, follow_settle_s;
    npg_missing missing;
} npg_live_settings;

typedef struct npg_live_source {
    npg_worker *worker; /* a loan */
    npg_live_settings settings;
    npg_selection selection;
    npg_stream *stream; /* standard input                                  */
    npg_follow *follow; /* a folder that grows; neither: frames are pushed */
    npg_chunk *pushed;  /* the pushed chunk under way                      */
    size_t pushed_at;
    int64_t next;                /* index of the next frame                               */
    int64_t seen;                /* frames that came or are missing, chosen or not        */
    npg_frame waiting, previous; /* the frame behind a gap; a copy of the one before it   */
    int64_t gap_left, step;      /* missing frames before the waiting one; their distance */
    bool is_waiting, is_counted; /* gap_left is known                                     */
    int64_t skipped_count;
    npg_input_log *log; /* a loan, or NULL                                     */
    size_t replay_at, replay_count;
    int64_t total; /* frames, where an earlier run has seen the end; else -1 */
} npg_live_source;

/* NPG_USAGE, NPG_BAD_INPUT.  Close it after failure, too. */
npg_status npg_live_source_open(npg_live_source *live, npg_worker *worker, const npg_live_settings *settings);
void npg_live_source_close(npg_live_source *live);

/* The next frame, one per chunk, so that nothing waits for frames that may come much later.  NPG_END,
 * NPG_STOPPED, or what can't be read. */
npg_status npg_live_source_next(npg_live_source *live, npg_chunk *chunk);

/* ---- what live_source.c and live_replay.c share ---- */

/* Where the frames come from, for messages. */
const char *npg_live_source_name(const npg_live_source *live);

/* A frame as it comes from the pipe, or was pushed; of the content, not of a file. */
uint64_t npg_live_frame_hash(const npg_frame *frame);
npg_status npg_live_next_streamed(npg_live_source *live, npg_frame *frame);
npg_status npg_live_next_pushed(npg_live_source *live, npg_frame *frame);
npg_status npg_live_keep_previous(npg_live_source *live, const npg_frame *frame);

/* Of a resumed run: where the log leads to, before the first frame. */
npg_status npg_live_replay_open(npg_live_source *live);

/* The next line of the log; the chunk stays empty for a frame that does not come again. */
npg_status npg_live_replay(npg_live_source *live, npg_chunk *chunk);

#endif
