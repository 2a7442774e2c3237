/* latent: the grid levels, the sparse sampling matrix and its kernels. */
#include "kernels/latent.h"

#include <assert.h>
#include <math.h>
#include <string.h>

/* ---- the levels ---- */

void npg_levels_add(npg_levels *levels, npg_level level)
{
    assert(levels->count < NPG_LEVELS_MAX && level.nodes >= 2);
    level.first_row = levels->row_count;
    level.row_count = (size_t)level.nodes * (size_t)level.nodes * (size_t)level.nodes;
    levels->row_count += level.row_count;
    levels->level[levels->count++] = level;
}

/* The eight nodes around a point (clamped to [-1, 1]^3) of a level and their trilinear weights:
 * rows of the whole table. */
static void sample_level(const npg_level *level, const float point[3], int32_t rows[NPG_CELL_NODES],
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

/* ---- the matrix ---- */

static void fill_row(npg_samples *samples, const npg_levels *levels, size_t row, const float *position,
                     const float *normal)
{
    for (int l = 0; l < levels->count; l++) {
        const npg_level *level = &levels->level[l];
        size_t at = row * samples->per_row + NPG_CELL_NODES * (size_t)l;
        sample_level(level, level->kind == NPG_LEVEL_NORMAL ? normal : position, samples->index + at,
                     samples->weight + at);
    }
}

static void fill_channels(npg_samples *samples, const npg_levels *levels)
{
    for (int l = 0; l < levels->count; l++) {
        const npg_level *level = &levels->level[l];
        for (size_t i = 0; i < level->row_count; i++)
            samples->channels[level->first_row + i] =
                NPG_CHANNEL_RANGE(level->channel_first, level->channel_end);
    }
}

/* Sort the entries of the real rows by node (counting sort, so in order of row within a node). */
static void transpose(npg_samples *samples, size_t real)
{
    size_t entries = real * samples->per_row;
    for (size_t i = 0; i < entries; i++) samples->start[samples->index[i] + 1]++;
    for (size_t n = 0; n < samples->node_count; n++) samples->start[n + 1] += samples->start[n];
    for (size_t i = 0; i < entries; i++) {
        int32_t at = samples->start[samples->index[i]]++;
        samples->vertex[at] = (int32_t)(i / samples->per_row);
        samples->weight_back[at] = samples->weight[i];
    }
    memmove(samples->start + 1, samples->start, samples->node_count * sizeof *samples->start);
    samples->start[0] = 0;
}

static npg_status alloc_samples(npg_samples *samples, size_t real)
{
    size_t entries = samples->rows * samples->per_row, back = real * samples->per_row;
    npg_arena *a = &samples->arrays;
    samples->index = npg_arena_take(a, entries, sizeof(int32_t));
    samples->weight = npg_arena_take(a, entries, sizeof(float));
    samples->start = npg_arena_take(a, samples->node_count + 2, sizeof(int32_t));
    samples->vertex = npg_arena_take(a, back, sizeof(int32_t));
    samples->channels = npg_arena_take(a, samples->node_count, sizeof(int32_t));
    samples->weight_back = npg_arena_take(a, back, sizeof(float));
    return npg_arena_status(a);
}

npg_status npg_samples_open(npg_samples *samples, const npg_levels *levels, const float *positions,
                            const float *normals, size_t real, size_t rows)
{
    NPG_REQUIRE(real && real <= rows && rows < INT32_MAX / 256);
    *samples = (npg_samples){.arrays = {.purpose = NPG_FOR_FIT},
                             .rows = rows,
                             .node_count = levels->row_count,
                             .per_row = NPG_CELL_NODES * (size_t)levels->count};
    npg_status status = alloc_samples(samples, real);
    for (size_t row = 0; row < rows && !status; row++) {
        size_t from = row < real ? row : real - 1;
        fill_row(samples, levels, row, positions + 3 * from, normals + 3 * from);
    }
    if (!status) fill_channels(samples, levels);
    if (!status) transpose(samples, real);
    if (status) npg_samples_close(samples);
    return status;
}

void npg_samples_close(npg_samples *samples)
{
    npg_arena_release(&samples->arrays);
}

/* ---- the kernels ---- */

npg_status npg_latent_open(npg_latent *latent, npg_device *device, const npg_samples *s)
{
    size_t entries = s->rows * s->per_row, back = (size_t)s->start[s->node_count];
    *latent = (npg_latent){.rows = s->rows, .node_count = s->node_count, .per_row = s->per_row};
    npg_status status = npg_program_open(&latent->program, device, "latent", "");
    if (!status) status = npg_buffer_from(&latent->index, device, s->index, entries * 4);
    if (!status) status = npg_buffer_from(&latent->weight, device, s->weight, entries * 4);
    if (!status) status = npg_buffer_from(&latent->start, device, s->start, (s->node_count + 1) * 4);
    if (!status) status = npg_buffer_from(&latent->vertex, device, s->vertex, back * 4);
    if (!status) status = npg_buffer_from(&latent->weight_back, device, s->weight_back, back * 4);
    if (!status) status = npg_buffer_from(&latent->channels, device, s->channels, s->node_count * 4);
    if (status) npg_latent_close(latent);
    return status;
}

void npg_latent_close(npg_latent *latent)
{
    npg_buffer_close(&latent->index);
    npg_buffer_close(&latent->weight);
    npg_buffer_close(&latent->start);
    npg_buffer_close(&latent->vertex);
    npg_buffer_close(&latent->weight_back);
    npg_buffer_close(&latent->channels);
}

npg_status npg_latent_sample(const npg_latent *latent, const npg_buffer *z, const npg_buffer *nodes)
{
    return NPG_LAUNCH(latent->program, "latent_sample", latent->rows, 1, NPG_BUF(z), NPG_BUF(nodes),
                      NPG_BUF(&latent->index), NPG_BUF(&latent->weight), NPG_INT(latent->per_row),
                      NPG_INT(latent->rows));
}

npg_status npg_latent_back(const npg_latent *latent, const npg_buffer *dnodes, const npg_buffer *dz,
                           const npg_buffer *z)
{
    NPG_TRY(NPG_LAUNCH(latent->program, "latent_tanh_back", latent->rows, 1, NPG_BUF(dz), NPG_BUF(z),
                       NPG_INT(latent->rows)));
    return NPG_LAUNCH(latent->program, "latent_back", latent->node_count, 1, NPG_BUF(dnodes), NPG_BUF(dz),
                      NPG_BUF(&latent->start), NPG_BUF(&latent->vertex), NPG_BUF(&latent->weight_back),
                      NPG_BUF(&latent->channels), NPG_INT(latent->node_count));
}
