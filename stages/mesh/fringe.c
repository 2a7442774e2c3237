/* Fringe: distances to the border, then to what is far from it. */
#include "mesh/fringe.h"

#include <string.h>

#include "geometry/mesh_tools.h"
#include "mesh/mesh_clean.h"

#define BACK 1.5 /* widths: how far the core reaches back to the border; 1 would round its corners off */

typedef struct fringe {
    const npg_mesh *mesh;
    npg_arena arena;
    uint8_t *is_border; /* V */
    float *places;      /* V x 3: those that distances are taken to */
    float *dist;        /* V */
} fringe;

/* Distances of all vertices to those whose mask is not 0; *count: how many these are. */
static npg_status measure(fringe *f, size_t *count, const uint8_t *mask)
{
    const npg_mesh *mesh = f->mesh;
    memcpy(f->places, mesh->vert_pos, mesh->vert_count * 3 * sizeof *f->places);
    *count = npg_points_keep(f->places, NULL, mesh->vert_count, mask);
    return *count ? npg_points_dist(f->dist, mesh->vert_pos, mesh->vert_count, f->places, *count) : NPG_OK;
}

/* *found: whether there are border and core; then f->dist are the distances from the core. */
static npg_status find_core(fringe *f, bool *found, double width)
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

npg_status npg_mesh_drop_fringe(npg_mesh **mesh, double *share, double width)
{
    fringe f = {.mesh = *mesh, .arena.purpose = NPG_FOR_MESH};
    uint8_t *keep_face = npg_arena_take(&f.arena, (*mesh)->face_count, 1);
    bool found = false;
    *share = 0;
    npg_status status = find_core(&f, &found, width);
    for (size_t i = 0; i < (*mesh)->face_count && !status && found; i++)
        keep_face[i] = (double)npg_farthest_corner(f.dist, (*mesh)->faces + 3 * i) <= BACK * width;
    if (!status && found) status = npg_mesh_keep_share(mesh, share, keep_face);
    npg_arena_release(&f.arena);
    return status;
}
