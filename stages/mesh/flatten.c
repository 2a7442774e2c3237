/* Flatten: Gauss and Seidel's sweeps over the unseen vertices, in their order. */
#include "mesh/flatten.h"

#include <math.h>

#include "geometry/mesh_tools.h"
#include "mesh/mesh_clean.h"

#define SWEEPS_MOST 400
#define RELAXATION  1.7  /* beyond the mean: successive over-relaxation */
#define SETTLED     1e-5 /* of the unit box: a sweep that moves nothing farther ends it */

/* How far the vertex went. */
static double relax(npg_mesh *mesh, const npg_mesh_neighbours *r, size_t v)
{
    double mean[3] = {0, 0, 0}, moved = 0;
    size_t count = r->start[v + 1] - r->start[v];
    for (uint32_t i = r->start[v]; i < r->start[v + 1]; i++)
        for (size_t a = 0; a < 3; a++) mean[a] += (double)mesh->vert_pos[3 * (size_t)r->of[i] + a];
    for (size_t a = 0; a < 3 && count; a++) {
        float *x = &mesh->vert_pos[3 * v + a];
        double step = RELAXATION * (mean[a] / (double)count - (double)*x);
        *x += (float)step;
        moved += step * step;
    }
    return sqrt(moved);
}

enum { STAYS, UNSEEN, MOVES };

/* Unseen vertices move where their piece of the mesh has seen ones; without any they would fall into a point.
 * `ends` (V) is for the vertices that are reached. */
static size_t reach(uint8_t *kind, uint32_t *ends, const npg_mesh_neighbours *r, size_t n)
{
    size_t count = 0, moved = 0;
    for (size_t v = 0; v < n; v++)
        if (kind[v] == STAYS) ends[count++] = (uint32_t)v;
    for (size_t i = 0; i < count; i++)
        for (uint32_t at = r->start[ends[i]]; at < r->start[ends[i] + 1]; at++) {
            uint32_t v = r->of[at];
            if (kind[v] != UNSEEN) continue;
            kind[v] = MOVES;
            ends[count++] = v;
            moved++;
        }
    return moved;
}

static void sweep(npg_mesh *mesh, const npg_mesh_neighbours *r, const uint8_t *kind)
{
    double largest = 1;
    for (int i = 0; i < SWEEPS_MOST && largest > SETTLED; i++) {
        largest = 0;
        for (size_t v = 0; v < mesh->vert_count; v++)
            if (kind[v] == MOVES) largest = fmax(largest, relax(mesh, r, v));
    }
}

/* kind (V), of the vertices farther from all points than seen_dist: UNSEEN; *unseen: how many. */
static npg_status find_unseen(uint8_t *kind, size_t *unseen, const npg_mesh *mesh, const float *points,
                              size_t point_count, double seen_dist)
{
    float *dist;
    NPG_TRY(npg_alloc_array(&dist, NPG_FOR_MESH, mesh->vert_count, sizeof *dist));
    npg_status status = npg_mesh_point_dist(dist, mesh, points, point_count);
    for (size_t v = 0; v < mesh->vert_count && !status; v++) {
        kind[v] = (double)dist[v] > seen_dist ? UNSEEN : STAYS;
        *unseen += kind[v] == UNSEEN;
    }
    npg_release(&dist);
    return status;
}

npg_status npg_mesh_flatten(npg_mesh *mesh, size_t *moved, const float *points, size_t point_count,
                            double seen_dist)
{
    npg_mesh_neighbours r = {0};
    uint8_t *kind = NULL;
    uint32_t *ends = NULL;
    size_t n = mesh->vert_count, unseen = 0;
    *moved = 0;
    npg_status status = npg_alloc_array(&kind, NPG_FOR_MESH, n, sizeof *kind);
    if (!status) status = find_unseen(kind, &unseen, mesh, points, point_count, seen_dist);
    if (!status && unseen) status = npg_mesh_neighbours_open(&r, mesh);
    if (!status && unseen) status = npg_alloc_array(&ends, NPG_FOR_MESH, n, sizeof *ends);
    if (!status && unseen) *moved = reach(kind, ends, &r, n);
    if (*moved) sweep(mesh, &r, kind);
    npg_mesh_neighbours_close(&r);
    npg_release(&ends);
    npg_release(&kind);
    return status;
}
