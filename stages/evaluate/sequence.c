/* Sequence: the figures of a mesh sequence, frame by frame. */
#include "evaluate/evaluate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/order.h"

struct npg_sequence {
    npg_metrics_settings metrics;
    bool points_only;
    npg_arena arena;
    npg_mesh *first, *first_truth; /* counted references */
    uint32_t *truth_of;            /* owned */
    bool has_corr;                 /* constant topology on both sides, so far */
    npg_frame_metrics sum;
    double corr_sum, jitter_sum, edge_sum, rigid_sum; /* sums of means per frame */
    uint32_t (*edges)[2];                             /* owned */
    size_t edge_count, frames;
    uint32_t *star_start, *star;       /* V + 1; the neighbours of each vertex                */
    float *star_rest, *star_now;       /* of the largest star, x 3                            */
    float *before[2];                  /* the last frame's positions, and those before        */
    float *areas;                      /* frames x F, owned                                   */
    size_t area_room;                  /* rows                                                */
    bool vertices_last, topology_last; /* the same count, the same faces, so far              */
};

/* ---- motion ---- */

/* Each vertex's neighbours, one vertex behind the other. */
static npg_status open_stars(npg_sequence *s)
{
    const size_t verts = s->first->vert_count;
    uint32_t most = 1;
    s->star_start = npg_arena_take(&s->arena, verts + 1, sizeof *s->star_start);
    s->star = npg_arena_take(&s->arena, 2 * s->edge_count + 1, sizeof *s->star);
    uint32_t *filled = npg_arena_take(&s->arena, verts, sizeof *filled);
    NPG_TRY(npg_arena_status(&s->arena));
    for (size_t i = 0; i < 2 * s->edge_count; i++) s->star_start[s->edges[i / 2][i % 2] + 1]++;
    for (size_t v = 0; v < verts; v++) {
        if (s->star_start[v + 1] > most) most = s->star_start[v + 1];
        s->star_start[v + 1] += s->star_start[v];
    }
    for (size_t i = 0; i < 2 * s->edge_count; i++) {
        uint32_t v = s->edges[i / 2][i % 2];
        s->star[s->star_start[v] + filled[v]++] = s->edges[i / 2][1 - i % 2];
    }
    s->star_rest = npg_arena_take(&s->arena, most + 1, 3 * sizeof(float));
    s->star_now = npg_arena_take(&s->arena, most + 1, 3 * sizeof(float));
    return npg_arena_status(&s->arena);
}

static npg_status open_motion(npg_sequence *s)
{
    s->vertices_last = s->topology_last = true;
    for (int i = 0; i < 2; i++)
        s->before[i] = npg_arena_take(&s->arena, s->first->vert_count, 3 * sizeof(float));
    NPG_TRY(npg_arena_status(&s->arena));
    NPG_TRY(npg_mesh_edges(&s->edges, &s->edge_count, s->first->faces, s->first->face_count));
    return open_stars(s);
}

/* Mean length of the second difference over time. */
static double jitter_of(const npg_sequence *s, const float *after)
{
    const float *middle = s->before[0], *before = s->before[1];
    double sum = 0;
    for (size_t v = 0; v < s->first->vert_count; v++) {
        double bend_sq = 0;
        for (size_t k = 3 * v; k < 3 * v + 3; k++) {
            double bend = (double)before[k] - 2 * (double)middle[k] + (double)after[k];
            bend_sq += bend * bend;
        }
        sum += sqrt(bend_sq);
    }
    return sum / (double)s->first->vert_count / s->metrics.diagonal;
}

static double edge_change_of(const npg_sequence *s, const float *pos)
{
    const float *rest = s->first->vert_pos;
    double sum = 0;
    for (size_t e = 0; e < s->edge_count; e++) {
        size_t a = 3 * (size_t)s->edges[e][0], b = 3 * (size_t)s->edges[e][1];
        sum += fabs(npg_vec3_distance(pos + a, pos + b) / fmax(npg_vec3_distance(rest + a, rest + b), 1e-30) -
                    1);
    }
    return sum / (double)s->edge_count;
}

