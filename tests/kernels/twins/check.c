/* Check: the table of ops, random values, comparison. */
#include "tests/kernels/twins/check.h"

#include <math.h>

npg_status npg_kernel_case_run(const npg_kernel_case *c, npg_device *device, int size, uint64_t seed,
                               double *error)
{
    npg_check check = {.device = device,
                       .random =
                           npg_random_stream(seed, (uint64_t)(10 + c - npg_kernel_cases), (uint64_t)size),
                       .arena.purpose = NPG_FOR_RUN};
    npg_status status = c->check(&check, size);
    for (size_t i = 0; i < check.buffer_count; i++) npg_buffer_close(&check.buffers[i]);
    npg_arena_release(&check.arena);
    *error = check.error;
    return status;
}

float *npg_check_values(npg_check *c, double **wide, size_t n, double scale)
{
    float *values = npg_arena_take(&c->arena, n, sizeof *values);
    double *same = wide ? npg_arena_take(&c->arena, n, sizeof *same) : NULL;
    for (size_t i = 0; i < n && !npg_arena_status(&c->arena); i++) {
        values[i] = (float)(scale * (2 * npg_random_real(&c->random) - 1));
        if (same) same[i] = (double)values[i];
    }
    if (wide) *wide = same;
    return values;
}

npg_status npg_check_buffer(npg_check *c, npg_buffer **out, const float *values, size_t n)
{
    NPG_REQUIRE(c->buffer_count < NPG_CHECK_BUFFERS);
    *out = &c->buffers[c->buffer_count++];
    return values ? npg_buffer_from(*out, c->device, values, n * sizeof *values)
                  : npg_buffer_open(*out, c->device, n * sizeof *values);
}

/* 1e-30: what is all zero is compared as it is, not divided by 0. */
void npg_check_compare(npg_check *c, const float *got, const double *want, size_t n)
{
    double largest = 1e-30, worst = 0;
    for (size_t i = 0; i < n; i++) {
        double off = fabs((double)got[i] - want[i]);
        largest = fmax(largest, fabs(want[i]));
        worst = isfinite(off) ? fmax(worst, off) : (double)INFINITY;
    }
    c->error = fmax(c->error, worst / largest);
}

npg_status npg_check_compare_buffer(npg_check *c, const npg_buffer *got, const double *want, size_t n)
{
    float *values = npg_arena_take(&c->arena, n, sizeof *values);
    NPG_TRY(npg_arena_status(&c->arena));
    NPG_TRY(npg_buffer_read(got, 0, values, n * sizeof *values));
    npg_check_compare(c, values, want, n);
    return NPG_OK;
}

const npg_kernel_case npg_kernel_cases[] = {{"latent", npg_check_latent, 2e-5},
                                            {"sobolev", npg_check_sobolev, 1e-5},
                                            {"mlp", npg_check_mlp, 2e-5},
                                            {"adam", npg_check_adam, 1e-5},
                                            {"transform", npg_check_transform, 2e-5},
                                            {"nearest", npg_check_nearest, 1e-6},
                                            {"chamfer", npg_check_chamfer, 2e-5},
                                            {"isometry", npg_check_isometry, 2e-5},
                                            {0}};
