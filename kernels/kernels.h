/* Door of the kernels: the table of ops, and the self-test that compares each with its plain twin.
 *
 * device.h: devices, their buffers, programs and tuning. */
#ifndef NPG_KERNELS_H
#define NPG_KERNELS_H

#include "kernels/runtime/device.h"

struct npg_check; /* check.h */
typedef npg_status npg_kernel_check(struct npg_check *check, int size);

typedef struct npg_kernel_case {
    const char *op;
    npg_kernel_check *check;
    double tolerance;
} npg_kernel_case;

/* Ends with op NULL. */
extern const npg_kernel_case npg_kernel_cases[];

/* Run one op on the device and its twin on the host over random data of the given size (1 is small; the
 * figures of size 8 are large and odd) and give the largest error, relative to the largest value. */
npg_status npg_kernel_case_run(const npg_kernel_case *op, npg_device *device, int size, uint64_t seed,
                               double *error);

/* Check every op once, small.  NPG_DEVICE names the op that computes wrong. */
npg_status npg_kernels_self_test(npg_device *device);

#endif
