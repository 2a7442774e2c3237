/* Probe of a capture's files, and what a run of it would take. */
#ifndef NPG_PROBE_CAPTURE_H
#define NPG_PROBE_CAPTURE_H

#include "ingest/ingest.h"
#include "tools/probe/probe_cost.h"

/* Count a frame that was read with `status`, and clear it.  Bad data goes into the list; any other failure
 * is returned. */
npg_status npg_probe_count(npg_probe *probe, npg_status status, npg_frame *frame, const char *format,
                           int64_t number);

/* Read all frames of a list. */
npg_status npg_probe_files(npg_probe *probe, const npg_frame_files *list);

/* Add what only shows when all frames have been read. */
void npg_probe_warn_of_all(npg_probe *probe);

/* What a run with these options would take. */
void npg_probe_estimate_run(npg_estimate *estimate, npg_probe *probe, const npg_options *options);

#endif
