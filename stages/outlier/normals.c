/* Normals: principal components, the side of a sensor, and that of the winding number. */
#include "outlier/normals.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "kernels/jacobi.h"
#include "pipeline/frame_box.h"
#include "pipeline/memory.h"

#define JACOBI_ROUNDS 12 /* sweeps, more than a 3 x 3 matrix needs */

/* ---- smallest eigenvector of a symmetric 3 x 3 matrix ---- */

static void smallest_axis(float axis[3], double m[3][3])
{
    double v[3][3];
    npg_jacobi(m[0], v[0], 3, JACOBI_ROUNDS);
    int least = m[0][0] <= m[1][1] ? 0 : 1;
    if (m[2][2] < m[least][least]) least = 2;
    double length = sqrt(v[0][least] * v[0][least] + v[1][least] * v[1][least] + v[2][least] * v[2][least]);
    for (int a = 0; a < 3; a++) axis[a] = (float)(v[a][least] / length);
}

/* ---- estimate ---- */

void npg_normal_of(float normal[3], const float *points, size_t count)
{
    double mean[3] = {0}, m[3][3] = {{0}};
    for (size_t i = 0; i < 3 * count; i++) mean[i % 3] += (double)points[i] / (double)count;
    for (size_t i = 0; i < count; i++) {
        double d[3];
        for (size_t a = 0; a < 3; a++) d[a] = (double)points[3 * i + a] - mean[a];
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) m[a][b] += d[a] * d[b];
    }
    smallest_axis(normal, m);
}

typedef struct estimate {
    float *normals;
    size_t neighbours;
    const float *points;
} estimate;

/* An npg_kdtree_visit. */
static void estimate_point(void *user, uint32_t point, const uint32_t *index, const float *dist_sq)
{
    const estimate *e = user;
    float around[3 * NPG_KDTREE_NEIGHBOURS];
    size_t found = 0;
    (void)dist_sq;
    for (; found < e->neighbours && index[found] != UINT32_MAX; found++)
        memcpy(around + 3 * found, e->points + 3 * (size_t)index[found], 3 * sizeof *around);
    npg_normal_of(e->normals + 3 * (size_t)point, around, found);
}

npg_status npg_normals_estimate(float *normals, const float *points, size_t n, int neighbours)
{
    npg_kdtree *tree = NULL;
    estimate e = {.normals = normals, .neighbours = (size_t)neighbours, .points = points};
    NPG_REQUIRE(neighbours >= 3 && neighbours <= NPG_KDTREE_NEIGHBOURS);
    NPG_TRY(npg_kdtree_open(&tree, points, n));
    npg_status status = npg_kdtree_each(tree, (size_t)neighbours, NULL, estimate_point, &e, 0);
    npg_kdtree_close(&tree);
    return status;
}

/* ---- sensor ---- */

void npg_normals_face_sensor(float *normals, size_t *flipped, const float *points, size_t n,
                             const double sensor[3])
{
    *flipped = 0;
    for (size_t i = 0; i < n; i++) {
        double toward = 0;
        for (size_t a = 0; a < 3; a++)
            toward += (double)normals[3 * i + a] * (sensor[a] - (double)points[3 * i + a]);
        if (toward >= 0) continue;
        for (size_t a = 0; a < 3; a++) normals[3 * i + a] = -normals[3 * i + a];
        ++*flipped;
    }
}

/* ---- winding number ---- */

static npg_status turn_to_field(float *normals, size_t *flipped, const float *points, const float *given,
                                size_t n)
{
    float *field;
    *flipped = 0;
    NPG_TRY(npg_alloc_array(&field, NPG_FOR_FRAMES, n, 3 * sizeof *field));
    memcpy(field, normals, n * 3 * sizeof *field);
    npg_status status = npg_winding_normals(field, points, given, n);
    for (size_t i = 0; i < n && !status; i++) {
        if (npg_vec3_dotf(normals + 3 * i, field + 3 * i) >= 0) continue;
        for (size_t a = 0; a < 3; a++) normals[3 * i + a] = -normals[3 * i + a];
        ++*flipped;
    }
    npg_release(&field);
    return status;
}

/* Of large clouds the field has sides, but directions only as coarse as the points it is made of. */
npg_status npg_normals_make(float *normals, const float *points, size_t n)
{
    size_t flipped;
    NPG_TRY(npg_normals_estimate(normals, points, n, NPG_NEIGHBOURS));
    if (npg_winding_is_whole(n)) return npg_winding_normals(normals, points, NULL, n);
    return turn_to_field(normals, &flipped, points, NULL, n);
}

npg_status npg_normals_mend(float *normals, size_t *flipped, const float *points, size_t n)
{
    return turn_to_field(normals, flipped, points, normals, n);
}
