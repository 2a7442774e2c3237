/* Motion figures of a mesh sequence of constant topology. */
#include "tools/eval_motion.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/order.h"

void npg_eval_motion_close(npg_eval_motion *motion)
{
    npg_mesh_unref(&motion->first);
    npg_release(&motion->edges);
    npg_release(&motion->star_start);
    npg_release(&motion->star);
    npg_release(&motion->star_rest);
    npg_release(&motion->star_now);
    npg_release(&motion->before[0]);
    npg_release(&motion->before[1]);
    npg_release(&motion->areas);
}

/* Each vertex's neighbours, one vertex behind the other. */
static npg_status open_stars(npg_eval_motion *m)
{
    uint32_t *filled, most = 1;
    NPG_TRY(npg_alloc_array(&m->star_start, NPG_FOR_MESH, m->vert_count + 1, sizeof *m->star_start));
    NPG_TRY(npg_alloc_array(&m->star, NPG_FOR_MESH, 2 * m->edge_count + 1, sizeof *m->star));
    NPG_TRY(npg_alloc_array(&filled, NPG_FOR_MESH, m->vert_count, sizeof *filled));
    for (size_t i = 0; i < 2 * m->edge_count; i++) m->star_start[m->edges[i / 2][i % 2] + 1]++;
    for (size_t v = 0; v < m->vert_count; v++) {
        if (m->star_start[v + 1] > most) most = m->star_start[v + 1];
        m->star_start[v + 1] += m->star_start[v];
    }
    for (size_t i = 0; i < 2 * m->edge_count; i++) {
        uint32_t v = m->edges[i / 2][i % 2];
        m->star[m->star_start[v] + filled[v]++] = m->edges[i / 2][1 - i % 2];
    }
    npg_release(&filled);
    NPG_TRY(npg_alloc_array(&m->star_rest, NPG_FOR_MESH, most + 1, 3 * sizeof(float)));
    return npg_alloc_array(&m->star_now, NPG_FOR_MESH, most + 1, 3 * sizeof(float));
}

static npg_status open_motion(npg_eval_motion *motion, npg_mesh *mesh)
{
    motion->first = npg_mesh_ref(mesh);
    motion->faces = mesh->faces;
    motion->vert_count = mesh->vert_count;
    motion->face_count = mesh->face_count;
    motion->vertices_last = motion->topology_last = true;
    for (int i = 0; i < 2; i++)
        NPG_TRY(npg_alloc_array(&motion->before[i], NPG_FOR_MESH, mesh->vert_count, 3 * sizeof(float)));
    NPG_TRY(npg_mesh_edges(&motion->edges, &motion->edge_count, mesh->faces, mesh->face_count));
    return open_stars(motion);
}

/* Mean length of the second difference over time. */
static double jitter_of(const npg_eval_motion *motion, const float *after)
{
    const float *middle = motion->before[0], *before = motion->before[1];
    double sum = 0;
    for (size_t v = 0; v < motion->vert_count; v++) {
        double bend_sq = 0;
        for (size_t k = 3 * v; k < 3 * v + 3; k++) {
            double bend = (double)before[k] - 2 * (double)middle[k] + (double)after[k];
            bend_sq += bend * bend;
        }
        sum += sqrt(bend_sq);
    }
    return sum / (double)motion->vert_count / motion->diagonal;
}

static double edge_change_of(const npg_eval_motion *motion, const float *pos)
{
    const float *rest = motion->first->vert_pos;
    double sum = 0;
    for (size_t e = 0; e < motion->edge_count; e++) {
        size_t a = 3 * (size_t)motion->edges[e][0], b = 3 * (size_t)motion->edges[e][1];
        sum += fabs(npg_vec3_distance(pos + a, pos + b) / fmax(npg_vec3_distance(rest + a, rest + b), 1e-30) -
                    1);
    }
    return sum / (double)motion->edge_count;
}

/* A vertex and its neighbours, as differences from it. */
static size_t take_star(const npg_eval_motion *m, float *out, const float *pos, size_t v)
{
    size_t count = 0;
    for (size_t a = 0; a < 3; a++) out[a] = 0;
    for (uint32_t i = m->star_start[v]; i < m->star_start[v + 1]; i++) {
        count++;
        for (size_t a = 0; a < 3; a++) out[3 * count + a] = pos[3 * (size_t)m->star[i] + a] - pos[3 * v + a];
    }
    return count + 1;
}

