/* mlp: buffers and launches of the decoder. */
#include "kernels/mlp.h"

#include <stdio.h>

#define CHANNELS ((size_t)NPG_LATENT_CHANNELS)

npg_mlp_places npg_mlp_places_of(const npg_mlp_shape *s)
{
    npg_mlp_places at = {.head = s->w1 * s->w2};
    at.b2 = at.head + s->w2 * NPG_MLP_HEAD_ROW;
    at.head_bias = at.b2 + s->w2;
    at.w1z = at.head_bias + NPG_MLP_HEAD_ROW;
    at.w1t = at.w1z + CHANNELS * s->w1;
    at.b1 = at.w1t + s->code_size * s->w1;
    at.end = at.b1 + s->w1;
    return at;
}

static size_t widest(const npg_mlp_shape *s)
{
    return s->w1 > s->w2 ? s->w1 : s->w2;
}

size_t npg_mlp_scratch(const npg_mlp_shape *s, size_t block)
{
    return 2 * block * widest(s);
}

static npg_status open_buffers(npg_mlp *m, npg_device *d)
{
    const size_t f = sizeof(float);
    const npg_mlp_shape *s = &m->shape;
    size_t block = m->rows / m->blocks;
    NPG_TRY(npg_buffer_open(&m->params, d, npg_mlp_places_of(s).end * f));
    NPG_TRY(npg_buffer_open(&m->code, d, m->frames * s->code_size * f));
    NPG_TRY(npg_buffer_open(&m->z, d, m->rows * CHANNELS * f));
    NPG_TRY(npg_buffer_open(&m->out, d, m->frames * m->rows * NPG_MLP_OUT * f));
    NPG_TRY(npg_buffer_open(&m->p, d, m->rows * s->w1 * f));
    NPG_TRY(npg_buffer_open(&m->c, d, m->frames * s->w1 * f));
    NPG_TRY(npg_buffer_open(&m->h2, d, m->batch * m->rows * s->w2 * f));
    NPG_TRY(npg_buffer_open(&m->scratch, d, m->groups * npg_mlp_scratch(s, block) * f));
    NPG_TRY(npg_buffer_open(&m->grad, d, npg_mlp_places_of(s).end * f));
    NPG_TRY(npg_buffer_open(&m->dz, d, m->rows * CHANNELS * f));
    NPG_TRY(npg_buffer_open(&m->dout, d, m->frames * m->rows * NPG_MLP_OUT * f));
    NPG_TRY(npg_buffer_open(&m->dp, d, m->rows * s->w1 * f));
    NPG_TRY(npg_buffer_open(&m->dc, d, m->groups * m->frames * s->w1 * f));
    NPG_TRY(npg_buffer_open(&m->sums, d, m->groups * npg_mlp_places_of(s).w1t * f));
    size_t transposed = npg_mlp_places_of(s).head + s->w1 * CHANNELS + NPG_MLP_USED * s->w2;
    return npg_buffer_open(&m->transposed, d, transposed * f);
}

size_t npg_mlp_rows(const npg_device *device, size_t vertices)
{
    size_t block = (size_t)npg_device_tuning(device)->mlp_rows;
    return (vertices + block - 1) / block * block;
}

npg_status npg_mlp_open(npg_mlp *mlp, npg_device *device, const npg_mlp_shape *shape, size_t rows,
                        size_t frames, size_t batch)
{
    char constants[128];
    const npg_tuning *tuning = npg_device_tuning(device);
    const size_t block = (size_t)tuning->mlp_rows;
    NPG_REQUIRE(rows && rows % block == 0 && frames && batch && shape->w1 % NPG_PANEL == 0 &&
                shape->w2 % NPG_PANEL == 0);
    NPG_REQUIRE(shape->w1 >= NPG_PANEL && shape->w2 >= NPG_PANEL);
    *mlp = (npg_mlp){.shape = *shape, .rows = rows, .blocks = rows / block, .frames = frames, .batch = batch};
    mlp->local = (size_t)tuning->mlp_local;
    mlp->span = (size_t)tuning->span;
    mlp->groups = (size_t)(tuning->mlp_groups * npg_device_facts(device)->units);
    if (mlp->groups > mlp->blocks) mlp->groups = mlp->blocks;
    snprintf(constants, sizeof constants, "-DCZ=%zu -DW1=%zu -DW2=%zu -DSLOPE=%.9gf", CHANNELS, shape->w1,
             shape->w2, NPG_MLP_SLOPE);
    npg_status status = npg_program_open(&mlp->program, device, "mlp", constants);
    if (!status) status = npg_program_open(&mlp->time, device, "time", "");
    if (!status) status = open_buffers(mlp, device);
    if (status) npg_mlp_close(mlp);
    return status;
}

