/* Path spectrum: what makes the smoothing of a grid diagonal, axis by axis.
 *
 * Along one axis of n nodes M = degree D - A is a tridiagonal matrix: D counts a node's neighbours on the
 * axis (1 at the ends, 2 between), A joins neighbours.  An n^3 grid's degree D - A is the Kronecker sum of
 * three of these. */
#ifndef NPG_PATH_SPECTRUM_H
#define NPG_PATH_SPECTRUM_H

#include "pipeline/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* M = B^T diag(eigen) B with the orthonormal rows of basis (n x n).  degree 1, the graph's Laplacian: the
 * DCT-II, B[k][j] = s_k cos(pi (j + 1/2) k / n), s_0 = sqrt(1 / n), s_k = sqrt(2 / n),
 * eigen[k] = 2 - 2 cos(pi k / n); other degrees by Jacobi's rotations.  NPG_MEMORY. */
npg_status npg_path_spectrum(double *basis, double *eigen, int n, double degree);

#ifdef __cplusplus
}
#endif
#endif
