/* Match: closest points of the surface, weighed. */
#include "optimize/energy.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/order.h"

npg_status npg_point_matcher_open(npg_point_matcher *m, const npg_mesh *mesh, size_t most)
{
    const size_t vector = 3 * sizeof(float);
    m->mesh = mesh;
    m->most = most;
    m->arrays.purpose = NPG_FOR_FIT;
    m->targets = npg_arena_take(&m->arrays, most, vector);
    m->target_normals = npg_arena_take(&m->arrays, most, vector);
    m->vert_normals = npg_arena_take(&m->arrays, mesh->vert_count, vector);
    m->dists = npg_arena_take(&m->arrays, most, sizeof *m->dists);
    m->hits = npg_arena_take(&m->arrays, most, sizeof *m->hits);
    NPG_TRY(npg_arena_status(&m->arrays));
    return npg_surface_open(&m->surface, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count);
}

void npg_point_matcher_close(npg_point_matcher *m)
{
    npg_surface_close(&m->surface);
    npg_arena_release(&m->arrays);
}

/* The frame's points, thinned, and where the surface is closest to them. */
static npg_status look(npg_point_matcher *m, size_t *count, const npg_energy_frame *frame)
{
    *count = 0;
    if (!frame->point_count) return NPG_OK;
    *count = npg_points_spread(m->targets, m->target_normals, m->most, frame->points, frame->normals,
                               frame->point_count);
    NPG_TRY(npg_surface_move(m->surface, frame->positions));
    return npg_surface_closest_near(m->surface, m->hits, m->targets, *count, NULL, 1);
}

npg_status npg_point_matcher_measure(npg_point_matcher *m, double *spread, const npg_energy_frame *frame)
{
    size_t count;
    *spread = 0;
    NPG_TRY(look(m, &count, frame));
    if (!count) return NPG_OK;
    for (size_t i = 0; i < count; i++) m->dists[i] = sqrtf(m->hits[i].dist_sq);
    qsort(m->dists, count, sizeof *m->dists, npg_order_float);
    *spread = NPG_DEVIATIONS_PER_MEDIAN * (double)m->dists[count / 2];
    return NPG_OK;
}

static void set_pull(npg_point_pull *p, const npg_point_matcher *m, size_t i, const float *positions,
                     double width)
{
    const npg_surface_hit *hit = &m->hits[i];
    *p = (npg_point_pull){.strength = (float)npg_geman_mcclure((double)hit->dist_sq, width)};
    memcpy(p->weight, hit->weights, sizeof p->weight);
    memcpy(p->offset, m->targets + 3 * i, sizeof p->offset);
    float length = 0;
    for (size_t c = 0; c < 3; c++) {
        size_t v = p->corner[c] = m->mesh->faces[3 * (size_t)hit->face + c];
        for (size_t a = 0; a < 3; a++) {
            p->normal[a] += hit->weights[c] * m->vert_normals[3 * v + a];
            p->offset[a] -= hit->weights[c] * positions[3 * v + a];
        }
    }
    for (int a = 0; a < 3; a++) length += p->normal[a] * p->normal[a];
    for (int a = 0; a < 3; a++) p->normal[a] /= fmaxf(sqrtf(length), 1e-9f);
}

npg_status npg_point_matcher_match(npg_point_matcher *m, npg_point_pull *pulls, size_t *count,
                                   const npg_energy_frame *frame, double width)
{
    size_t seen;
    *count = 0;
    NPG_TRY(look(m, &seen, frame));
    npg_mesh_vertex_normals(m->vert_normals, frame->positions, m->mesh->vert_count, m->mesh->faces,
                            m->mesh->face_count);
    for (size_t i = 0; i < seen; i++) {
        npg_point_pull *p = &pulls[*count];
        float facing = 0;
        set_pull(p, m, i, frame->positions, width);
        for (size_t a = 0; a < 3 && frame->normals; a++)
            facing += p->normal[a] * m->target_normals[3 * i + a];
        *count += facing >= (float)NPG_AGAINST;
    }
    return NPG_OK;
}
