/* Features: what the unknowns of a latent grid stand for, and the direction in which they differ most. */
#ifndef NPG_LATENT_FEATURES_H
#define NPG_LATENT_FEATURES_H

#include "pipeline/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* x = (screen I + lambda (degree D - A))^-1 y of a dense grid (kernels/levels.h): n^3 nodes with C channels
 * each ([n][n][n][C]), in place, in double on the host.  What makes the matrix of a path diagonal
 * (kernels/path_spectrum.h) along each axis does so with the grid's.  O(C n^4).  NPG_MEMORY. */
npg_status npg_features_solve(double *values, int nodes, int channels, double screen, double degree,
                              double lambda);

/* The first principal component of `count` rows of C values: out[i] = direction . (row_i - mean),
 * where direction (C, unit length, its largest entry positive) is the eigenvector of the covariance's
 * largest eigenvalue; *share is that eigenvalue's part of the whole variance, 0 where rows do not
 * differ.  NPG_MEMORY. */
npg_status npg_features_component(double *out, double *direction, double *share, const double *values,
                                  size_t count, int channels);

#ifdef __cplusplus
}
#endif
#endif
