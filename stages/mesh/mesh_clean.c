/* Mesh clean: trim, main component, decimation. */
#include "mesh/mesh_clean.h"

#include <math.h>
#include <meshoptimizer.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/kdtree.h"
#include "geometry/mesh_tools.h"

#define SPACING_NEIGHBOUR 8

npg_status npg_points_dist(float *dist, const float *queries, size_t query_count, const float *points,
                           size_t point_count)
{
    npg_kdtree *tree = NULL;
    uint32_t *index = NULL;
    npg_status status;
    NPG_TRY(npg_kdtree_open(&tree, points, point_count));
    NPG_TRY_OR(done, status, npg_alloc_array(&index, NPG_FOR_MESH, query_count, sizeof *index));
    NPG_TRY_OR(done, status, npg_kdtree_nearest(tree, index, dist, queries, query_count, 1, 0));
    for (size_t i = 0; i < query_count; i++) dist[i] = sqrtf(dist[i]);
done:
    npg_kdtree_close(&tree);
    npg_release(&index);
    return status;
}

npg_status npg_mesh_point_dist(float *dist, const npg_mesh *mesh, const float *points, size_t point_count)
{
    return npg_points_dist(dist, mesh->vert_pos, mesh->vert_count, points, point_count);
}

static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return x < y ? -1 : x > y;
}

npg_status npg_cloud_spacing(double *spacing, const float *points, size_t n)
{
    npg_kdtree *tree = NULL;
    uint32_t *index = NULL;
    float *dist_sq = NULL, *queries = NULL;
    npg_status status;
    size_t k = SPACING_NEIGHBOUR + 1, asked = n < 20000 ? n : 20000;
    NPG_TRY(npg_kdtree_open(&tree, points, n));
    NPG_TRY_OR(done, status, npg_alloc_array(&queries, NPG_FOR_MESH, asked, 3 * sizeof *queries));
    NPG_TRY_OR(done, status, npg_alloc_array(&index, NPG_FOR_MESH, asked, k * sizeof *index));
    NPG_TRY_OR(done, status, npg_alloc_array(&dist_sq, NPG_FOR_MESH, asked, k * sizeof *dist_sq));
    for (size_t i = 0; i < asked; i++)
        memcpy(queries + 3 * i, points + 3 * (n * i / asked), 3 * sizeof *queries);
    NPG_TRY_OR(done, status, npg_kdtree_nearest(tree, index, dist_sq, queries, asked, k, 0));
    for (size_t i = 0; i < asked; i++) dist_sq[i] = dist_sq[k * i + k - 1];
    qsort(dist_sq, asked, sizeof *dist_sq, by_value);
    *spacing = sqrt((double)dist_sq[asked / 2]);
done:
    npg_kdtree_close(&tree);
    npg_release(&queries);
    npg_release(&index);
    npg_release(&dist_sq);
    return status;
}

/* Keep some faces; *share is the part of the area that goes. */
static npg_status keep(npg_mesh **mesh, double *share, const uint8_t *keep_face)
{
    double total = 0, gone = 0;
    for (size_t f = 0; f < (*mesh)->face_count; f++) {
        double area = npg_face_area((*mesh)->vert_pos, (*mesh)->faces + 3 * f);
        total += area;
        gone += keep_face[f] ? 0 : area;
    }
    *share = total > 0 ? gone / total : 0;
    return npg_mesh_keep_faces(mesh, keep_face);
}

npg_status npg_mesh_trim(npg_mesh **mesh, double *share, const float *points, size_t point_count,
                         double dist_max)
{
    float *dist = NULL;
    uint8_t *keep_face = NULL;
    npg_status status;
    size_t face_count = (*mesh)->face_count;
    NPG_TRY_OR(done, status, npg_alloc_array(&dist, NPG_FOR_MESH, (*mesh)->vert_count, sizeof *dist));
    NPG_TRY_OR(done, status, npg_alloc(&keep_face, NPG_FOR_MESH, face_count));
    NPG_TRY_OR(done, status, npg_mesh_point_dist(dist, *mesh, points, point_count));
    for (size_t f = 0; f < face_count; f++) {
        const uint32_t *face = (*mesh)->faces + 3 * f;
        keep_face[f] = (double)fmaxf(dist[face[0]], fmaxf(dist[face[1]], dist[face[2]])) <= dist_max;
    }
    status = keep(mesh, share, keep_face);
done:
    npg_release(&dist);
    npg_release(&keep_face);
    return status;
}

npg_status npg_mesh_unseen(double *share, const npg_mesh *mesh, const float *points, size_t point_count,
                           double dist_max)
{
    float *dist;
    double total = 0, unseen = 0;
    NPG_TRY(npg_alloc_array(&dist, NPG_FOR_MESH, mesh->vert_count, sizeof *dist));
    npg_status status = npg_mesh_point_dist(dist, mesh, points, point_count);
    for (size_t f = 0; f < mesh->face_count && !status; f++) {
        const uint32_t *face = mesh->faces + 3 * f;
        double area = npg_face_area(mesh->vert_pos, face);
        total += area;
        if ((double)(dist[face[0]] + dist[face[1]] + dist[face[2]]) / 3 > dist_max) unseen += area;
    }
    *share = total > 0 ? unseen / total : 0;
    npg_release(&dist);
    return status;
}

