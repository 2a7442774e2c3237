/* sobolev: the matrix that the kernels invert, written out node by node, in double. */
#include "tests/kernels/twins/twins.h"

/* Row (i, j, k) of I + lambda (2 D - A): D counts the neighbours inside the grid, A sums them. */
static double apply_at(const double *x, const npg_level *level, int i, int j, int k, size_t channel)
{
    int n = level->nodes, at[3] = {i, j, k};
    const size_t step[3] = {(size_t)n * (size_t)n, (size_t)n, 1};
    size_t row = level->first_row + ((size_t)i * (size_t)n + (size_t)j) * (size_t)n + (size_t)k;
    double mine = x[row * NPG_LATENT_CHANNELS + channel];
    double sum = mine;
    for (int axis = 0; axis < 3; axis++) {
        if (at[axis] > 0)
            sum += level->lambda * (2 * mine - x[(row - step[axis]) * NPG_LATENT_CHANNELS + channel]);
        if (at[axis] < n - 1)
            sum += level->lambda * (2 * mine - x[(row + step[axis]) * NPG_LATENT_CHANNELS + channel]);
    }
    return sum;
}

void npg_sobolev_apply_ref(double *y, const double *x, const npg_levels *levels)
{
    for (int l = 0; l < levels->count; l++) {
        const npg_level *level = &levels->level[l];
        double *to = y + level->first_row * NPG_LATENT_CHANNELS;
        if (level->lambda <= 0) {
            for (size_t i = 0; i < level->row_count * NPG_LATENT_CHANNELS; i++)
                to[i] = x[level->first_row * NPG_LATENT_CHANNELS + i];
            continue;
        }
        for (int i = 0; i < level->nodes; i++)
            for (int j = 0; j < level->nodes; j++)
                for (int k = 0; k < level->nodes; k++)
                    for (size_t c = 0; c < NPG_LATENT_CHANNELS; c++) *to++ = apply_at(x, level, i, j, k, c);
    }
}
