/* Report: what is said while the reference is made, as figures of the stage's report and lines of the log.
 *
 * Called on the thread of the worker's stage alone. */
#ifndef NPG_MESH_REPORT_H
#define NPG_MESH_REPORT_H

#include "pipeline/stage.h"

/* Put a figure into the report of the worker's stage, in the place of an earlier one with this key. */
void npg_mesh_note(npg_worker *worker, const char *key, double value);
void npg_mesh_note_count(npg_worker *worker, const char *key, size_t value);

/* As npg_worker_warn(), of the reference that the run delivers; what is said of those before it (in fusing
 * passes) is for the log alone. */
void npg_mesh_warn(npg_worker *worker, bool partial, int64_t frame, const char *format, ...) NPG_PRINTF(4, 5);

#endif