/* A vertex and its neighbours, as differences from it. */
static size_t take_star(const npg_sequence *s, float *out, const float *pos, size_t v)
{
    size_t count = 0;
    for (size_t a = 0; a < 3; a++) out[a] = 0;
    for (uint32_t i = s->star_start[v]; i < s->star_start[v + 1]; i++) {
        count++;
        for (size_t a = 0; a < 3; a++) out[3 * count + a] = pos[3 * (size_t)s->star[i] + a] - pos[3 * v + a];
    }
    return count + 1;
}

static double star_misfit(const npg_sequence *s, size_t count)
{
    double rotation[3][3], move[3], left_sq = 0, size_sq = 0;
    npg_rigid_fit(rotation, move, s->star_rest, s->star_now, count);
    for (size_t i = 0; i < count; i++)
        for (size_t a = 0; a < 3; a++) {
            double at = move[a], rest = (double)s->star_rest[3 * i + a];
            for (size_t b = 0; b < 3; b++) at += rotation[a][b] * (double)s->star_rest[3 * i + b];
            left_sq += (at - (double)s->star_now[3 * i + a]) * (at - (double)s->star_now[3 * i + a]);
            size_sq += rest * rest;
        }
    return size_sq > 0 ? sqrt(left_sq / size_sq) : 0;
}

/* The local rigidity of the paper's figures (Kabsch alignment), as one number. */
static double rigid_of(const npg_sequence *s, const float *pos)
{
    double sum = 0;
    for (size_t v = 0; v < s->first->vert_count; v++) {
        size_t count = take_star(s, s->star_rest, s->first->vert_pos, v);
        take_star(s, s->star_now, pos, v);
        if (count > 2) sum += star_misfit(s, count);
    }
    return sum / (double)s->first->vert_count;
}

static bool same_faces(const npg_mesh *a, const npg_mesh *b)
{
    return a->vert_count == b->vert_count && a->face_count == b->face_count &&
           !memcmp(a->faces, b->faces, a->face_count * 3 * sizeof *a->faces);
}

static npg_status add_motion(npg_sequence *s, const npg_mesh *mesh)
{
    const size_t t = s->frames, faces = s->first->face_count;
    s->vertices_last &= mesh->vert_count == s->first->vert_count;
    s->topology_last &= s->vertices_last && same_faces(mesh, s->first);
    if (s->vertices_last) {
        if (t >= 2) s->jitter_sum += jitter_of(s, mesh->vert_pos);
        float *oldest = s->before[1];
        memcpy(oldest, mesh->vert_pos, mesh->vert_count * 3 * sizeof(float));
        s->before[1] = s->before[0];
        s->before[0] = oldest;
    }
    if (!s->topology_last) return NPG_OK;
    s->edge_sum += edge_change_of(s, mesh->vert_pos);
    s->rigid_sum += rigid_of(s, mesh->vert_pos);
    NPG_TRY(npg_grow(&s->areas, &s->area_room, t + 1, faces * sizeof(float), NPG_FOR_MESH));
    for (size_t f = 0; f < faces; f++)
        s->areas[t * faces + f] = (float)npg_face_area(mesh->vert_pos, mesh->faces + 3 * f);
    return NPG_OK;
}

/* Share of all faces of all frames whose area is > 10 x or < 0.1 x its median over time. */
static npg_status bad_share(double *share, const npg_sequence *s)
{
    size_t bad = 0, frames = s->frames;
    float *areas;
    NPG_TRY(npg_alloc_array(&areas, NPG_FOR_MESH, frames, sizeof *areas));
    for (size_t f = 0; f < s->first->face_count; f++) {
        for (size_t t = 0; t < frames; t++) areas[t] = s->areas[t * s->first->face_count + f];
        qsort(areas, frames, sizeof *areas, npg_order_float);
        double median = 0.5 * ((double)areas[(frames - 1) / 2] + (double)areas[frames / 2]);
        for (size_t t = 0; t < frames; t++)
            bad += (double)areas[t] > 10 * median || (double)areas[t] < 0.1 * median;
    }
    npg_release(&areas);
    *share = (double)bad / (double)(frames * s->first->face_count);
    return NPG_OK;
}

