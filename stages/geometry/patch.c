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

npg_status npg_patch_of_sets(npg_patch *patch, uint32_t *parents, const uint8_t *is_marked, const float *pos,
                             const double *weights, size_t count)
{
    double *sums, whole = 0; /* of every set, in the row of its root: weight, weight x position */
    size_t best = count;
    *patch = (npg_patch){0, {NAN, NAN, NAN}, 0};
    NPG_TRY(npg_alloc_array(&sums, NPG_FOR_MESH, count, 4 * sizeof *sums));
    for (size_t i = 0; i < count; i++) {
        double weight = weights ? weights[i] : 1;
        whole += weight;
        if (is_marked && !is_marked[i]) continue;
        double *sum = sums + 4 * (size_t)npg_set_root(parents, (uint32_t)i);
        sum[0] += weight;
        for (size_t a = 0; a < 3; a++) sum[1 + a] += weight * (double)pos[3 * i + a];
    }
    for (size_t i = 0; i < count; i++)
        if (sums[4 * i] > (best < count ? sums[4 * best] : 0)) best = i;
    if (best < count) patch->share = sums[4 * best] / whole;
    for (size_t a = 0; a < 3 && best < count; a++)
        patch->at[a] = (float)(sums[4 * best + 1 + a] / sums[4 * best]);
    for (size_t i = 0; i < count && best < count; i++)
        if ((!is_marked || is_marked[i]) && npg_set_root(parents, (uint32_t)i) == best)
            patch->radius = fmax(patch->radius, npg_vec3_distance(patch->at, pos + 3 * i));
    npg_release(&sums);
    return NPG_OK;
}

npg_status npg_patch_largest(npg_patch *patch, const uint8_t *is_marked, const float *vert_pos,
                             const double *vert_areas, const npg_mesh *mesh)
{
    uint32_t *parents;
    NPG_TRY(npg_alloc_array(&parents, NPG_FOR_MESH, mesh->vert_count, sizeof *parents));
    join_marked(parents, is_marked, mesh);
    npg_status status = npg_patch_of_sets(patch, parents, is_marked, vert_pos, vert_areas, mesh->vert_count);
    npg_release(&parents);
    return status;
}