void npg_mlp_close(npg_mlp *mlp)
{
    npg_buffer *all[] = {&mlp->params, &mlp->grad, &mlp->code, &mlp->z,       &mlp->dz,
                         &mlp->out,    &mlp->dout, &mlp->p,    &mlp->dp,      &mlp->c,
                         &mlp->dc,     &mlp->h2,   &mlp->sums, &mlp->scratch, &mlp->transposed};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) npg_buffer_close(all[i]);
}

npg_status npg_mlp_begin(npg_mlp *m)
{
    size_t panels = widest(&m->shape) / NPG_PANEL;
    NPG_TRY(NPG_LAUNCH(m->time, "time_rows", m->shape.w1, m->frames, NPG_BUF(&m->c), NPG_BUF(&m->code),
                       NPG_BUF(&m->params), NPG_INT(npg_mlp_places_of(&m->shape).w1t),
                       NPG_INT(m->shape.code_size), NPG_INT(m->shape.w1), NPG_INT(m->frames)));
    NPG_TRY(NPG_LAUNCH_GROUPS(m->program, "mlp_input", m->groups, m->local, NPG_BUF(&m->p), NPG_BUF(&m->z),
                              NPG_BUF(&m->params), NPG_INT(m->blocks)));
    NPG_TRY(npg_buffer_zero(&m->sums));
    NPG_TRY(npg_buffer_zero(&m->dc));
    NPG_TRY(npg_buffer_zero(&m->dp));
    return NPG_LAUNCH(m->program, "mlp_transpose", panels, panels, NPG_BUF(&m->transposed),
                      NPG_BUF(&m->params));
}

npg_status npg_mlp_forward(npg_mlp *m, size_t first, size_t count)
{
    return NPG_LAUNCH_GROUPS(m->program, "mlp_forward", m->groups, m->local, NPG_BUF(&m->out),
                             NPG_BUF(&m->h2), NPG_BUF(&m->p), NPG_BUF(&m->c), NPG_BUF(&m->params),
                             NPG_BUF(&m->scratch), NPG_INT(m->blocks), NPG_INT(count), NPG_INT(first));
}

npg_status npg_mlp_backward(npg_mlp *m, size_t first, size_t count)
{
    return NPG_LAUNCH_GROUPS(m->program, "mlp_backward", m->groups, m->local, NPG_BUF(&m->dp),
                             NPG_BUF(&m->sums), NPG_BUF(&m->dc), NPG_BUF(&m->dout), NPG_BUF(&m->h2),
                             NPG_BUF(&m->p), NPG_BUF(&m->c), NPG_BUF(&m->transposed), NPG_BUF(&m->scratch),
                             NPG_INT(m->blocks), NPG_INT(count), NPG_INT(first), NPG_INT(m->frames));
}

npg_status npg_mlp_end(npg_mlp *m)
{
    size_t at_w1t = npg_mlp_places_of(&m->shape).w1t;
    NPG_TRY(NPG_LAUNCH_GROUPS(m->program, "mlp_input_back", m->groups, m->local, NPG_BUF(&m->dz),
                              NPG_BUF(&m->sums), NPG_BUF(&m->dp), NPG_BUF(&m->z), NPG_BUF(&m->transposed),
                              NPG_INT(m->blocks)));
    NPG_TRY(NPG_LAUNCH(m->program, "mlp_reduce", (at_w1t + m->span - 1) / m->span, 1, NPG_BUF(&m->grad),
                       NPG_BUF(&m->sums), NPG_INT(m->groups)));
    return NPG_LAUNCH(m->time, "time_back", m->shape.w1, 1, NPG_BUF(&m->grad), NPG_BUF(&m->dc),
                      NPG_BUF(&m->code), NPG_INT(at_w1t), NPG_INT(m->shape.code_size), NPG_INT(m->shape.w1),
                      NPG_INT(m->frames), NPG_INT(m->groups));
}
