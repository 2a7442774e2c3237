/* Cloud: how dense and how noisy a cloud is. */
#include <math.h>
#include <stdlib.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "outlier/normals.h"
#include "pipeline/memory.h"
#include "pipeline/order.h"

#define SPACING_ASKED 20000 /* points at most that are asked for their neighbours */
#define WIDE          24   /* neighbours that a plane goes through: noise with curvature; NPG_AROUND: noise */
#define ASKED_MAX     4000 /* points at most that are asked for their noise */
#define FLAT_LEAST    0.1  /* of the points, that are not of thin parts */

/* Of the distances to k neighbours each the farthest; and of these the median.  Overwrites the list. */
static float median_farthest(float *dist_sq, size_t count, size_t k)
{
    for (size_t i = 0; i < count; i++) dist_sq[i] = dist_sq[k * i + k - 1];
    qsort(dist_sq, count, sizeof *dist_sq, npg_order_float);
    return dist_sq[count / 2];
}

npg_status npg_cloud_spacing(double *spacing, const float *points, size_t n)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    npg_neighbours near;
    size_t k = NPG_AROUND + 1, asked = n < SPACING_ASKED ? n : SPACING_ASKED;
    float *queries = npg_arena_take(&scratch, asked, 3 * sizeof *queries);
    if (queries) npg_points_spread(queries, NULL, asked, points, NULL, n);
    npg_status status = npg_neighbours_take(&near, &scratch, points, n, queries, asked, k);
    if (!status) *spacing = sqrt((double)median_farthest(near.dist_sq, asked, k));
    npg_arena_release(&scratch);
    return status;
}

/* ---- noise ---- */

/* Mean squared distance of the first k of a point's neighbours to their own best plane, without bias. */
static double plane_residual(const float *points, const uint32_t *index, size_t k)
{
    float normal[3], around[3 * WIDE];
    double mean[3] = {0}, sum = 0;
    for (size_t i = 0; i < k; i++)
        for (size_t a = 0; a < 3; a++) {
            around[3 * i + a] = points[3 * (size_t)index[i] + a];
            mean[a] += (double)around[3 * i + a] / (double)k;
        }
    npg_normal_of(normal, around, k);
    for (size_t i = 0; i < k; i++) {
        double off = 0;
        for (size_t a = 0; a < 3; a++) off += (double)normal[a] * ((double)around[3 * i + a] - mean[a]);
        sum += off * off;
    }
    return sum / (double)(k - 3);
}

/* Whether a point has another side among its neighbours. */
static bool is_thin(const float *normals, size_t point, const uint32_t *index)
{
    for (size_t k = 0; k < WIDE; k++)
        if (npg_vec3_dotf(normals + 3 * point, normals + 3 * (size_t)index[k]) < -NPG_SAME_SIDE) return true;
    return false;
}

/* Residuals of the planes through few and through many neighbours, at `asked` points spread over the
 * cloud; *count of them, without those of thin parts where normals are given. */
static npg_status measure_residuals(double *near, double *wide, size_t *count, size_t asked,
                                    const npg_kdtree *tree, const float *points, const float *normals,
                                    size_t n)
{
    uint32_t index[WIDE];
    float dist_sq[WIDE];
    *count = 0;
    for (size_t i = 0; i < asked; i++) {
        size_t point = n * i / asked;
        NPG_TRY(npg_kdtree_nearest(tree, index, dist_sq, points + 3 * point, 1, WIDE, 1));
        if (normals && is_thin(normals, point, index)) continue;
        near[*count] = plane_residual(points, index, NPG_AROUND);
        wide[(*count)++] = plane_residual(points, index, WIDE);
    }
    return NPG_OK;
}

/* residual = sigma^2 + c k^2 for k neighbours: the medians at two k give sigma.  Sorts both lists. */
static double noise_of(double *near, double *wide, size_t count)
{
    qsort(near, count, sizeof *near, npg_order_double);
    qsort(wide, count, sizeof *wide, npg_order_double);
    double ratio = (double)(WIDE * WIDE) / (NPG_AROUND * NPG_AROUND);
    double noise = (ratio * near[count / 2] - wide[count / 2]) / (ratio - 1);
    return noise > 0 ? sqrt(noise) : 0;
}

npg_status npg_cloud_noise(double *sigma, const float *points, const float *normals, size_t n)
{
    npg_arena scratch = {.purpose = NPG_FOR_FRAMES};
    npg_kdtree *tree = NULL;
    size_t asked = n < ASKED_MAX ? n : ASKED_MAX, count = 0;
    *sigma = 0;
    if (n < WIDE) return NPG_OK;
    double *near = npg_arena_take(&scratch, asked, sizeof *near);
    double *wide = npg_arena_take(&scratch, asked, sizeof *wide);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_kdtree_open(&tree, points, n);
    if (!status) status = measure_residuals(near, wide, &count, asked, tree, points, normals, n);
    if (!status && (double)count < FLAT_LEAST * (double)asked)
        status = measure_residuals(near, wide, &count, asked, tree, points, NULL, n);
    if (!status) *sigma = noise_of(near, wide, count);
    npg_kdtree_close(&tree);
    npg_arena_release(&scratch);
    return status;
}
