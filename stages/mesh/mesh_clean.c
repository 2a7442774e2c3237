/* Mesh clean: trim, main component, decimation. */
#include "mesh/mesh_internal.h"

#include <math.h>
#include <meshoptimizer.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"

npg_status npg_points_dist(float *dist, const float *queries, size_t query_count, const float *points,
                           size_t point_count)
{
    uint32_t *index;
    NPG_TRY(npg_alloc_array(&index, NPG_FOR_MESH, query_count, sizeof *index));
    npg_status status = npg_points_nearest(index, dist, points, point_count, queries, query_count, 1);
    for (size_t i = 0; i < query_count && !status; i++) dist[i] = sqrtf(dist[i]);
    npg_release(&index);
    return status;
}

npg_status npg_mesh_keep_share(npg_mesh **mesh, double *share, const uint8_t *keep_face)
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

static float farthest_corner(const float *dist, const uint32_t face[3])
{
    return fmaxf(dist[face[0]], fmaxf(dist[face[1]], dist[face[2]]));
}

npg_status npg_mesh_trim(npg_mesh **mesh, double *share, const float *points, size_t point_count,
                         double dist_max)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    size_t face_count = (*mesh)->face_count;
    float *dist = npg_arena_take(&scratch, (*mesh)->vert_count, sizeof *dist);
    uint8_t *keep_face = npg_arena_take(&scratch, face_count, 1);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_points_dist(dist, (*mesh)->vert_pos, (*mesh)->vert_count, points, point_count);
    for (size_t f = 0; f < face_count && !status; f++)
        keep_face[f] = (double)farthest_corner(dist, (*mesh)->faces + 3 * f) <= dist_max;
    if (!status) status = npg_mesh_keep_share(mesh, share, keep_face);
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_mesh_unseen(double *share, const npg_mesh *mesh, const float *points, size_t point_count,
                           double dist_max)
{
    float *dist;
    double total = 0, unseen = 0;
    NPG_TRY(npg_alloc_array(&dist, NPG_FOR_MESH, mesh->vert_count, sizeof *dist));
    npg_status status = npg_points_dist(dist, mesh->vert_pos, mesh->vert_count, points, point_count);
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
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    float *main_pos = npg_arena_take(&scratch, mesh->vert_count, 3 * sizeof *main_pos);
    float *dist = npg_arena_take(&scratch, mesh->vert_count, sizeof *dist);
    size_t main_count = 0;
    npg_status status = npg_arena_status(&scratch);
    for (size_t i = 0; i < mesh->vert_count && !status; i++)
        if (component_of[i] == largest)
            memcpy(main_pos + 3 * main_count++, mesh->vert_pos + 3 * i, 3 * sizeof *main_pos);
    if (!status) status = npg_points_dist(dist, mesh->vert_pos, mesh->vert_count, main_pos, main_count);
    for (size_t i = 0; i < mesh->vert_count && !status; i++)
        if ((double)dist[i] <= dist_max && area[component_of[i]] >= area_min) is_near[component_of[i]] = 1;
    npg_arena_release(&scratch);
    return status;
}

/* is_kept of each component: the largest, and what is near it. */
static npg_status choose_pieces(uint8_t *is_kept, double *area, const npg_mesh *mesh, size_t count,
                                const uint32_t *component_of, double size)
{
    double total = 0;
    size_t largest = 0;
    for (size_t f = 0; f < mesh->face_count; f++) {
        const uint32_t *face = mesh->faces + 3 * f;
        area[component_of[face[0]]] += npg_face_area(mesh->vert_pos, face);
    }
    for (size_t i = 0; i < count; i++) {
        total += area[i];
        if (area[i] > area[largest]) largest = i;
    }
    if (size > 0 && count > 1)
        NPG_TRY(find_near(is_kept, mesh, component_of, area, largest, NPG_PIECE_SHARE * total,
                          NPG_NEARBY_SHARE * size));
    is_kept[largest] = 1;
    return NPG_OK;
}

npg_status npg_mesh_keep_main(npg_mesh **mesh, npg_pieces *pieces, double size)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    size_t v = (*mesh)->vert_count, face_count = (*mesh)->face_count;
    *pieces = (npg_pieces){0};
    if (!face_count) return NPG_OK;
    uint32_t *component_of = npg_arena_take(&scratch, v, sizeof *component_of);
    uint8_t *keep_face = npg_arena_take(&scratch, face_count, 1);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_mesh_components(component_of, &pieces->found, v, (*mesh)->faces, face_count);
    double *area = npg_arena_take(&scratch, pieces->found, sizeof *area);
    uint8_t *is_kept = npg_arena_take(&scratch, pieces->found, 1);
    if (!status) status = npg_arena_status(&scratch);
    if (!status) status = choose_pieces(is_kept, area, *mesh, pieces->found, component_of, size);
    for (size_t i = 0; i < pieces->found && !status; i++) pieces->kept += is_kept[i];
    for (size_t f = 0; f < face_count && !status; f++)
        keep_face[f] = is_kept[component_of[(*mesh)->faces[3 * f]]];
    if (!status) status = npg_mesh_keep_share(mesh, &pieces->lost_share, keep_face);
    npg_arena_release(&scratch);
    return status;
}