static double star_misfit(const npg_eval_motion *m, size_t count)
{
    double rotation[3][3], move[3], left_sq = 0, size_sq = 0;
    npg_rigid_fit(rotation, move, m->star_rest, m->star_now, count);
    for (size_t i = 0; i < count; i++)
        for (size_t a = 0; a < 3; a++) {
            double at = move[a], rest = (double)m->star_rest[3 * i + a];
            for (size_t b = 0; b < 3; b++) at += rotation[a][b] * (double)m->star_rest[3 * i + b];
            left_sq += (at - (double)m->star_now[3 * i + a]) * (at - (double)m->star_now[3 * i + a]);
            size_sq += rest * rest;
        }
    return size_sq > 0 ? sqrt(left_sq / size_sq) : 0;
}

/* The local rigidity of the paper's figures (Kabsch alignment), as one number. */
static double rigid_of(const npg_eval_motion *m, const float *pos)
{
    double sum = 0;
    for (size_t v = 0; v < m->vert_count; v++) {
        size_t count = take_star(m, m->star_rest, m->first->vert_pos, v);
        take_star(m, m->star_now, pos, v);
        if (count > 2) sum += star_misfit(m, count);
    }
    return sum / (double)m->vert_count;
}

npg_status npg_eval_motion_add(npg_eval_motion *motion, npg_mesh *mesh)
{
    if (!motion->first) NPG_TRY(open_motion(motion, mesh));
    motion->vertices_last &= mesh->vert_count == motion->vert_count;
    motion->topology_last &=
        motion->vertices_last && mesh->face_count == motion->face_count &&
        !memcmp(mesh->faces, motion->faces, motion->face_count * 3 * sizeof *motion->faces);
    size_t t = motion->frames++;
    if (motion->vertices_last) {
        if (t >= 2) motion->jitter_sum += jitter_of(motion, mesh->vert_pos);
        float *oldest = motion->before[1];
        memcpy(oldest, mesh->vert_pos, motion->vert_count * 3 * sizeof(float));
        motion->before[1] = motion->before[0];
        motion->before[0] = oldest;
    }
    if (!motion->topology_last) return NPG_OK;
    motion->edge_sum += edge_change_of(motion, mesh->vert_pos);
    motion->rigid_sum += rigid_of(motion, mesh->vert_pos);
    NPG_TRY(npg_grow(&motion->areas, &motion->area_room, t + 1, motion->face_count * sizeof(float),
                     NPG_FOR_MESH));
    for (size_t f = 0; f < motion->face_count; f++)
        motion->areas[t * motion->face_count + f] = (float)npg_face_area(mesh->vert_pos, mesh->faces + 3 * f);
    return NPG_OK;
}

/* Share of all faces of all frames whose area is > 10 x or < 0.1 x its median over time. */
static npg_status bad_share(double *share, const npg_eval_motion *motion)
{
    size_t bad = 0, frames = motion->frames;
    float *areas;
    NPG_TRY(npg_alloc_array(&areas, NPG_FOR_MESH, frames, sizeof *areas));
    for (size_t f = 0; f < motion->face_count; f++) {
        for (size_t t = 0; t < frames; t++) areas[t] = motion->areas[t * motion->face_count + f];
        qsort(areas, frames, sizeof *areas, npg_order_float);
        double median = 0.5 * ((double)areas[(frames - 1) / 2] + (double)areas[frames / 2]);
        for (size_t t = 0; t < frames; t++)
            bad += (double)areas[t] > 10 * median || (double)areas[t] < 0.1 * median;
    }
    npg_release(&areas);
    *share = (double)bad / (double)(frames * motion->face_count);
    return NPG_OK;
}

npg_status npg_eval_motion_end(npg_eval_motion_figures *figures, npg_eval_motion *motion)
{
    *figures = (npg_eval_motion_figures){(double)NAN, (double)NAN, (double)NAN, (double)NAN};
    if (motion->vertices_last && motion->frames > 2)
        figures->jitter = motion->jitter_sum / (double)(motion->frames - 2);
    if (!motion->topology_last || !motion->frames) return NPG_OK;
    figures->edge = motion->edge_sum / (double)motion->frames;
    figures->rigid = motion->rigid_sum / (double)motion->frames;
    return bad_share(&figures->bad, motion);
}
