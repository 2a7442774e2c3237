/* Features: what the unknowns of a latent grid stand for, and the direction in which they differ most. */
#include "export/exporters/vdb.h"

#include <math.h>
#include <stdbool.h>

#include "kernels/jacobi.h"
#include "kernels/path_spectrum.h"
#include "pipeline/memory.h"

#define SWEEPS 30 /* of Jacobi's rotations, more than a matrix of 30 channels needs */

/* ---- the solve ---- */

/* Along one axis, whose neighbours lie `step` values apart: out = basis in, or its transpose. */
static void turn_axis(double *values, double *line, const double *basis, int n, size_t step, size_t count,
                      bool back)
{
    size_t m = (size_t)n;
    for (size_t first = 0; first < count; first++) {
        size_t at = first / step * step * m + first % step;
        for (size_t k = 0; k < m; k++) {
            line[k] = 0;
            for (size_t i = 0; i < m; i++)
                line[k] += basis[back ? i * m + k : k * m + i] * values[at + i * step];
        }
        for (size_t k = 0; k < m; k++) values[at + k * step] = line[k];
    }
}

npg_status npg_features_solve(double *values, int nodes, int channels, double lambda)
{
    double *basis;
    size_t n = (size_t)nodes, c = (size_t)channels;
    NPG_REQUIRE(nodes > 0 && channels > 0 && lambda >= 0);
    NPG_TRY(npg_alloc_array(&basis, NPG_FOR_FILES, n + 2, n * sizeof *basis));
    double *line = basis + n * n, *eigen = line + n;
    npg_status status = npg_path_spectrum(basis, eigen, nodes);
    /* Into the basis that makes the matrix diagonal, a division, and back, as in kernels/sobolev.cl. */
    for (int back = 0; back < 2 && !status; back++) {
        for (size_t axis = 0, step = c; axis < 3; axis++, step *= n)
            turn_axis(values, line, basis, nodes, step, n * n * c, back);
        for (size_t i = 0; i < n * n * n * c && !back; i++) {
            size_t node = i / c;
            double sum = 0;
            for (int axis = 0; axis < 3; axis++, node /= n) sum += eigen[node % n];
            values[i] /= 1 + lambda * sum;
        }
    }
    npg_release(&basis);
    return status;
}

/* ---- the component ---- */

static void largest_eigenvector(double *direction, double *share, double *m, double *v, size_t n)
{
    size_t best = 0, peak = 0;
    double trace = 0;
    npg_jacobi(m, v, (int)n, SWEEPS);
    for (size_t i = 0; i < n; i++) {
        trace += m[i * n + i];
        if (m[i * n + i] > m[best * n + best]) best = i;
    }
    for (size_t i = 0; i < n; i++)
        if (fabs(v[i * n + best]) > fabs(v[peak * n + best])) peak = i;
    for (size_t i = 0; i < n; i++) direction[i] = v[i * n + best] * (v[peak * n + best] < 0 ? -1 : 1);
    *share = trace > 0 ? m[best * n + best] / trace : 0;
}

static void fill_covariance(double *m, double *mean, const double *values, size_t count, size_t n)
{
    for (size_t i = 0; i < count * n; i++) mean[i % n] += values[i];
    for (size_t c = 0; c < n && count; c++) mean[c] /= (double)count;
    for (size_t i = 0; i < count; i++)
        for (size_t p = 0; p < n; p++)
            for (size_t q = 0; q < n; q++)
                m[p * n + q] += (values[i * n + p] - mean[p]) * (values[i * n + q] - mean[q]);
}

npg_status npg_features_component(double *out, double *direction, double *share, const double *values,
                                  size_t count, int channels)
{
    double *m;
    size_t n = (size_t)channels;
    NPG_REQUIRE(channels > 0);
    NPG_TRY(npg_alloc_array(&m, NPG_FOR_FILES, 2 * n + 1, n * sizeof *m));
    double *mean = m + 2 * n * n;
    fill_covariance(m, mean, values, count, n);
    largest_eigenvector(direction, share, m, m + n * n, n);
    for (size_t i = 0; i < count; i++) {
        out[i] = 0;
        for (size_t c = 0; c < n; c++) out[i] += direction[c] * (values[i * n + c] - mean[c]);
    }
    npg_release(&m);
    return NPG_OK;
}
