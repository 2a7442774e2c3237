/* Levels: the grids behind the latent features. */
#include "kernels/levels.h"

#include <assert.h>
#include <math.h>

void npg_levels_add(npg_levels *levels, npg_level level)
{
    assert(levels->count < NPG_LEVELS_MAX && level.nodes >= 2);
    level.first_row = levels->row_count;
    level.row_count = (size_t)level.nodes * (size_t)level.nodes * (size_t)level.nodes;
    levels->row_count += level.row_count;
    levels->level[levels->count++] = level;
}

void npg_level_sample(const npg_level *level, const float point[3], int32_t rows[NPG_CELL_NODES],
                      float weights[NPG_CELL_NODES])
{
    size_t n = (size_t)level->nodes;
    uint32_t cell[3];
    float part[3];
    for (int axis = 0; axis < 3; axis++) {
        float last = (float)(level->nodes - 1);
        float at = fminf(fmaxf((point[axis] + 1) * 0.5f * last, 0), last);
        cell[axis] = (uint32_t)fminf(floorf(at), last - 1); /* the upper border belongs to the last cell */
        part[axis] = at - (float)cell[axis];
    }
    /* Corner bits: x, y, z from the highest, so that rows of the table are met in order. */
    for (int corner = 0; corner < NPG_CELL_NODES; corner++) {
        uint32_t at[3];
        float weight = (float)level->share;
        for (int axis = 0; axis < 3; axis++) {
            uint32_t up = (uint32_t)corner >> (2 - axis) & 1;
            at[axis] = cell[axis] + up;
            weight *= up ? part[axis] : 1 - part[axis];
        }
        rows[corner] = (int32_t)(level->first_row + (at[0] * n + at[1]) * n + at[2]);
        weights[corner] = weight;
    }
}
