/* Rigid: the rotation and translation that take one set of points closest to another. */
#include "geometry/geometry.h"

#include "kernels/jacobi.h"

#define JACOBI_ROUNDS 24 /* sweeps, more than a 4 x 4 matrix needs */

static void mean_of(double mean[3], const float *points, size_t count)
{
    for (size_t a = 0; a < 3; a++) {
        mean[a] = 0;
        for (size_t i = 0; i < count; i++) mean[a] += (double)points[3 * i + a];
        if (count) mean[a] /= (double)count;
    }
}

static void largest_eigenvector(double out[4], double m[4][4])
{
    double v[4][4];
    int best = 0;
    npg_jacobi(m[0], v[0], 4, JACOBI_ROUNDS);
    for (int k = 1; k < 4; k++)
        if (m[k][k] > m[best][best]) best = k;
    for (int k = 0; k < 4; k++) out[k] = v[k][best];
}

/* Products s[a][b] = sum (from - mean)_a (to - mean)_b into Horn's 4 x 4 matrix. */
static void fill_matrix(double m[4][4], double s[3][3])
{
    m[0][0] = s[0][0] + s[1][1] + s[2][2];
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;
        m[0][a + 1] = m[a + 1][0] = s[b][c] - s[c][b];
        m[a + 1][a + 1] = s[a][a] - s[b][b] - s[c][c];
        m[a + 1][b + 1] = m[b + 1][a + 1] = s[a][b] + s[b][a];
    }
}

static void rotation_of(double r[3][3], const double q[4])
{
    double w = q[0], x = q[1], y = q[2], z = q[3];
    const double rows[3][3] = {{w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
                               {2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)},
                               {2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z}};
    double length_sq = w * w + x * x + y * y + z * z;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) r[a][b] = rows[a][b] / length_sq;
}

void npg_rigid_fit(double rotation[3][3], double translation[3], const float *from, const float *to,
                   size_t count)
{
    double mean_from[3], mean_to[3], s[3][3] = {{0}}, m[4][4], q[4];
    mean_of(mean_from, from, count);
    mean_of(mean_to, to, count);
    for (size_t i = 0; i < count; i++)
        for (size_t a = 0; a < 3; a++)
            for (size_t b = 0; b < 3; b++)
                s[a][b] += ((double)from[3 * i + a] - mean_from[a]) * ((double)to[3 * i + b] - mean_to[b]);
    fill_matrix(m, s);
    largest_eigenvector(q, m);
    rotation_of(rotation, q);
    for (int a = 0; a < 3; a++) {
        translation[a] = mean_to[a];
        for (int b = 0; b < 3; b++) translation[a] -= rotation[a][b] * mean_from[b];
    }
}
