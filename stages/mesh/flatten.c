/* Flatten: Gauss and Seidel's sweeps over the unseen vertices, in their order. */
#include "mesh/flatten.h"

#include <math.h>

#include "geometry/mesh_tools.h"
#include "mesh/mesh_clean.h"

#define SWEEPS_MOST 400
#define RELAXATION  1.7  /* beyond the mean: successive over-relaxation */
#define SETTLED     1e-5 /* of the unit box: a sweep that moves nothing farther ends it */

/* Neighbours of the vertices, one list behind the other. */
typedef struct ring {
    uint32_t *start, *of; /* V + 1, 2 E; owned */
} ring;

static npg_status open_ring(ring *r, const npg_mesh *mesh)
{
    uint32_t(*edges)[2] = NULL;
    size_t count = 0, n = mesh->vert_count;
    npg_status status = npg_mesh_edges(&edges, &count, mesh->faces, mesh->face_count);
    if (!status) status = npg_alloc_array(&r->start, NPG_FOR_MESH, n + 2, sizeof *r->start);
    if (!status) status = npg_alloc_array(&r->of, NPG_FOR_MESH, 2 * count + 1, sizeof *r->of);
    for (size_t e = 0; e < 2 * count && !status; e++) r->start[edges[e / 2][e % 2] + 2]++;
    for (size_t v = 0; v < n && !status; v++) r->start[v + 2] += r->start[v + 1];
    for (size_t e = 0; e < 2 * count && !status; e++)
        r->of[r->start[edges[e / 2][e % 2] + 1]++] = edges[e / 2][1 - e % 2];
    npg_release(&edges);
    return status;
}

static void close_ring(ring *r)
{
    npg_release(&r->start);
    npg_release(&r->of);
}

/* How far the vertex went. */
static double relax(npg_mesh *mesh, const ring *r, size_t v)
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

static void sweep(npg_mesh *mesh, const ring *r, const float *dist, double seen_dist)
{
    double largest = 1;
    for (int i = 0; i < SWEEPS_MOST && largest > SETTLED; i++) {
        largest = 0;
        for (size_t v = 0; v < mesh->vert_count; v++)
            if ((double)dist[v] > seen_dist) largest = fmax(largest, relax(mesh, r, v));
    }
}

npg_status npg_mesh_flatten(npg_mesh *mesh, size_t *moved, const float *points, size_t point_count,
                            double seen_dist)
{
    ring r = {0};
    float *dist = NULL;
    *moved = 0;
    npg_status status = npg_alloc_array(&dist, NPG_FOR_MESH, mesh->vert_count, sizeof *dist);
    if (!status) status = npg_mesh_point_dist(dist, mesh, points, point_count);
    for (size_t v = 0; v < mesh->vert_count && !status; v++) *moved += (double)dist[v] > seen_dist;
    if (!status && *moved && *moved < mesh->vert_count) status = open_ring(&r, mesh);
    if (!status && r.of) sweep(mesh, &r, dist, seen_dist);
    close_ring(&r);
    npg_release(&dist);
    return status;
}
