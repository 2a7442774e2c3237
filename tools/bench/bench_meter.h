/* Meter: times work on a device against the device's peaks.
 *
 * Each time is taken in a pair with a slice of pure multiply-adds and one of pure copying that run right
 * before it, so that what slows the whole machine slows both.  Devices that are processors are timed by the
 * process's processor seconds shared out over their units: what other programs take does not count. */
#ifndef NPG_BENCH_METER_H
#define NPG_BENCH_METER_H

#include "kernels/kernels.h"

/* What is timed: one call of npg_work (pipeline/work.h). */
typedef npg_status npg_call(void *user);

/* Lower quartile, median and upper quartile of the repetitions. */
typedef struct npg_spread {
    double low, median, high;
} npg_spread;

typedef struct npg_timing {
    double wall_s;                 /* median of one call                                       */
    npg_spread busy_s;             /* of one call: processor seconds / units, or wall on a GPU */
    npg_spread in_flops, in_bytes; /* multiply-add operations, and bytes, that the slices beside it
                                      would have done in the busy time of one call                 */
} npg_timing;

typedef struct npg_meter {
    npg_device *device; /* loan */
    npg_program *program;
    npg_buffer a, b;
    size_t repeat, groups, local;
    int rounds, vectors;
    double round_flops, vector_bytes; /* of all items together  */
    double flops_per_s, bytes_per_s;  /* the best slices so far */
} npg_meter;

npg_status npg_meter_open(npg_meter *meter, npg_device *device, size_t repeat);
void npg_meter_close(npg_meter *meter);

/* Median and quartiles; sorts the values. */
npg_spread npg_spread_of(double *values, size_t count);

/* Short work is called several times for one figure; one call goes before and does not count. */
npg_status npg_meter_time(npg_timing *timing, npg_meter *meter, npg_call *call, void *user);

#endif
