/* Path spectrum: in closed form, or by rotations. */
#include "kernels/path_spectrum.h"

#include "kernels/jacobi.h"
#include "pipeline/memory.h"

#define SWEEPS 60 /* of rotations, ample: what is 0 already is passed over */

static void fill_cosines(double *basis, double *eigen, int n)
{
    for (int k = 0; k < n; k++) {
        eigen[k] = 2 - 2 * cos(M_PI * k / n);
        for (int j = 0; j < n; j++)
            basis[k * n + j] = sqrt((k ? 2.0 : 1.0) / n) * cos(M_PI * (j + 0.5) * k / n);
    }
}

npg_status npg_path_spectrum(double *basis, double *eigen, int n, double degree)
{
    double *m;
    size_t size = (size_t)n * (size_t)n;
    if (degree == 1) {
        fill_cosines(basis, eigen, n);
        return NPG_OK;
    }
    NPG_TRY(npg_alloc_array(&m, NPG_FOR_FIT, 2 * size + 1, sizeof *m));
    double *vectors = m + size; /* columns */
    for (int i = 0; i < n; i++) {
        m[i * n + i] = degree * ((i > 0) + (i < n - 1));
        if (i) m[i * n + i - 1] = m[(i - 1) * n + i] = -1;
    }
    npg_jacobi(m, vectors, n, SWEEPS);
    for (int k = 0; k < n; k++) {
        eigen[k] = m[k * n + k];
        for (int j = 0; j < n; j++) basis[k * n + j] = vectors[j * n + k];
    }
    npg_release(&m);
    return NPG_OK;
}
