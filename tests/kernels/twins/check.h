/* Check: every op on the device beside its twin; what the cases share. */
#ifndef NPG_TEST_CHECK_H
#define NPG_TEST_CHECK_H

#include "kernels/runtime/device.h"
#include "pipeline/random.h"

#define NPG_CHECK_BUFFERS 8 /* of one case, at most */

/* One case at work, and what goes with it when it ends: arrays from the arena, and buffers. */
typedef struct npg_check {
    npg_device *device; /* loan */
    npg_random random;
    npg_arena arena;
    npg_buffer buffers[NPG_CHECK_BUFFERS];
    size_t buffer_count;
    double error; /* the largest so far, relative to the largest value */
} npg_check;

typedef npg_status npg_kernel_check(npg_check *check, int size);

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

/* n values in +-scale, as float and (when `wide` is not NULL) the same in double, from the arena, whose status
 * is to be asked before they are used. */
float *npg_check_values(npg_check *check, double **wide, size_t n, double scale);

/* A buffer of n floats, with these values or (NULL) zero. */
npg_status npg_check_buffer(npg_check *check, npg_buffer **buffer, const float *values, size_t n);

/* error = max(error, max |got - want| / max |want|); a value that is not finite counts as infinitely wrong. */
void npg_check_compare(npg_check *check, const float *got, const double *want, size_t n);

/* The same for what is in a buffer. */
npg_status npg_check_compare_buffer(npg_check *check, const npg_buffer *got, const double *want, size_t n);

/* The cases, one per op. */
npg_kernel_check npg_check_latent, npg_check_sobolev, npg_check_mlp, npg_check_adam, npg_check_transform,
    npg_check_nearest, npg_check_chamfer, npg_check_isometry;

#endif
