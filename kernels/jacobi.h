/* Jacobi: eigenvalues and eigenvectors of a small symmetric matrix. */
#ifndef NPG_JACOBI_H
#define NPG_JACOBI_H

#include <math.h>

/* One rotation that clears m[p][q] of an n x n matrix; v collects the rotations in its columns. */
static inline void npg_jacobi_rotate(double *m, double *v, int n, int p, int q)
{
    if (fabs(m[n * p + q]) == 0) return;
    double theta = (m[n * q + q] - m[n * p + p]) / (2 * m[n * p + q]);
    double t = (theta >= 0 ? 1 : -1) / (fabs(theta) + sqrt(theta * theta + 1));
    double c = 1 / sqrt(t * t + 1), s = t * c;
    for (int k = 0; k < n; k++) {
        double a = m[n * k + p], b = m[n * k + q];
        m[n * k + p] = c * a - s * b;
        m[n * k + q] = s * a + c * b;
    }
    for (int k = 0; k < n; k++) {
        double a = m[n * p + k], b = m[n * q + k], x = v[n * k + p], y = v[n * k + q];
        m[n * p + k] = c * a - s * b;
        m[n * q + k] = s * a + c * b;
        v[n * k + p] = c * x - s * y;
        v[n * k + q] = s * x + c * y;
    }
}

/* Whether what is left beside the diagonal is too small to change a double on it. */
static inline int npg_jacobi_is_done(const double *m, int n)
{
    double beside = 0, along = 0;
    for (int p = 0; p < n; p++)
        for (int q = 0; q < n; q++) *(p == q ? &along : &beside) += fabs(m[n * p + q]);
    return beside <= 1e-19 * along;
}

/* m (n x n, overwritten) gets its eigenvalues on the diagonal, v the eigenvectors as columns.  Inline, so
 * that a constant n unrolls.  `rounds` sweeps at most: they end where another would change nothing. */
static inline void npg_jacobi(double *m, double *v, int n, int rounds)
{
    for (int i = 0; i < n * n; i++) v[i] = i % (n + 1) == 0;
    for (int round = 0; round < rounds && !npg_jacobi_is_done(m, n); round++)
        for (int p = 0; p < n - 1; p++)
            for (int q = p + 1; q < n; q++) npg_jacobi_rotate(m, v, n, p, q);
}

#endif
