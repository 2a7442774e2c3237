/* isometry: the plain twin of isometry.cl, in double, edge by edge. */
#include <math.h>

#include "tests/kernels/twins/twins.h"

double npg_isometry_ref(double *g, const double *x, const uint32_t (*edges)[2], const double *rest,
                        size_t edge_count)
{
    double total = 0;
    for (size_t e = 0; e < edge_count; e++) {
        const double *a = x + 3 * edges[e][0], *b = x + 3 * edges[e][1];
        double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
        double size = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), change = size - rest[e];
        total += fabs(change);
        double sign = change > 0 ? 1 : change < 0 ? -1 : 0;
        for (int i = 0; i < 3 && size > 0; i++) {
            g[3 * edges[e][0] + i] += sign * d[i] / size;
            g[3 * edges[e][1] + i] -= sign * d[i] / size;
        }
    }
    return total;
}
