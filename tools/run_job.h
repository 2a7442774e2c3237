/* What the verbs that start runs share. */
#ifndef NPG_RUN_JOB_H
#define NPG_RUN_JOB_H

#include "tools/progress.h"

/* Holds the process id of the batch that a run belongs to. */
#define NPG_PARENT_VARIABLE "NEUPIG_BATCH_PID"

/* A run from its start to its end.  SIGINT, SIGTERM and SIGHUP stop it; when it does not end in time the
 * process does, with exit code 75: a run can be resumed from what is on disk at any moment. */
npg_status npg_run_job(const npg_options *options, npg_reporter *reporter);

/* The same without the reporter's closing record, for one run of several.  *is_open: its options were
 * good. */
npg_status npg_run_once(const npg_options *options, npg_reporter *reporter, bool *is_open);

/* Where the results are, on standard output; how it ended, on standard error. */
void npg_run_job_results(const char *verb, const char *output, npg_status status);

#endif
