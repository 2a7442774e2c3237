/* Check: random values, comparison. */
#include "kernels/check.h"

#include <math.h>

void npg_check_values(npg_arena *arena, float **values, double **wide, size_t n, double scale,
                      npg_random *random)
{
    *values = npg_arena_take(arena, n, sizeof **values);
    if (wide) *wide = npg_arena_take(arena, n, sizeof **wide);
    for (size_t i = 0; i < n && !npg_arena_status(arena); i++) {
        (*values)[i] = (float)(scale * (2 * npg_random_real(random) - 1));
        if (wide) (*wide)[i] = (double)(*values)[i];
    }
}

/* 1e-30: what is all zero is compared as it is, not divided by 0. */
void npg_check_compare(double *error, const float *got, const double *want, size_t n)
{
    double largest = 1e-30, worst = 0;
    for (size_t i = 0; i < n; i++) {
        double off = fabs((double)got[i] - want[i]);
        largest = fmax(largest, fabs(want[i]));
        worst = isfinite(off) ? fmax(worst, off) : (double)INFINITY;
    }
    *error = fmax(*error, worst / largest);
}

npg_status npg_check_buffer(double *error, const npg_buffer *got, const double *want, size_t n)
{
    float *values;
    NPG_TRY(npg_alloc_array(&values, NPG_FOR_RUN, n, sizeof *values));
    npg_status status = npg_buffer_read(got, 0, values, n * sizeof *values);
    if (!status) npg_check_compare(error, values, want, n);
    npg_release(&values);
    return status;
}
