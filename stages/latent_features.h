/* Features: what the unknowns of a latent grid stand for, and the direction in which they differ most. */
#ifndef NPG_LATENT_FEATURES_H
#define NPG_LATENT_FEATURES_H

#include "status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* x = (a I + lambda L)^-1 y of a dense grid, L the Laplacian of the graph of neighbouring nodes: n^3 nodes
 * with C channels each ([n][n][n][C]), in place, in double on the host.  The cosine transform along each axis
 * makes the matrix diagonal: eigenvalues a + lambda sum_axis (2 - 2 cos(pi k_axis / n)).  O(C n^4).
 * NPG_MEMORY. */
npg_status npg_features_solve(double *values, int nodes, int channels, double screen, double lambda);

/* The first principal component of `count` rows of C values: out[i] = direction . (row_i - mean), where
 * direction (C, unit length, its largest entry positive) is the eigenvector of the covariance's largest
 * eigenvalue; *share is that eigenvalue's part of the whole variance, 0 where rows do not differ. NPG_MEMORY.
 */
npg_status npg_features_component(double *out, double *direction, double *share, const double *values,
                                  size_t count, int channels);

#ifdef __cplusplus
}
#endif
#endif
