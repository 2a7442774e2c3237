/* Patch: marked vertices that edges join, and the largest such set. */

#include <math.h>

#include "geometry/geometry.h"

static void join_marked(uint32_t *parents, const uint8_t *is_marked, const npg_mesh *mesh)
{
    for (size_t i = 0; i < mesh->vert_count; i++) parents[i] = (uint32_t)i;
    for (size_t f = 0; f < mesh->face_count; f++)
        for (size_t k = 0; k < 3; k++) {
            uint32_t a = mesh->faces[3 * f + k], b = mesh->faces[3 * f + (k + 1) % 3];
            if (is_marked[a] && is_marked[b]) npg_set_join(parents, a, b);
        }
}

/* Area and area x position of every set, in the row of its root; the root of the largest, V where there is
 * none.  *whole: the area of all vertices. */
static size_t sum_sets(double *sums, double *whole, uint32_t *parents, const uint8_t *is_marked,
                       const float *vert_pos, const double *vert_areas, size_t v)
{
    size_t best = v;
    *whole = 0;
    for (size_t i = 0; i < v; i++) {
        *whole += vert_areas[i];
        if (!is_marked[i]) continue;
        double *sum = sums + 4 * (size_t)npg_set_root(parents, (uint32_t)i);
        sum[0] += vert_areas[i];
        for (size_t a = 0; a < 3; a++) sum[1 + a] += vert_areas[i] * (double)vert_pos[3 * i + a];
    }
    for (size_t i = 0; i < v; i++)
        if (sums[4 * i] > (best < v ? sums[4 * best] : 0)) best = i;
    return best;
}

static double farthest(const float at[3], uint32_t *parents, size_t root, const uint8_t *is_marked,
                       const float *vert_pos, size_t v)
{
    double most = 0;
    for (size_t i = 0; i < v; i++)
        if (is_marked[i] && npg_set_root(parents, (uint32_t)i) == root)
            most = fmax(most, npg_vec3_distance(at, vert_pos + 3 * i));
    return most;
}

npg_status npg_patch_largest(npg_patch *patch, const uint8_t *is_marked, const float *vert_pos,
                             const double *vert_areas, const npg_mesh *mesh)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    size_t v = mesh->vert_count, best = v;
    double whole;
    uint32_t *parents = npg_arena_take(&scratch, v, sizeof *parents);
    double *sums = npg_arena_take(&scratch, v, 4 * sizeof *sums);
    *patch = (npg_patch){0, {NAN, NAN, NAN}, 0};
    npg_status status = npg_arena_status(&scratch);
    if (!status) {
        join_marked(parents, is_marked, mesh);
        best = sum_sets(sums, &whole, parents, is_marked, vert_pos, vert_areas, v);
    }
    if (!status && best < v) {
        patch->share = sums[4 * best] / whole;
        for (size_t a = 0; a < 3; a++) patch->at[a] = (float)(sums[4 * best + 1 + a] / sums[4 * best]);
        patch->radius = farthest(patch->at, parents, best, is_marked, vert_pos, v);
    }
    npg_arena_release(&scratch);
    return status;
}
