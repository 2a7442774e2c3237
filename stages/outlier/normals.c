/* Normals: principal components, and the side of a sensor. */
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
    float *const *normals; /* one list per number of neighbours */
    const int *neighbours;
    size_t count;
    const float *points;
} estimate;

/* An npg_kdtree_visit: lists are nearest first, so that fewer neighbours are the beginning of more. */
static void estimate_point(void *user, uint32_t point, const uint32_t *index, const float *dist_sq)
{
    const estimate *e = user;
    float around[3 * NPG_KDTREE_NEIGHBOURS];
    (void)dist_sq;
    for (size_t i = 0, found = 0; i < e->count; i++) {
        for (; found < (size_t)e->neighbours[i] && index[found] != UINT32_MAX; found++)
            memcpy(around + 3 * found, e->points + 3 * (size_t)index[found], 3 * sizeof *around);
        npg_normal_of(e->normals[i] + 3 * (size_t)point, around, found);
    }
}

npg_status npg_normals_estimate_at(float *const *normals, const uint32_t *at, size_t at_count,
                                   const float *points, size_t n, const int *neighbours, size_t count)
{
    npg_kdtree *tree = NULL;
    size_t most = (size_t)neighbours[count - 1];
    estimate e = {.normals = normals, .neighbours = neighbours, .count = count, .points = points};
    npg_arena scratch = {.purpose = NPG_FOR_FRAMES};
    float *queries = npg_arena_take(&scratch, at_count, 3 * sizeof *queries);
    uint32_t *index = npg_arena_take(&scratch, at_count, most * sizeof *index);
    float *dist_sq = npg_arena_take(&scratch, at_count, most * sizeof *dist_sq);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_kdtree_open(&tree, points, n);
    if (!status) npg_rows_gather(queries, points, at, at_count);
    if (!status) status = npg_kdtree_nearest(tree, index, dist_sq, queries, at_count, most, 0);
    for (size_t i = 0; i < at_count && !status; i++)
        estimate_point(&e, (uint32_t)i, index + most * i, dist_sq + most * i);
    npg_kdtree_close(&tree);
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_normals_estimate(float *normals, const float *points, size_t n, int neighbours)
{
    npg_kdtree *tree = NULL;
    estimate e = {.normals = &normals, .neighbours = &neighbours, .count = 1, .points = points};
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
