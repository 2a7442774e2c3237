/* Resurface: Poisson twice, with the sides that the first surface says. */
#include "mesh/mesh_internal.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "geometry/geometry.h"

/* The side of the surface at its point nearest to p, against n: smoothed normals, weighted by the hit. */
static float side_at(const npg_mesh *mesh, const npg_surface_hit *hit, const float *n)
{
    float sum = 0;
    for (size_t k = 0; k < 3; k++) {
        const float *v = mesh->vert_normals + 3 * (size_t)mesh->faces[3 * (size_t)hit->face + k];
        sum += hit->weights[k] * npg_vec3_dotf(v, n);
    }
    return sum;
}

static npg_status turn_to_surface(size_t *turned, float *normals, const npg_mesh *mesh, const float *points,
                                  size_t n)
{
    npg_surface_hit *hits;
    *turned = 0;
    NPG_TRY(npg_alloc_array(&hits, NPG_FOR_MESH, n, sizeof *hits));
    npg_status status = npg_mesh_closest(hits, mesh, points, n);
    for (size_t i = 0; i < n && !status; i++) {
        if (side_at(mesh, &hits[i], normals + 3 * i) >= -NPG_SAME_SIDE) continue;
        for (size_t a = 0; a < 3; a++) normals[3 * i + a] = -normals[3 * i + a];
        ++*turned;
    }
    npg_release(&hits);
    return status;
}

static npg_status draw_twice(npg_mesh **mesh, size_t *turned, float *normals, const float *points, size_t n,
                             const npg_poisson_settings *settings)
{
    npg_poisson_settings quick = *settings;
    if (quick.depth > NPG_DRAFT_DEPTH) quick.depth = NPG_DRAFT_DEPTH;
    NPG_TRY(npg_poisson(mesh, points, normals, n, &quick));
    npg_status status = npg_mesh_make_normals(*mesh);
    if (!status) status = turn_to_surface(turned, normals, *mesh, points, n);
    npg_release(&(*mesh)->vert_normals);
    bool is_draft_alone = settings->depth <= NPG_DRAFT_DEPTH;
    if (status || !is_draft_alone) npg_mesh_unref(mesh);
    return status || is_draft_alone ? status : npg_poisson(mesh, points, normals, n, settings);
}

npg_status npg_resurface(npg_mesh **mesh, size_t *moved, size_t *turned, float *normals, const float *points,
                         size_t n, double spacing, const npg_poisson_settings *settings)
{
    npg_gap_widening gaps;
    *mesh = NULL;
    *moved = 0;
    if (settings->gaps == NPG_GAPS_KEPT) return draw_twice(mesh, turned, normals, points, n, settings);
    NPG_TRY(npg_gaps_widen(&gaps, points, normals, n, spacing, settings->gaps));
    *moved = gaps.moved;
    npg_status status = draw_twice(mesh, turned, normals, gaps.shifted, n, settings);
    if (!status) status = npg_gaps_bring_back(&gaps, *mesh);
    if (status) npg_mesh_unref(mesh);
    npg_gaps_close(&gaps);
    return status;
}
