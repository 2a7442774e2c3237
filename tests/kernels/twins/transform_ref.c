/* transform: the plain twins of transform.cl, in double, through the rotation matrix. */
#include <math.h>

#include "tests/kernels/twins/twins.h"

#define REACH 0.1 /* as in transform.cl */

/* The unit quaternion (s, x, y, z) of the decoder's first four values; gives the norm it had. */
static double quaternion_of(double q[4], const double out[7])
{
    double t = sqrt(out[1] * out[1] + out[2] * out[2] + out[3] * out[3]), s = 1 + out[0];
    double norm = fmax(sqrt(s * s + t * t), 1e-8);
    q[0] = s / norm;
    for (int i = 1; i < 4; i++) q[i] = out[i] / norm;
    return norm;
}

static void matrix_of(double m[3][3], const double q[4])
{
    double s = q[0], x = q[1], y = q[2], z = q[3];
    const double full[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - s * z), 2 * (x * z + s * y)},
                               {2 * (x * y + s * z), 1 - 2 * (x * x + z * z), 2 * (y * z - s * x)},
                               {2 * (x * z - s * y), 2 * (y * z + s * x), 1 - 2 * (x * x + y * y)}};
    for (int i = 0; i < 9; i++) m[i / 3][i % 3] = full[i / 3][i % 3];
}

void npg_transform_ref(double x[3], const double out[7], const double rest[3])
{
    double q[4], m[3][3];
    quaternion_of(q, out);
    matrix_of(m, q);
    for (int i = 0; i < 3; i++)
        x[i] = m[i][0] * rest[0] + m[i][1] * rest[1] + m[i][2] * rest[2] + tanh(REACH * out[4 + i]);
}

/* dL/dq of the matrix applied to rest, treating the four values as free. */
static void matrix_back(double dq[4], const double g[3], const double q[4], const double rest[3])
{
    double s = q[0], x = q[1], y = q[2], z = q[3];
    const double slope[4][3][3] = {{{0, -2 * z, 2 * y}, {2 * z, 0, -2 * x}, {-2 * y, 2 * x, 0}},
                                   {{0, 2 * y, 2 * z}, {2 * y, -4 * x, -2 * s}, {2 * z, 2 * s, -4 * x}},
                                   {{-4 * y, 2 * x, 2 * s}, {2 * x, 0, 2 * z}, {-2 * s, 2 * z, -4 * y}},
                                   {{-4 * z, -2 * s, 2 * x}, {2 * s, -4 * z, 2 * y}, {2 * x, 2 * y, 0}}};
    for (int k = 0; k < 4; k++) {
        dq[k] = 0;
        for (int i = 0; i < 9; i++) dq[k] += g[i / 3] * slope[k][i / 3][i % 3] * rest[i % 3];
    }
}

void npg_transform_back_ref(double dout[7], const double g[3], const double out[7], const double rest[3])
{
    double q[4], dq[4], along = 0, norm = quaternion_of(q, out);
    matrix_back(dq, g, q, rest);
    for (int i = 0; i < 4; i++) along += dq[i] * q[i];
    for (int i = 0; i < 4; i++) dout[i] = (dq[i] - q[i] * along) / norm;
    for (int i = 0; i < 3; i++) {
        double bound = tanh(REACH * out[4 + i]);
        dout[4 + i] = g[i] * REACH * (1 - bound * bound);
    }
}
