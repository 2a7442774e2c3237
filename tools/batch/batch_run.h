/* Run of a batch: which captures are at work, signals, progress. */
#ifndef NPG_BATCH_RUN_H
#define NPG_BATCH_RUN_H

#include "tools/batch/batch.h"
#include "tools/progress.h"

/* Run the captures that are this process's to do, at most `jobs` at a time, and fill in their verdicts;
 * the others' are read.  A capture that fails does not touch the rest.  SIGINT, SIGTERM and SIGHUP
 * are passed on; *stopped then becomes true, and nothing more is started.  NPG_MEMORY, NPG_FAILED: the
 * batch itself can't continue. */
npg_status npg_batch_run(npg_batch *batch, npg_reporter *reporter, size_t jobs, bool *stopped);

#endif
