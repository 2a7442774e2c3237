/* mlp and adam: the checker's cases. */
#include <math.h>

#include "kernels/adam.h"
#include "kernels/check.h"
#include "kernels/levels.h"
#include "kernels/mlp.h"

#define CHANNELS ((size_t)NPG_LATENT_CHANNELS)

typedef struct mlp_data {
    npg_mlp_shape shape;
    size_t rows, frames, param_count;
    float *params, *z, *code, *dout;
    double *params_wide, *z_wide, *code_wide, *dout_wide;
    double *out, *grad, *dz;
    npg_arena arrays; /* holds all of these */
} mlp_data;

/* Some sizes have one block, some several batches of frames, some uneven widths; all have frames whose sums
 * come together. */
static npg_status open_mlp_data(mlp_data *d, size_t block, int size, uint64_t seed)
{
    npg_random random = npg_random_stream(seed, 12, (uint64_t)size);
    d->shape = (npg_mlp_shape){32 * (size_t)size, size > 1 ? 64 : 32, size == 2 ? 2 : 8};
    d->rows = block * (size > 2 ? 3 : 1);
    d->frames = size == 1 ? 2 : 5;
    size_t n = d->param_count = npg_mlp_param_count(&d->shape), samples = d->rows * d->frames;
    npg_arena *a = &d->arrays;
    a->purpose = NPG_FOR_RUN;
    npg_check_values(a, &d->params, &d->params_wide, n, 1 / sqrt((double)d->shape.w1), &random);
    npg_check_values(a, &d->z, &d->z_wide, d->rows * CHANNELS, 1, &random);
    npg_check_values(a, &d->code, &d->code_wide, d->frames * d->shape.code_size, 1, &random);
    npg_check_values(a, &d->dout, &d->dout_wide, samples * NPG_MLP_OUT, 1, &random);
    d->out = npg_arena_take(a, samples * NPG_MLP_OUT, sizeof(double));
    d->grad = npg_arena_take(a, n, sizeof(double));
    d->dz = npg_arena_take(a, d->rows * CHANNELS, sizeof(double));
    NPG_TRY(npg_arena_status(a));
    for (size_t k = 0; k < d->shape.w2; k++)
        for (size_t o = NPG_MLP_USED; o < NPG_MLP_HEAD_ROW; o++)
            d->params[npg_mlp_at_head(&d->shape) + k * NPG_MLP_HEAD_ROW + o] = 0;
    for (size_t o = NPG_MLP_USED; o < NPG_MLP_HEAD_ROW; o++)
        d->params[npg_mlp_at_head_bias(&d->shape) + o] = 0;
    for (size_t i = 7; i < samples * NPG_MLP_OUT; i += NPG_MLP_OUT) d->dout[i] = 0;
    return NPG_OK;
}

static void mlp_twins(mlp_data *d)
{
    for (size_t t = 0; t < d->frames; t++)
        for (size_t v = 0; v < d->rows; v++) {
            size_t at = (t * d->rows + v) * NPG_MLP_OUT, code = t * d->shape.code_size;
            npg_mlp_forward_ref(d->out + at, d->z_wide + v * CHANNELS, d->code_wide + code, d->params_wide,
                                &d->shape);
            npg_mlp_backward_ref(d->grad, d->dz + v * CHANNELS, d->dout_wide + at, d->z_wide + v * CHANNELS,
                                 d->code_wide + code, d->params_wide, &d->shape);
        }
}

