/* sobolev: the exact solve (I + lambda L) x = y, L = 2 D - A (levels.h), on every grid level; kernels in sobolev.cl. */
#ifndef NPG_SOBOLEV_H
#define NPG_SOBOLEV_H

#include "kernels/levels.h"
#include "kernels/runtime/device.h"

typedef struct npg_sobolev {
    npg_program *program;
    npg_buffer levels, matrices, eigen, eigen_first, lambda;
    npg_buffer a, b; /* scratch, [nodes][32] each */
    int level_count;
    size_t line_count;
} npg_sobolev;

npg_status npg_sobolev_open(npg_sobolev *sobolev, npg_device *device, const npg_levels *levels);
void npg_sobolev_close(npg_sobolev *sobolev);

/* x = (I + lambda L)^-1 y, [nodes][32]; x may be y.  Levels with lambda = 0 are copied.
 * The matrix is symmetric: the same call passes gradients back. */
npg_status npg_sobolev_solve(npg_sobolev *sobolev, const npg_buffer *x, const npg_buffer *y);

#endif
