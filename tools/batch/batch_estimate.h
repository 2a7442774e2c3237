/* Dry run of a batch: what its captures hold and would take. */
#ifndef NPG_BATCH_ESTIMATE_H
#define NPG_BATCH_ESTIMATE_H

#include "tools/batch/batch.h"

/* Read every capture of this process and print frames, gaps, points, memory, disk and time,
 * as a table or as lines of JSON.  *exit_code: 1 when a run of one would end at once,
 * 7 when one has something to attend to, else 0. */
npg_status npg_batch_estimate(const npg_batch *batch, bool as_json, int *exit_code);

#endif