/* What meshoptimizer takes while it works, roughly: it has no way to refuse politely,
 * so ask for it before. */
static ptrdiff_t decimation_bytes(const npg_mesh *mesh)
{
    return (ptrdiff_t)(mesh->vert_count * 120 + mesh->face_count * 60);
}

static npg_status simplify(uint32_t *indices, size_t *count, const npg_mesh *mesh, size_t face_max)
{
    ptrdiff_t bytes = decimation_bytes(mesh);
    NPG_TRY(npg_memory_count(NPG_FOR_MESH, bytes));
    *count = meshopt_simplify(indices, mesh->faces, 3 * mesh->face_count, mesh->vert_pos, mesh->vert_count,
                              3 * sizeof(float), 3 * face_max, 1.0f, 0, NULL);
    return npg_memory_count(NPG_FOR_MESH, -bytes);
}

npg_status npg_mesh_decimate(npg_mesh **mesh, size_t face_max)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    size_t old_count = (*mesh)->face_count, count = 0;
    if (old_count <= face_max) return NPG_OK;
    uint32_t *indices = npg_arena_take(&scratch, old_count, 3 * sizeof *indices);
    uint8_t *keep_face = npg_arena_take(&scratch, old_count, 1);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = simplify(indices, &count, *mesh, face_max);
    if (!status) {
        memcpy((*mesh)->faces, indices, count * sizeof *indices);
        memset(keep_face, 1, count / 3);
        (*mesh)->face_count = count / 3;
        status = npg_mesh_keep_faces(mesh, keep_face); /* drops the vertices that no face uses any more */
    }
    npg_arena_release(&scratch);
    return status;
}

/* ---- shreds along an open boundary ---- */

#define BACK 1.5 /* widths: how far the core reaches back to the border; 1 would round its corners off */

typedef struct boundary {
    const npg_mesh *mesh;
    npg_arena arena;
    uint8_t *is_border; /* V */
    float *places;      /* V x 3: those that distances are taken to */
    float *dist;        /* V */
} boundary;

/* Distances of all vertices to those whose mask is not 0; *count: how many these are. */
static npg_status measure(boundary *f, size_t *count, const uint8_t *mask)
{
    const npg_mesh *mesh = f->mesh;
    memcpy(f->places, mesh->vert_pos, mesh->vert_count * 3 * sizeof *f->places);
    *count = npg_points_keep(f->places, NULL, mesh->vert_count, mask);
    return *count ? npg_points_dist(f->dist, mesh->vert_pos, mesh->vert_count, f->places, *count) : NPG_OK;
}

/* *found: whether there are border and core; then f->dist are the distances from the core. */
static npg_status find_core(boundary *f, bool *found, double width)
{
    size_t n = f->mesh->vert_count, count;
    f->is_border = npg_arena_take(&f->arena, n, 1);
    f->places = npg_arena_take(&f->arena, n, 3 * sizeof *f->places);
    f->dist = npg_arena_take(&f->arena, n, sizeof *f->dist);
    NPG_TRY(npg_arena_status(&f->arena));
    NPG_TRY(npg_mesh_border(f->is_border, found, f->mesh));
    if (!*found) return NPG_OK;
    NPG_TRY(measure(f, &count, f->is_border));
    uint8_t *is_core = f->is_border; /* no longer needed */
    for (size_t v = 0; v < n; v++) is_core[v] = (double)f->dist[v] > width;
    NPG_TRY(measure(f, &count, is_core));
    *found = count > 0;
    return NPG_OK;
}

npg_status npg_mesh_trim_shreds(npg_mesh **mesh, double *share, double width)
{
    boundary f = {.mesh = *mesh, .arena.purpose = NPG_FOR_MESH};
    uint8_t *keep_face = npg_arena_take(&f.arena, (*mesh)->face_count, 1);
    bool found = false;
    *share = 0;
    npg_status status = find_core(&f, &found, width);
    for (size_t i = 0; i < (*mesh)->face_count && !status && found; i++)
        keep_face[i] = (double)farthest_corner(f.dist, (*mesh)->faces + 3 * i) <= BACK * width;
    if (!status && found) status = npg_mesh_keep_share(mesh, share, keep_face);
    npg_arena_release(&f.arena);
    return status;
}
