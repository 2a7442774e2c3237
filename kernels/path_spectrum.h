/* Path spectrum: what makes the smoothing of a grid diagonal, axis by axis.
 *
 * Along one axis of n nodes M = 2 D - A is a tridiagonal matrix: D counts a node's neighbours on the axis
 * (1 at the ends, 2 between), A joins neighbours.  An n^3 grid's 2 D - A is the Kronecker sum of three of
 * these. */
#ifndef NPG_PATH_SPECTRUM_H
#define NPG_PATH_SPECTRUM_H

#include "pipeline/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* M = B^T diag(eigen) B with the orthonormal rows of basis (n x n).  NPG_MEMORY. */
npg_status npg_path_spectrum(double *basis, double *eigen, int n);

#ifdef __cplusplus
}
#endif
#endif
