/* Path spectrum: by rotations. */
#include "kernels/path_spectrum.h"

#include "kernels/jacobi.h"
#include "pipeline/memory.h"

#define SWEEPS 60 /* of rotations, ample: what is 0 already is passed over */

npg_status npg_path_spectrum(double *basis, double *eigen, int n)
{
    double *m;
    size_t size = (size_t)n * (size_t)n;
    NPG_TRY(npg_alloc_array(&m, NPG_FOR_FIT, 2 * size + 1, sizeof *m));
    double *vectors = m + size; /* columns */
    for (int i = 0; i < n; i++) {
        m[i * n + i] = 2 * ((i > 0) + (i < n - 1));
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
