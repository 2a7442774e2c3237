/* Check: what the checker's cases share. */
#ifndef NPG_CHECK_H
#define NPG_CHECK_H

#include "kernels/kernels.h"
#include "kernels/runtime/device.h"
#include "pipeline/random.h"

/* n values in +-scale, as float and (when `wide` is not NULL) the same in double. */
npg_status npg_check_values(float **values, double **wide, size_t n, double scale, npg_random *random);

/* *error = max(*error, max |got - want| / max |want|); a value that is not finite counts
 * as infinitely wrong. */
void npg_check_compare(double *error, const float *got, const double *want, size_t n);

/* The same for what is in a buffer. */
npg_status npg_check_buffer(double *error, const npg_buffer *got, const double *want, size_t n);

/* Central differences: *error = max(*error, |slope - (f(x + h) - f(x - h)) / 2h| / scale) over some of the n
 * variables x, where `slope` is the gradient to check and f the function. */
typedef double npg_check_function(void *user);
void npg_check_slope(double *error, double *x, const double *slope, size_t n, size_t stride, double h,
                     npg_check_function *f, void *user);

/* The cases, one list per op. */
npg_kernel_check npg_check_latent, npg_check_sobolev, npg_check_sobolev_graph, npg_check_sobolev_doubled,
    npg_check_mlp, npg_check_mlp_single, npg_check_mlp_deep, npg_check_adam, npg_check_transform,
    npg_check_cayley, npg_check_exponential, npg_check_nearest, npg_check_chamfer, npg_check_isometry,
    npg_check_pull;
npg_kernel_gradient npg_slope_latent, npg_slope_mlp, npg_slope_mlp_single, npg_slope_mlp_deep,
    npg_slope_transform, npg_slope_cayley, npg_slope_exponential, npg_slope_chamfer, npg_slope_isometry,
    npg_slope_pull;

#endif
