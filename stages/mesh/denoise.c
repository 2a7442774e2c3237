/* Denoise: a smoother version of an oriented cloud. */
#include "mesh/mesh_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/memory.h"

#define BATCH       4096
#define SUPPORT_MIN 9 /* neighbours of the same sheet that a quadric takes */
#define TERMS       6

/* The quadric's height and slope at the point itself, from the neighbours of its side. */
static void fit(float *out_point, float *out_normal, size_t i, const float *points, const float *normals,
                const uint32_t *index, const float *dist_sq, size_t k)
{
    const float *p = points + 3 * i, *n = normals + 3 * i;
    double x[3], y[3], m[TERMS * TERMS] = {0}, b[TERMS] = {0}, r = sqrt((double)dist_sq[k - 1]);
    size_t support = 0;
    npg_vec3_span_plane(x, y, (const double[3]){(double)n[0], (double)n[1], (double)n[2]});
    for (size_t j = 0; j < k && r > 0; j++) {
        const float *q = points + 3 * (size_t)index[j], *o = normals + 3 * (size_t)index[j];
        if (npg_vec3_dotf(n, o) < NPG_SAME_SIDE) continue;
        double u = 0, v = 0, h = 0, weight = exp(-2 * (double)dist_sq[j] / (r * r));
        for (int a = 0; a < 3; a++) {
            double d = ((double)q[a] - (double)p[a]) / r;
            u += d * x[a];
            v += d * y[a];
            h += d * (double)n[a];
        }
        const double terms[TERMS] = {1, u, v, u * u, u * v, v * v};
        for (int s = 0; s < TERMS; s++) {
            b[s] += weight * terms[s] * h;
            for (int t = 0; t < TERMS; t++) m[TERMS * s + t] += weight * terms[s] * terms[t];
        }
        support++;
    }
    memcpy(out_point, p, 3 * sizeof *p);
    memcpy(out_normal, n, 3 * sizeof *n);
    if (support < SUPPORT_MIN) return;
    npg_cholesky_factor(m, TERMS, 0);
    npg_cholesky_solve(m, TERMS, b);
    if (!(fabs(b[0]) < 0.5)) return; /* or the neighbours leave the quadric open: no number */
    double length = sqrt(1 + b[1] * b[1] + b[2] * b[2]);
    for (int a = 0; a < 3; a++) {
        out_point[a] = (float)((double)p[a] + r * b[0] * (double)n[a]);
        out_normal[a] = (float)(((double)n[a] - b[1] * x[a] - b[2] * y[a]) / length);
    }
}

npg_status npg_cloud_smooth(float *points, float *normals, size_t n, int neighbours)
{
    npg_arena scratch = {.purpose = NPG_FOR_FRAMES};
    npg_kdtree *tree = NULL;
    size_t k = (size_t)neighbours < n ? (size_t)neighbours : n;
    uint32_t *index = npg_arena_take(&scratch, BATCH, k * sizeof *index);
    float *dist_sq = npg_arena_take(&scratch, BATCH, k * sizeof *dist_sq);
    float *new_points = npg_arena_take(&scratch, n, 3 * sizeof *new_points);
    float *new_normals = npg_arena_take(&scratch, n, 3 * sizeof *new_normals);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_kdtree_open(&tree, points, n);
    for (size_t first = 0; first < n && !status; first += BATCH) {
        size_t count = n - first < BATCH ? n - first : BATCH;
        status = npg_kdtree_nearest(tree, index, dist_sq, points + 3 * first, count, k, 0);
        for (size_t i = 0; i < count && !status; i++)
            fit(new_points + 3 * (first + i), new_normals + 3 * (first + i), first + i, points, normals,
                index + k * i, dist_sq + k * i, k);
    }
    if (!status) memcpy(points, new_points, n * 3 * sizeof *points);
    if (!status) memcpy(normals, new_normals, n * 3 * sizeof *normals);
    npg_kdtree_close(&tree);
    npg_arena_release(&scratch);
    return status;
}
