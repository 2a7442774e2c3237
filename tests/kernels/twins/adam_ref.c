/* adam: the plain twin of adam.cl, in double, as Kingma and Ba write it. */
#include <math.h>

#include "kernels/adam.h"
#include "tests/kernels/twins/twins.h"

void npg_adam_step_ref(double *parameters, double *first, double *second, const double *gradient,
                       const float *rates, size_t row, size_t count, int64_t step)
{
    const double beta1 = NPG_ADAM_BETA1, beta2 = NPG_ADAM_BETA2, epsilon = NPG_ADAM_EPSILON;
    for (size_t i = 0; i < count; i++) {
        first[i] = beta1 * first[i] + (1 - beta1) * gradient[i];
        second[i] = beta2 * second[i] + (1 - beta2) * gradient[i] * gradient[i];
        double m = first[i] / (1 - pow(beta1, (double)step)), v = second[i] / (1 - pow(beta2, (double)step));
        parameters[i] -= (double)rates[i / row] * m / (sqrt(v) + epsilon);
    }
}
