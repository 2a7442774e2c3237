/* adam: the optimiser's state and launch. */
#include "kernels/adam.h"

#include <math.h>

npg_status npg_adam_open(npg_adam *adam, npg_device *device, const float *rates, size_t row, size_t count)
{
    size_t rate_count = (count + row - 1) / row;
    *adam = (npg_adam){.count = count,
                       .row = row,
                       .beta1 = NPG_ADAM_BETA1,
                       .beta2 = NPG_ADAM_BETA2,
                       .epsilon = NPG_ADAM_EPSILON,
                       .scale = 1,
                       .span = (size_t)npg_device_tuning(device)->span};
    npg_status status = npg_program_open(&adam->program, device, "adam", "");
    if (!status) status = npg_buffer_open(&adam->first, device, count * sizeof(float));
    if (!status) status = npg_buffer_open(&adam->second, device, count * sizeof(float));
    if (!status) status = npg_buffer_from(&adam->rate, device, rates, rate_count * sizeof(float));
    if (status) npg_adam_close(adam);
    return status;
}

void npg_adam_close(npg_adam *adam)
{
    npg_buffer_close(&adam->first);
    npg_buffer_close(&adam->second);
    npg_buffer_close(&adam->rate);
}

npg_status npg_adam_step(npg_adam *adam, const npg_buffer *parameters, const npg_buffer *gradient)
{
    double step = (double)++adam->step;
    /* The bias corrections, once on the host instead of for every parameter. */
    double c1 = adam->scale / (1 - pow(adam->beta1, step)), c2 = 1 / sqrt(1 - pow(adam->beta2, step));
    return NPG_LAUNCH(adam->program, "adam_step", (adam->count + adam->span - 1) / adam->span, 1,
                      NPG_BUF(parameters), NPG_BUF(&adam->first), NPG_BUF(&adam->second), NPG_BUF(gradient),
                      NPG_BUF(&adam->rate), NPG_INT(adam->count), NPG_INT(adam->row), NPG_REAL(adam->beta1),
                      NPG_REAL(adam->beta2), NPG_REAL(adam->epsilon), NPG_REAL(c1), NPG_REAL(c2));
}
