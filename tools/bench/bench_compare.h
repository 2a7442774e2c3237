/* Bench compare: what got slower between two reports of neupig bench. */
#ifndef NPG_BENCH_COMPARE_H
#define NPG_BENCH_COMPARE_H

#include <jansson.h>

#include "pipeline/status.h"

/* A report from a file; NPG_BAD_INPUT names file and place. */
npg_status npg_bench_load(json_t **report, const char *path);

/* Print to stdout the rows of `now` that are slower than those of `before` beyond noise: the fastest quarter
 * is over the slowest quarter of before by more than `tolerance` (0.05 is 5 %), both in units of the peak
 * that was measured beside.  NPG_PARTIAL when there are such rows, NPG_BAD_INPUT when the reports are not of
 * the same device and sizes. */
npg_status npg_bench_compare(const json_t *before, const json_t *now, double tolerance);

#endif