/* is_near[c] = component c has at least area_min of area and a vertex within dist_max of the largest one. */
static npg_status find_near(uint8_t *is_near, const npg_mesh *mesh, const uint32_t *component_of,
                            const double *area, size_t largest, double area_min, double dist_max)
{
    float *main_pos = NULL, *dist = NULL;
    size_t main_count = 0;
    npg_status status;
    NPG_TRY_OR(done, status,
               npg_alloc_array(&main_pos, NPG_FOR_MESH, mesh->vert_count, 3 * sizeof *main_pos));
    NPG_TRY_OR(done, status, npg_alloc_array(&dist, NPG_FOR_MESH, mesh->vert_count, sizeof *dist));
    for (size_t i = 0; i < mesh->vert_count; i++)
        if (component_of[i] == largest)
            memcpy(main_pos + 3 * main_count++, mesh->vert_pos + 3 * i, 3 * sizeof *main_pos);
    NPG_TRY_OR(done, status, npg_points_dist(dist, mesh->vert_pos, mesh->vert_count, main_pos, main_count));
    for (size_t i = 0; i < mesh->vert_count; i++)
        if ((double)dist[i] <= dist_max && area[component_of[i]] >= area_min) is_near[component_of[i]] = 1;
done:
    npg_release(&main_pos);
    npg_release(&dist);
    return status;
}

static npg_status keep_pieces(npg_mesh **mesh, npg_pieces *pieces, const uint32_t *component_of,
                              double share_min, double dist_max)
{
    double *area = NULL, total = 0;
    uint8_t *keep_face = NULL, *is_kept = NULL;
    size_t largest = 0, face_count = (*mesh)->face_count;
    npg_status status;
    NPG_TRY_OR(done, status, npg_alloc_array(&area, NPG_FOR_MESH, pieces->found, sizeof *area));
    NPG_TRY_OR(done, status, npg_alloc(&is_kept, NPG_FOR_MESH, pieces->found));
    NPG_TRY_OR(done, status, npg_alloc(&keep_face, NPG_FOR_MESH, face_count));
    for (size_t f = 0; f < face_count; f++) {
        const uint32_t *face = (*mesh)->faces + 3 * f;
        area[component_of[face[0]]] += npg_face_area((*mesh)->vert_pos, face);
    }
    for (size_t i = 0; i < pieces->found; i++) {
        total += area[i];
        if (area[i] > area[largest]) largest = i;
    }
    if (dist_max > 0 && pieces->found > 1)
        NPG_TRY_OR(done, status,
                   find_near(is_kept, *mesh, component_of, area, largest, share_min * total, dist_max));
    is_kept[largest] = 1;
    for (size_t i = 0; i < pieces->found; i++) pieces->kept += is_kept[i];
    for (size_t f = 0; f < face_count; f++) keep_face[f] = is_kept[component_of[(*mesh)->faces[3 * f]]];
    status = keep(mesh, &pieces->lost_share, keep_face);
done:
    npg_release(&area);
    npg_release(&is_kept);
    npg_release(&keep_face);
    return status;
}

npg_status npg_mesh_keep_main(npg_mesh **mesh, npg_pieces *pieces, double share_min, double dist_max)
{
    uint32_t *component_of;
    *pieces = (npg_pieces){0};
    NPG_TRY(npg_alloc_array(&component_of, NPG_FOR_MESH, (*mesh)->vert_count, sizeof *component_of));
    npg_status status = npg_mesh_components(component_of, &pieces->found, (*mesh)->vert_count, (*mesh)->faces,
                                            (*mesh)->face_count);
    if (!status) status = keep_pieces(mesh, pieces, component_of, share_min, dist_max);
    npg_release(&component_of);
    return status;
}

/* What meshoptimizer takes while it works, roughly: it has no way to refuse politely,
 * so ask for it before. */
static ptrdiff_t decimation_bytes(const npg_mesh *mesh)
{
    return (ptrdiff_t)(mesh->vert_count * 120 + mesh->face_count * 60);
}

npg_status npg_mesh_decimate(npg_mesh **mesh, size_t face_max)
{
    uint32_t *indices;
    size_t old_count = (*mesh)->face_count;
    if (old_count <= face_max) return NPG_OK;
    NPG_TRY(npg_alloc_array(&indices, NPG_FOR_MESH, old_count, 3 * sizeof *indices));
    ptrdiff_t bytes = decimation_bytes(*mesh);
    npg_status status = npg_memory_count(NPG_FOR_MESH, bytes);
    if (!status) {
        size_t count = meshopt_simplify(indices, (*mesh)->faces, 3 * old_count, (*mesh)->vert_pos,
                                        (*mesh)->vert_count, 3 * sizeof(float), 3 * face_max, 1.0f, 0, NULL);
        npg_memory_count(NPG_FOR_MESH, -bytes);
        uint8_t *keep_face;
        status = npg_alloc(&keep_face, NPG_FOR_MESH, old_count);
        if (!status) {
            memcpy((*mesh)->faces, indices, count * sizeof *indices);
            memset(keep_face, 1, count / 3);
            (*mesh)->face_count = count / 3;
            status = npg_mesh_keep_faces(mesh, keep_face);
            npg_release(&keep_face);
        }
    }
    npg_release(&indices);
    return status;
}
