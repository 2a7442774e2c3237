/* chamfer: the plain twin of chamfer.cl, in double. */
#include <math.h>
#include <string.h>

#include "tests/kernels/twins/twins.h"

/* One pair: w d^2, and its gradient (w constant) added to g. */
static double add_pair(double g[3], const double x[3], const double p[3], double falloff)
{
    double d[3], dist_sq = 0;
    for (int i = 0; i < 3; i++) {
        d[i] = x[i] - p[i];
        dist_sq += d[i] * d[i];
    }
    double w = exp(-dist_sq * dist_sq * falloff);
    for (int i = 0; i < 3; i++) g[i] += 2 * w * d[i];
    return w * dist_sq;
}

double npg_chamfer_pairs_ref(double *g, const double *x, size_t real, const double *points, size_t count,
                             const size_t *to_points, const size_t *to_verts, double alpha)
{
    double cd = 0, falloff = alpha > 0 ? 1 / (2 * alpha * alpha) : 0;
    memset(g, 0, real * 3 * sizeof *g);
    for (size_t v = 0; v < real; v++)
        cd += add_pair(g + 3 * v, x + 3 * v, points + 3 * to_points[v], falloff);
    for (size_t p = 0; p < count; p++)
        cd += add_pair(g + 3 * to_verts[p], x + 3 * to_verts[p], points + 3 * p, falloff);
    return cd;
}
