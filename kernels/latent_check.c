/* latent and sobolev: the checker's cases. */
#include <math.h>
#include <string.h>

#include "kernels/check.h"
#include "kernels/latent.h"
#include "kernels/sobolev.h"

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

typedef struct latent_data {
    npg_levels levels;
    npg_samples samples;
    float *positions, *normals, *nodes, *dz;
    double *nodes_wide, *dz_wide, *z, *dnodes;
    size_t real, rows;
    npg_arena arrays; /* holds all arrays but those of the samples */
} latent_data;

static npg_status open_latent_data(latent_data *d, int size, uint64_t seed)
{
    npg_random random = npg_random_stream(seed, 10, (uint64_t)size);
    d->real = size == 1 ? 5 : (size_t)size * 397 + 3;
    d->rows = NPG_PADDED(d->real);
    make_levels(&d->levels, size);
    size_t nodes = d->levels.row_count * CHANNELS, z = d->rows * CHANNELS;
    npg_arena *a = &d->arrays;
    a->purpose = NPG_FOR_RUN;
    npg_check_values(a, &d->positions, NULL, d->real * 3, 1.05, &random); /* some outside the cube */
    npg_check_values(a, &d->normals, NULL, d->real * 3, 1, &random);
    npg_check_values(a, &d->nodes, &d->nodes_wide, nodes, 1, &random);
    npg_check_values(a, &d->dz, &d->dz_wide, z, 1, &random);
    d->z = npg_arena_take(a, z, sizeof(double));
    d->dnodes = npg_arena_take(a, nodes, sizeof(double));
    NPG_TRY(npg_arena_status(a));
    for (size_t i = d->real * CHANNELS; i < z; i++) d->dz[i] = 0, d->dz_wide[i] = 0;
    return npg_samples_open(&d->samples, &d->levels, d->positions, d->normals, d->real, d->rows);
}

typedef struct latent_buffers {
    npg_latent latent;
    npg_buffer z, nodes, dnodes, dz;
} latent_buffers;

static npg_status compare_latent(npg_device *device, latent_data *d, latent_buffers *b, double *error)
{
    size_t nodes = d->levels.row_count * CHANNELS, z = d->rows * CHANNELS;
    NPG_TRY(npg_latent_open(&b->latent, device, &d->samples));
    NPG_TRY(npg_buffer_open(&b->z, device, z * sizeof(float)));
    NPG_TRY(npg_buffer_from(&b->nodes, device, d->nodes, nodes * sizeof(float)));
    NPG_TRY(npg_buffer_open(&b->dnodes, device, nodes * sizeof(float)));
    NPG_TRY(npg_buffer_from(&b->dz, device, d->dz, z * sizeof(float)));
    NPG_TRY(npg_latent_sample(&b->latent, &b->z, &b->nodes));
    NPG_TRY(npg_latent_back(&b->latent, &b->dnodes, &b->dz, &b->z));
    npg_latent_sample_ref(d->z, d->nodes_wide, &d->samples);
    npg_latent_back_ref(d->dnodes, d->dz_wide, d->z, &d->samples);
    NPG_TRY(npg_check_buffer(error, &b->z, d->z, z));
    return npg_check_buffer(error, &b->dnodes, d->dnodes, nodes);
}

npg_status npg_check_latent(npg_device *device, int size, uint64_t seed, double *error)
{
    latent_data d = {0};
    latent_buffers b = {0};
    *error = 0;
    npg_status status = open_latent_data(&d, size, seed);
    if (!status) status = compare_latent(device, &d, &b, error);
    npg_latent_close(&b.latent);
    npg_buffer_close(&b.z);
    npg_buffer_close(&b.nodes);
    npg_buffer_close(&b.dnodes);
    npg_buffer_close(&b.dz);
    npg_samples_close(&d.samples);
    npg_arena_release(&d.arrays);
    return status;
}

/* ---- sobolev: the residual of the matrix itself ---- */

static npg_status residual_of(npg_device *device, const npg_levels *levels, npg_random *random, double *error)
{
    npg_sobolev sobolev = {0};
    npg_buffer x = {0}, y = {0};
    size_t n = levels->row_count * CHANNELS;
    npg_arena scratch = {.purpose = NPG_FOR_RUN};
    float *right, *solution = npg_arena_take(&scratch, n, sizeof *solution);
    double *right_wide, *wide = npg_arena_take(&scratch, n, sizeof *wide);
    double *again = npg_arena_take(&scratch, n, sizeof *again);
    npg_check_values(&scratch, &right, &right_wide, n, 1, random);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_sobolev_open(&sobolev, device, levels);
    if (!status) status = npg_buffer_from(&y, device, right, n * sizeof(float));
    if (!status) status = npg_buffer_open(&x, device, n * sizeof(float));
    if (!status) status = npg_sobolev_solve(&sobolev, &x, &y);
    if (!status) status = npg_buffer_read(&x, 0, solution, n * sizeof(float));
    double off = 0, size = 0;
    for (size_t i = 0; !status && i < n; i++) wide[i] = (double)solution[i];
    if (!status) npg_sobolev_apply_ref(again, wide, levels);
    for (size_t i = 0; !status && i < n; i++) {
        off += (again[i] - right_wide[i]) * (again[i] - right_wide[i]);
        size += right_wide[i] * right_wide[i];
    }
    *error = sqrt(off / size);
    npg_sobolev_close(&sobolev);
    npg_buffer_close(&x);
    npg_buffer_close(&y);
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_check_sobolev(npg_device *device, int size, uint64_t seed, double *error)
{
    npg_levels levels;
    npg_random random = npg_random_stream(seed, 11, (uint64_t)size);
    make_levels(&levels, size);
    return residual_of(device, &levels, &random, error);
}
