/* nearest: the plain twin of nearest.cl, in double: compares with every point. */
#include "tests/kernels/twins/twins.h"

size_t npg_nearest_ref(double *dist_sq, const double query[3], const double *points, size_t count)
{
    size_t best = 0;
    for (size_t i = 0; i < count; i++) {
        double sum = 0;
        for (size_t axis = 0; axis < 3; axis++) {
            double d = points[3 * i + axis] - query[axis];
            sum += d * d;
        }
        if (i == 0 || sum < *dist_sq) {
            *dist_sq = sum;
            best = i;
        }
    }
    return best;
}
