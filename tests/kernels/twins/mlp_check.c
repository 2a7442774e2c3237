/* mlp and adam: the checker's cases. */
#include <math.h>

#include "kernels/adam.h"
#include "kernels/levels.h"
#include "kernels/mlp.h"
#include "tests/kernels/twins/check.h"
#include "tests/kernels/twins/twins.h"

#define CHANNELS ((size_t)NPG_LATENT_CHANNELS)

typedef struct mlp_data {
    npg_mlp_shape shape;
    size_t rows, frames, param_count;
    float *params, *z, *code, *dout;
    double *params_wide, *z_wide, *code_wide, *dout_wide;
    double *out, *grad, *dz;
} mlp_data;

/* Some sizes have one block, some several batches of frames, some uneven widths; all have frames whose sums
 * come together. */
static npg_status make_mlp_data(npg_check *c, mlp_data *d, int size)
{
    d->shape = (npg_mlp_shape){32 * (size_t)size, size > 1 ? 64 : 32, size == 2 ? 2 : 8};
    d->rows = npg_mlp_rows(c->device, 1) * (size > 2 ? 3 : 1);
    d->frames = size == 1 ? 2 : 5;
    size_t n = d->param_count = npg_mlp_places_of(&d->shape).end, samples = d->rows * d->frames;
    d->params = npg_check_values(c, &d->params_wide, n, 1 / sqrt((double)d->shape.w1));
    d->z = npg_check_values(c, &d->z_wide, d->rows * CHANNELS, 1);
    d->code = npg_check_values(c, &d->code_wide, d->frames * d->shape.code_size, 1);
    d->dout = npg_check_values(c, &d->dout_wide, samples * NPG_MLP_OUT, 1);
    d->out = npg_arena_take(&c->arena, samples * NPG_MLP_OUT, sizeof(double));
    d->grad = npg_arena_take(&c->arena, n, sizeof(double));
    d->dz = npg_arena_take(&c->arena, d->rows * CHANNELS, sizeof(double));
    NPG_TRY(npg_arena_status(&c->arena));
    for (size_t k = 0; k < d->shape.w2; k++)
        for (size_t o = NPG_MLP_USED; o < NPG_MLP_HEAD_ROW; o++)
            d->params[npg_mlp_places_of(&d->shape).head + k * NPG_MLP_HEAD_ROW + o] = 0;
    for (size_t o = NPG_MLP_USED; o < NPG_MLP_HEAD_ROW; o++)
        d->params[npg_mlp_places_of(&d->shape).head_bias + o] = 0;
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

static npg_status run_mlp(npg_check *c, npg_mlp *mlp, int size)
{
    mlp_data d;
    NPG_TRY(make_mlp_data(c, &d, size));
    size_t out_size = d.rows * d.frames * NPG_MLP_OUT;
    NPG_TRY(npg_mlp_open(mlp, c->device, &d.shape, d.rows, d.frames, 2));
    NPG_TRY(npg_buffer_write(&mlp->params, 0, d.params, d.param_count * sizeof(float)));
    NPG_TRY(npg_buffer_write(&mlp->z, 0, d.z, d.rows * CHANNELS * sizeof(float)));
    NPG_TRY(npg_buffer_write(&mlp->code, 0, d.code, d.frames * d.shape.code_size * sizeof(float)));
    NPG_TRY(npg_buffer_write(&mlp->dout, 0, d.dout, out_size * sizeof(float)));
    NPG_TRY(npg_mlp_begin(mlp));
    for (size_t first = 0; first < d.frames; first += mlp->batch) {
        size_t left = d.frames - first, count = left < mlp->batch ? left : mlp->batch;
        NPG_TRY(npg_mlp_forward(mlp, first, count));
        NPG_TRY(npg_mlp_backward(mlp, first, count));
    }
    NPG_TRY(npg_mlp_end(mlp));
    mlp_twins(&d);
    NPG_TRY(npg_check_compare_buffer(c, &mlp->out, d.out, out_size));
    NPG_TRY(npg_check_compare_buffer(c, &mlp->grad, d.grad, d.param_count));
    return npg_check_compare_buffer(c, &mlp->dz, d.dz, d.rows * CHANNELS);
}

npg_status npg_check_mlp(npg_check *c, int size)
{
    npg_mlp mlp = {0};
    npg_status status = run_mlp(c, &mlp, size);
    npg_mlp_close(&mlp);
    return status;
}

/* ---- adam ---- */

static npg_status run_adam(npg_check *c, npg_adam *adam, size_t n, size_t row)
{
    npg_buffer *params, *gradient;
    double *wide, *slope_wide;
    const float *start = npg_check_values(c, &wide, n, 1);
    const float *rates = npg_check_values(c, NULL, (n + row - 1) / row, 0.1);
    double *first = npg_arena_take(&c->arena, n, sizeof *first);
    double *second = npg_arena_take(&c->arena, n, sizeof *second);
    NPG_TRY(npg_arena_status(&c->arena));
    NPG_TRY(npg_adam_open(adam, c->device, rates, row, n));
    NPG_TRY(npg_check_buffer(c, &params, start, n));
    NPG_TRY(npg_check_buffer(c, &gradient, NULL, n));
    for (int64_t step = 1; step <= 5; step++) {
        /* gradients down to the size of epsilon */
        const float *slope = npg_check_values(c, &slope_wide, n, step % 2 ? 1 : 1e-7);
        NPG_TRY(npg_arena_status(&c->arena));
        NPG_TRY(npg_buffer_write(gradient, 0, slope, n * sizeof *slope));
        NPG_TRY(npg_adam_step(adam, params, gradient));
        npg_adam_step_ref(wide, first, second, slope_wide, rates, row, n, step);
    }
    return npg_check_compare_buffer(c, params, wide, n);
}

npg_status npg_check_adam(npg_check *c, int size)
{
    npg_adam adam = {0};
    npg_status status = run_adam(c, &adam, size == 1 ? 7 : (size_t)size * 1009, 32);
    npg_adam_close(&adam);
    return status;
}
