/* Check: what the checker's cases share. */
#ifndef NPG_CHECK_H
#define NPG_CHECK_H

#include "kernels/kernels.h"
#include "kernels/runtime/device.h"
#include "pipeline/random.h"

/* n values in +-scale, as float and (when `wide` is not NULL) the same in double, from an arena whose status
 * is to be asked before they are used. */
void npg_check_values(npg_arena *arena, float **values, double **wide, size_t n, double scale,
                      npg_random *random);

/* *error = max(*error, max |got - want| / max |want|); a value that is not finite counts
 * as infinitely wrong. */
void npg_check_compare(double *error, const float *got, const double *want, size_t n);

/* The same for what is in a buffer. */
npg_status npg_check_buffer(double *error, const npg_buffer *got, const double *want, size_t n);

/* The cases, one per op. */
npg_kernel_check npg_check_latent, npg_check_sobolev, npg_check_mlp, npg_check_adam, npg_check_transform,
    npg_check_nearest, npg_check_chamfer, npg_check_isometry;

#endif