static npg_status run_mlp(npg_mlp *mlp, mlp_data *d)
{
    NPG_TRY(npg_buffer_write(&mlp->params, 0, d->params, d->param_count * sizeof(float)));
    NPG_TRY(npg_buffer_write(&mlp->z, 0, d->z, d->rows * CHANNELS * sizeof(float)));
    NPG_TRY(npg_buffer_write(&mlp->code, 0, d->code, d->frames * d->shape.code_size * sizeof(float)));
    NPG_TRY(npg_buffer_write(&mlp->dout, 0, d->dout, d->rows * d->frames * NPG_MLP_OUT * sizeof(float)));
    NPG_TRY(npg_mlp_begin(mlp));
    for (size_t first = 0; first < d->frames; first += mlp->batch) {
        size_t left = d->frames - first, count = left < mlp->batch ? left : mlp->batch;
        NPG_TRY(npg_mlp_forward(mlp, first, count));
        NPG_TRY(npg_mlp_backward(mlp, first, count));
    }
    return npg_mlp_end(mlp);
}

static npg_status compare_mlp(npg_device *device, mlp_data *d, npg_mlp *mlp, double *error)
{
    NPG_TRY(npg_mlp_open(mlp, device, &d->shape, d->rows, d->frames, 2));
    NPG_TRY(run_mlp(mlp, d));
    mlp_twins(d);
    NPG_TRY(npg_check_buffer(error, &mlp->out, d->out, d->rows * d->frames * NPG_MLP_OUT));
    NPG_TRY(npg_check_buffer(error, &mlp->grad, d->grad, d->param_count));
    return npg_check_buffer(error, &mlp->dz, d->dz, d->rows * CHANNELS);
}

npg_status npg_check_mlp(npg_device *device, int size, uint64_t seed, double *error)
{
    mlp_data d = {0};
    npg_mlp mlp = {0};
    *error = 0;
    npg_status status = open_mlp_data(&d, npg_mlp_rows(device, 1), size, seed);
    if (!status) status = compare_mlp(device, &d, &mlp, error);
    npg_mlp_close(&mlp);
    npg_arena_release(&d.arrays);
    return status;
}

/* ---- adam ---- */

typedef struct adam_data {
    npg_adam adam;
    npg_buffer params, gradient;
    float *start, *slope, *rates;
    double *wide, *slope_wide, *first, *second;
    npg_arena arrays; /* holds all of these */
} adam_data;

static npg_status run_adam(npg_device *device, adam_data *d, size_t n, size_t row, npg_random *random,
                           double *error)
{
    d->arrays.purpose = NPG_FOR_RUN;
    npg_check_values(&d->arrays, &d->start, &d->wide, n, 1, random);
    npg_check_values(&d->arrays, &d->rates, NULL, (n + row - 1) / row, 0.1, random);
    d->first = npg_arena_take(&d->arrays, n, sizeof(double));
    d->second = npg_arena_take(&d->arrays, n, sizeof(double));
    NPG_TRY(npg_arena_status(&d->arrays));
    NPG_TRY(npg_adam_open(&d->adam, device, d->rates, row, n));
    NPG_TRY(npg_buffer_from(&d->params, device, d->start, n * sizeof(float)));
    for (int64_t step = 1; step <= 5; step++) {
        npg_buffer_close(&d->gradient);
        /* gradients down to the size of epsilon */
        npg_check_values(&d->arrays, &d->slope, &d->slope_wide, n, step % 2 ? 1 : 1e-7, random);
        NPG_TRY(npg_arena_status(&d->arrays));
        NPG_TRY(npg_buffer_from(&d->gradient, device, d->slope, n * sizeof(float)));
        NPG_TRY(npg_adam_step(&d->adam, &d->params, &d->gradient));
        npg_adam_step_ref(d->wide, d->first, d->second, d->slope_wide, d->rates, row, n, step);
    }
    return npg_check_buffer(error, &d->params, d->wide, n);
}

npg_status npg_check_adam(npg_device *device, int size, uint64_t seed, double *error)
{
    adam_data d = {0};
    npg_random random = npg_random_stream(seed, 13, (uint64_t)size);
    *error = 0;
    npg_status status = run_adam(device, &d, size == 1 ? 7 : (size_t)size * 1009, 32, &random, error);
    npg_adam_close(&d.adam);
    npg_buffer_close(&d.params);
    npg_buffer_close(&d.gradient);
    npg_arena_release(&d.arrays);
    return status;
}
