/* latent and sobolev: the checker's cases. */
#include <math.h>

#include "kernels/latent.h"
#include "kernels/sobolev.h"
#include "tests/kernels/twins/check.h"
#include "tests/kernels/twins/twins.h"

#define CHANNELS ((size_t)NPG_LATENT_CHANNELS)

static void make_levels(npg_levels *levels, int size)
{
    *levels = (npg_levels){0};
    int count = size < 4 ? 3 : 8;
    for (int l = 0; l < count; l++)
        npg_levels_add(levels, (npg_level){NPG_LEVEL_POSITION, 2 + 3 * l, 0, 0, 0, 30, 1.0 / count,
                                           0.4 * pow(1.5, l), 1});
    npg_levels_add(levels, (npg_level){NPG_LEVEL_NORMAL, 4, 0, 0, 30, 32, 1, 0.4, 1});
}

/* ---- latent ---- */

static npg_status run_latent(npg_check *c, npg_latent *latent, npg_samples *samples, int size)
{
    npg_levels levels;
    npg_buffer *z, *nodes, *dnodes, *dz;
    make_levels(&levels, size);
    size_t real = size == 1 ? 5 : (size_t)size * 397 + 3, rows = NPG_PADDED(real);
    size_t node_size = levels.row_count * CHANNELS, row_size = rows * CHANNELS;
    double *nodes_wide, *dz_wide;
    const float *positions = npg_check_values(c, NULL, real * 3, 1.05); /* some outside the cube */
    const float *normals = npg_check_values(c, NULL, real * 3, 1);
    const float *node_values = npg_check_values(c, &nodes_wide, node_size, 1);
    float *dz_values = npg_check_values(c, &dz_wide, row_size, 1);
    double *want_z = npg_arena_take(&c->arena, row_size, sizeof *want_z);
    double *want_nodes = npg_arena_take(&c->arena, node_size, sizeof *want_nodes);
    NPG_TRY(npg_arena_status(&c->arena));
    for (size_t i = real * CHANNELS; i < row_size; i++) dz_values[i] = 0, dz_wide[i] = 0;
    NPG_TRY(npg_samples_open(samples, &levels, positions, normals, real, rows));
    NPG_TRY(npg_latent_open(latent, c->device, samples));
    NPG_TRY(npg_check_buffer(c, &z, NULL, row_size));
    NPG_TRY(npg_check_buffer(c, &nodes, node_values, node_size));
    NPG_TRY(npg_check_buffer(c, &dnodes, NULL, node_size));
    NPG_TRY(npg_check_buffer(c, &dz, dz_values, row_size));
    NPG_TRY(npg_latent_sample(latent, z, nodes));
    NPG_TRY(npg_latent_back(latent, dnodes, dz, z));
    npg_latent_sample_ref(want_z, nodes_wide, samples);
    npg_latent_back_ref(want_nodes, dz_wide, want_z, samples);
    NPG_TRY(npg_check_compare_buffer(c, z, want_z, row_size));
    return npg_check_compare_buffer(c, dnodes, want_nodes, node_size);
}

npg_status npg_check_latent(npg_check *c, int size)
{
    npg_latent latent = {0};
    npg_samples samples = {0};
    npg_status status = run_latent(c, &latent, &samples, size);
    npg_latent_close(&latent);
    npg_samples_close(&samples);
    return status;
}

/* ---- sobolev: the residual of the matrix itself ---- */

static npg_status run_sobolev(npg_check *c, npg_sobolev *sobolev, const npg_levels *levels)
{
    npg_buffer *x, *y;
    size_t n = levels->row_count * CHANNELS;
    double *right_wide, off = 0, size = 0;
    const float *right = npg_check_values(c, &right_wide, n, 1);
    float *solution = npg_arena_take(&c->arena, n, sizeof *solution);
    double *wide = npg_arena_take(&c->arena, n, sizeof *wide);
    double *again = npg_arena_take(&c->arena, n, sizeof *again);
    NPG_TRY(npg_arena_status(&c->arena));
    NPG_TRY(npg_sobolev_open(sobolev, c->device, levels));
    NPG_TRY(npg_check_buffer(c, &y, right, n));
    NPG_TRY(npg_check_buffer(c, &x, NULL, n));
    NPG_TRY(npg_sobolev_solve(sobolev, x, y));
    NPG_TRY(npg_buffer_read(x, 0, solution, n * sizeof *solution));
    for (size_t i = 0; i < n; i++) wide[i] = (double)solution[i];
    npg_sobolev_apply_ref(again, wide, levels);
    for (size_t i = 0; i < n; i++) {
        off += (again[i] - right_wide[i]) * (again[i] - right_wide[i]);
        size += right_wide[i] * right_wide[i];
    }
    c->error = sqrt(off / size);
    return NPG_OK;
}

npg_status npg_check_sobolev(npg_check *c, int size)
{
    npg_levels levels;
    npg_sobolev sobolev = {0};
    make_levels(&levels, size);
    npg_status status = run_sobolev(c, &sobolev, &levels);
    npg_sobolev_close(&sobolev);
    return status;
}
