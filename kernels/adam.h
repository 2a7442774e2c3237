/* adam: the optimiser's step; kernel in adam.cl. */
#ifndef NPG_ADAM_H
#define NPG_ADAM_H

#include "kernels/runtime/device.h"

/* The decay of both moments, and what keeps the division finite: the values that Kingma and Ba recommend. */
#define NPG_ADAM_BETA1   0.9
#define NPG_ADAM_BETA2   0.999
#define NPG_ADAM_EPSILON 1e-8

/* State for one list of parameters. */
typedef struct npg_adam {
    npg_program *program;
    npg_buffer first, second, rate; /* moments [count], learning rates [ceil(count / row)] */
    size_t count, row, span;        /* span: values of a work-item, from the tuning */
    double beta1, beta2, epsilon;
    double scale; /* of all learning rates, 1 at first */
    int64_t step; /* steps done */
} npg_adam;

/* rates: one for each `row` parameters. */
npg_status npg_adam_open(npg_adam *adam, npg_device *device, const float *rates, size_t row, size_t count);
void npg_adam_close(npg_adam *adam);

/* One step: parameters -= rate m^ / (sqrt(v^) + epsilon). */
npg_status npg_adam_step(npg_adam *adam, const npg_buffer *parameters, const npg_buffer *gradient);

#endif
