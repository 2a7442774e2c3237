/* Levels: the grids behind the latent features. */
#include "kernels/levels.h"

#include <assert.h>
#include <math.h>

static size_t cube(size_t n)
{
    return n * n * n;
}

void npg_levels_add(npg_levels *levels, npg_level level, size_t table_rows)
{
    assert(levels->count < NPG_LEVELS_MAX && level.nodes >= 2);
    level.first_row = levels->row_count;
    level.row_count = cube((size_t)level.nodes);
    if (level.kind == NPG_LEVEL_HASHED && level.row_count > table_rows) level.row_count = table_rows;
    levels->row_count += level.row_count;
    levels->level[levels->count++] = level;
}

/* Spatial hash of Teschner et al., "Optimized Spatial Hashing", 2003, with the primes of instant-ngp. */
static uint32_t hash_of(const uint32_t at[3])
{
    return at[0] ^ (at[1] * 2654435761u) ^ (at[2] * 805459861u);
}

static size_t row_of(const npg_level *level, const uint32_t at[3])
{
    size_t n = (size_t)level->nodes;
    if (level->row_count < cube(n)) return level->first_row + hash_of(at) % level->row_count;
    return level->first_row + (at[0] * n + at[1]) * n + at[2];
}

void npg_level_sample(const npg_level *level, const float point[3], int32_t rows[NPG_CELL_NODES],
                      float weights[NPG_CELL_NODES])
{
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
        rows[corner] = (int32_t)row_of(level, at);
        weights[corner] = weight;
    }
}
