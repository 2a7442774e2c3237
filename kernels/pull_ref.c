/* pull: the plain twin of pull.cl, in double. */
#include <string.h>

#include "kernels/motion.h"

double npg_pull_ref(double *g, const double *x, size_t real, const npg_pull *pulls, size_t count)
{
    double total = 0;
    memset(g, 0, real * 3 * sizeof *g);
    for (size_t k = 0; k < count; k++) {
        const npg_pull *p = &pulls[k];
        double r[3], over = 0, square = 0, a = (double)p->along, w = (double)p->weight;
        for (int i = 0; i < 3; i++) {
            r[i] = (double)p->constant[i];
            for (int c = 0; c < 3; c++) r[i] += (double)p->share[c] * x[3 * p->vertex[c] + i];
            over += (double)p->normal[i] * r[i];
            square += r[i] * r[i];
        }
        total += w * ((1 - a) * over * over + a * square);
        for (int i = 0; i < 3; i++)
            for (int c = 0; c < 3; c++)
                g[3 * p->vertex[c] + i] +=
                    2 * w * (double)p->share[c] * ((1 - a) * over * (double)p->normal[i] + a * r[i]);
    }
    return total;
}
