/* Apart: shifts of points that face each other, and the way back. */
#include "apart.h"

#include <math.h>
#include <string.h>

#include "contact.h"
#include "kdtree.h"

#define NEIGHBOURS    48  /* in which a facing point is looked for */
#define WIDE_SPACINGS 1.5 /* a gap that survives                   */
#define SMOOTH_OVER   12  /* neighbours                            */
#define SMOOTH_ROUNDS 3
#define BACK_OVER     6 /* points around a vertex */

/* ---- gaps ---- */

static float push_of(size_t i, const uint32_t *near, const float *dist_sq, const float *points,
                     const float *normals, size_t n, double wide)
{
    for (size_t k = 0; k < NEIGHBOURS && near[k] < n; k++) {
        double gap = sqrt((double)dist_sq[k]);
        if (gap >= wide) break;
        if (near[k] == i) continue;
        size_t j = near[k];
        if (npg_points_face(points + 3 * i, normals + 3 * i, points + 3 * j, normals + 3 * j))
            return (float)((wide - gap) / 2);
    }
    return 0;
}

/* A point takes the mean push of its neighbours on the same side, if that is more than its own. */
static void smooth(float *out, const float *push, const uint32_t *near, const float *normals, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        float sum = 0, weight = 0;
        for (size_t k = 0; k < SMOOTH_OVER; k++) {
            size_t j = near[NEIGHBOURS * i + k];
            if (j >= n) break;
            const float *a = normals + 3 * i, *b = normals + 3 * j;
            if (a[0] * b[0] + a[1] * b[1] + a[2] * b[2] < 0.3f) continue;
            sum += push[j];
            weight += 1;
        }
        out[i] = weight > 0 ? fmaxf(push[i], sum / weight) : push[i];
    }
}

npg_status npg_cloud_apart(float *shift, size_t *moved, const float *points, const float *normals, size_t n,
                           double spacing)
{
    npg_kdtree *tree = NULL;
    float *dist_sq = NULL, *push = NULL, *smoothed = NULL;
    uint32_t *near = NULL;
    npg_status status;
    *moved = 0;
    NPG_REQUIRE(n && spacing > 0);
    NPG_TRY_OR(done, status, npg_alloc_array(&dist_sq, NPG_FOR_MESH, n, NEIGHBOURS * sizeof(float)));
    NPG_TRY_OR(done, status, npg_alloc_array(&near, NPG_FOR_MESH, n, NEIGHBOURS * sizeof(uint32_t)));
    NPG_TRY_OR(done, status, npg_alloc_array(&push, NPG_FOR_MESH, n, sizeof(float)));
    NPG_TRY_OR(done, status, npg_alloc_array(&smoothed, NPG_FOR_MESH, n, sizeof(float)));
    NPG_TRY_OR(done, status, npg_kdtree_open(&tree, points, n));
    NPG_TRY_OR(done, status, npg_kdtree_nearest(tree, near, dist_sq, points, n, NEIGHBOURS, 0));
    for (size_t i = 0; i < n; i++)
        push[i] = push_of(i, near + NEIGHBOURS * i, dist_sq + NEIGHBOURS * i, points, normals, n,
                          WIDE_SPACINGS * spacing);
    for (int round = 0; round < SMOOTH_ROUNDS; round++) {
        smooth(smoothed, push, near, normals, n);
        memcpy(push, smoothed, n * sizeof(float));
    }
    for (size_t i = 0; i < n; i++) {
        *moved += push[i] > 0;
        for (size_t a = 0; a < 3; a++) shift[3 * i + a] = -push[i] * normals[3 * i + a];
    }
done:
    npg_kdtree_close(&tree);
    npg_release(&dist_sq);
    npg_release(&near);
    npg_release(&push);
    npg_release(&smoothed);
    return status;
}

/* ---- back ---- */

npg_status npg_mesh_move_back(npg_mesh *mesh, const float *shifted, const float *shift, size_t n)
{
    npg_kdtree *tree = NULL;
    float *dist_sq = NULL;
    uint32_t *near = NULL;
    npg_status status;
    size_t v = mesh->vert_count;
    NPG_TRY_OR(done, status, npg_alloc_array(&dist_sq, NPG_FOR_MESH, v, BACK_OVER * sizeof(float)));
    NPG_TRY_OR(done, status, npg_alloc_array(&near, NPG_FOR_MESH, v, BACK_OVER * sizeof(uint32_t)));
    NPG_TRY_OR(done, status, npg_kdtree_open(&tree, shifted, n));
    NPG_TRY_OR(done, status, npg_kdtree_nearest(tree, near, dist_sq, mesh->vert_pos, v, BACK_OVER, 0));
    for (size_t i = 0; i < v; i++) {
        float sum[3] = {0}, weight = 0, scale = dist_sq[BACK_OVER * i] + 1e-12f;
        for (size_t k = 0; k < BACK_OVER && near[BACK_OVER * i + k] < n; k++) {
            float w = scale / (dist_sq[BACK_OVER * i + k] + scale);
            for (size_t a = 0; a < 3; a++) sum[a] += w * shift[3 * (size_t)near[BACK_OVER * i + k] + a];
            weight += w;
        }
        for (size_t a = 0; a < 3 && weight > 0; a++) mesh->vert_pos[3 * i + a] -= sum[a] / weight;
    }
done:
    npg_kdtree_close(&tree);
    npg_release(&dist_sq);
    npg_release(&near);
    return status;
}
