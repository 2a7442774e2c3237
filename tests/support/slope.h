/* A gradient against central differences of its function. */
#ifndef NPG_TEST_SLOPE_H
#define NPG_TEST_SLOPE_H

#include <math.h>
#include <stddef.h>

typedef double slope_function(void *user);

/* *error = max(*error, |slope - (f(x + h) - f(x - h)) / 2h| / scale) over some of the n variables x, where
 * `slope` is the gradient to check and f the function. */
static inline void check_slope(double *error, double *x, const double *slope, size_t n, size_t stride,
                               double h, slope_function *f, void *user)
{
    double largest = 1e-30; /* what is all zero is compared as it is, not divided by 0 */
    for (size_t i = 0; i < n; i++) largest = fmax(largest, fabs(slope[i]));
    for (size_t i = 0; i < n; i += stride) {
        double before = x[i];
        x[i] = before + h;
        double up = f(user);
        x[i] = before - h;
        double down = f(user);
        x[i] = before;
        *error = fmax(*error, fabs(slope[i] - (up - down) / (2 * h)) / largest);
    }
}

#endif