/* ---- the sequence ---- */

npg_status npg_sequence_open(npg_sequence **out, const npg_metrics_settings *settings, bool points_only)
{
    NPG_TRY(npg_alloc(out, NPG_FOR_MESH, sizeof **out));
    **out =
        (npg_sequence){.metrics = *settings, .points_only = points_only, .arena = {.purpose = NPG_FOR_MESH}};
    return NPG_OK;
}

void npg_sequence_close(npg_sequence **slot)
{
    npg_sequence *s = *slot;
    if (!s) return;
    npg_mesh_unref(&s->first);
    npg_mesh_unref(&s->first_truth);
    npg_release(&s->truth_of);
    npg_release(&s->edges);
    npg_release(&s->areas);
    npg_arena_release(&s->arena);
    npg_release(slot);
}

static npg_status begin(npg_sequence *s, npg_mesh *predicted, npg_mesh *truth)
{
    s->metrics.diagonal = npg_points_diagonal(truth->vert_pos, truth->vert_count);
    if (!(s->metrics.diagonal > 0)) return npg_error(NPG_BAD_INPUT, "all points are equal");
    s->first = npg_mesh_ref(predicted);
    s->first_truth = npg_mesh_ref(truth);
    s->has_corr = !s->points_only;
    NPG_TRY(open_motion(s));
    return s->has_corr ? npg_metrics_tie(&s->truth_of, predicted, truth) : NPG_OK;
}

npg_status npg_sequence_add(npg_sequence *s, npg_frame_metrics *figures, double *corr, npg_mesh *predicted,
                            npg_mesh *truth)
{
    npg_frame_metrics *sum = &s->sum;
    *corr = (double)NAN;
    if (!s->first) NPG_TRY(begin(s, predicted, truth));
    NPG_TRY(npg_metrics_compare(figures, predicted, truth, &s->metrics, s->frames));
    NPG_TRY(add_motion(s, predicted));
    s->has_corr = s->has_corr && s->vertices_last && same_faces(truth, s->first_truth);
    if (s->frames && s->has_corr)
        s->corr_sum += *corr = npg_metrics_drift(predicted, truth, s->truth_of, s->metrics.diagonal);
    sum->cd += figures->cd;
    sum->cd_to_truth += figures->cd_to_truth;
    sum->cd_from_truth += figures->cd_from_truth;
    sum->nc += figures->nc;
    sum->f += figures->f;
    sum->precision += figures->precision;
    sum->recall += figures->recall;
    s->frames++;
    return NPG_OK;
}

npg_status npg_sequence_figures_of(npg_sequence_figures *out, const npg_sequence *s)
{
    const double frames = (double)s->frames, none = (double)NAN;
    npg_frame_metrics m = s->sum;
    double *fields[] = {&m.cd, &m.cd_to_truth, &m.cd_from_truth, &m.nc, &m.f, &m.precision, &m.recall};
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++) *fields[i] /= frames;
    *out = (npg_sequence_figures){.mean = m,
                                  .frames = s->frames,
                                  .diagonal = s->metrics.diagonal,
                                  .corr = s->has_corr && s->frames > 1 ? s->corr_sum / (frames - 1) : none,
                                  .jitter =
                                      s->vertices_last && s->frames > 2 ? s->jitter_sum / (frames - 2) : none,
                                  .edge = s->topology_last ? s->edge_sum / frames : none,
                                  .rigid = s->topology_last ? s->rigid_sum / frames : none,
                                  .bad = none,
                                  .topology_last = s->topology_last};
    return s->topology_last ? bad_share(&out->bad, s) : NPG_OK;
}
