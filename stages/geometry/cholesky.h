/* Cholesky: small dense symmetric systems, n x n, row by row; only lower halves are read and written. */
#ifndef NPG_CHOLESKY_H
#define NPG_CHOLESKY_H

#include <math.h>
#include <stddef.h>

/* m = L L' in place.  m is positive definite; a square on the diagonal that rounding has taken below `least`
 * counts as that. */
static inline void npg_cholesky_factor(double *m, size_t n, double least)
{
    for (size_t j = 0; j < n; j++)
        for (size_t i = j; i < n; i++) {
            double sum = m[i * n + j];
            for (size_t k = 0; k < j; k++) sum -= m[i * n + k] * m[j * n + k];
            m[i * n + j] = i == j ? sqrt(fmax(sum, least)) : sum / m[j * n + j];
        }
}

/* x = (L L')^-1 x. */
static inline void npg_cholesky_solve(const double *l, size_t n, double *x)
{
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < i; k++) x[i] -= l[i * n + k] * x[k];
        x[i] /= l[i * n + i];
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++) x[i] -= l[k * n + i] * x[k];
        x[i] /= l[i * n + i];
    }
}

#endif
