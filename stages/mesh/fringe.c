/* Fringe: distances to the border, then to what is far from it. */
#include "mesh/fringe.h"

#include <math.h>
#include <string.h>

#include "geometry/mesh_tools.h"
#include "mesh/mesh_clean.h"

#define BACK 1.5 /* widths: how far the core reaches back to the border; 1 would round its corners off */

typedef struct fringe {
    const npg_mesh *mesh;
    uint8_t *is_border; /* V */
    float *places;      /* V x 3: those that distances are taken to */
    float *dist;        /* V */
} fringe;

static void close_fringe(fringe *f)
{
    npg_release(&f->is_border);
    npg_release(&f->places);
    npg_release(&f->dist);
}

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
    NPG_TRY(npg_alloc(&f->is_border, NPG_FOR_MESH, n));
    NPG_TRY(npg_alloc_array(&f->places, NPG_FOR_MESH, n, 3 * sizeof *f->places));
    NPG_TRY(npg_alloc_array(&f->dist, NPG_FOR_MESH, n, sizeof *f->dist));
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
    fringe f = {.mesh = *mesh};
    uint8_t *keep_face = NULL;
    bool found = false;
    *share = 0;
    npg_status status = find_core(&f, &found, width);
    if (!status && found) status = npg_alloc(&keep_face, NPG_FOR_MESH, (*mesh)->face_count);
    for (size_t i = 0; i < (*mesh)->face_count && !status && found; i++) {
        const uint32_t *face = (*mesh)->faces + 3 * i;
        float farthest = fmaxf(f.dist[face[0]], fmaxf(f.dist[face[1]], f.dist[face[2]]));
        keep_face[i] = (double)farthest <= BACK * width;
    }
    if (!status && found) status = npg_mesh_keep_share(mesh, share, keep_face);
    npg_release(&keep_face);
    close_fringe(&f);
    return status;
}
