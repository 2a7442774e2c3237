/* Live source: frames from standard input, from a folder that grows, or from those that are pushed, each as
 * soon as it is there, with the numbers that are left out between them.
 *
 * What comes goes to the spool (spool.h), in order; from then on it is a capture like one in files, which passes
 * read in any order, from the cache of what was read and cleaned (frame_store.h) or from the spool.  The measuring
 * pass walks the first frames, the look-ahead, and waits for one more: whether there is one decides whether the
 * source goes on.  In the solving pass it does, behind the look-ahead; meanwhile a folder, a pipe or npg_run_push()
 * hold back what comes.
 *
 * A run that is resumed has in the spool all that came, compares what comes again (files of the folder, what is
 * piped or pushed), and goes on behind it.  A source that had ended ends there again.
 *
 * Threads: that of stage ingest. */
#ifndef NPG_LIVE_SOURCE_H
#define NPG_LIVE_SOURCE_H

#include "ingest/capture.h"
#include "pipeline/store.h"

typedef struct npg_live_settings {
    const char *frames, *follow_end;
    double follow_idle_s, follow_settle_s;
    npg_missing missing;
    int64_t look_ahead; /* without a job more is not kept */
} npg_live_settings;

typedef struct npg_live_source npg_live_source;

/* For the whole run.  Frames that were read and cleaned take cache_bytes, and beyond that a file in spill_folder
 * (frame_store.h).  NPG_USAGE, NPG_BAD_INPUT. */
npg_status npg_live_source_open(npg_live_source **live, npg_worker *worker, const npg_live_settings *settings,
                                size_t cache_bytes, const char *spill_folder);
void npg_live_source_close(npg_live_source **live);

/* What was read and cleaned; a loan. */
npg_frame_store *npg_live_source_cache(npg_live_source *live);

/* Frame `index` into *frame: any of the look-ahead, with is_last_use only once more; in the measuring pass and
 * behind the look-ahead in the solving one also the next that comes.  NPG_END: there is none with this index;
 * once a source has ended facts.frame_count says how many there are.  NPG_STOPPED, or what can't be read. */
npg_status npg_live_source_read(npg_live_source *live, npg_frame *frame, int64_t index, bool is_last_use);

/* End of the measuring pass: facts.planned_count, `most` or as many as there are. */
npg_status npg_live_source_plan(npg_live_source *live, int64_t most);

/* Solving pass, when all its frames were read: the source's last word. */
npg_status npg_live_source_end(npg_live_source *live);

/* Of a job that is done: NPG_USAGE where the files of a followed folder are others, or more came. */
npg_status npg_live_check_done(npg_worker *worker, npg_store *spool);

#endif
