/* Misfit: finds where in a frame the surface fails in one place. */
#include "evaluate/evaluate_internal.h"

#include <math.h>

#include "geometry/geometry.h"
#include "pipeline/frame_box.h"

/* Set by trial.  evaluate_internal.h says how they are used. */
#define REACH_SPACINGS 3.0   /* of the points on the surface                                          */
#define REACH_SIZE     0.015 /* of the reference's diagonal                                           */
#define REACH_MEDIANS  5.0   /* times the points' median distance: noise                              */
#define REACH_MOST     2.0   /* times what it is without noise                                        */
#define LINK_SPACINGS  2.0   /* between neighbours in a cluster of far points                         */
#define LINKS          6     /* neighbours that are searched for others of the cluster                */
#define UNSEEN_MOST    0.02  /* of the reference: more than that, and it is of cameras that see parts */
#define BESIDE_SIZE    0.15  /* of the diagonal: as far beyond a border lies surface not seen before  */
#define STRETCH_LEAST  1.5   /* times an edge's length in the reference                               */
#define OFF_SHARE      0.6   /* of the reach: stretched surface lies off the points                        */
#define LEAST_FAR      12    /* points in a place                                                     */
#define LEAST_MISSED   20    /* points that would lie on a place of the surface                       */
#define LEAST_VERTS    6     /* vertices whose mean area it has                                       */
#define VACATED_SHARE  0.6   /* of the points that a part should have                                 */

struct npg_misfit_finder {
    const npg_mesh *reference; /* loan                                          */
    double size;               /* its diagonal                                  */
    bool is_closed;            /* has no border, and its frame saw all of it    */
    npg_arena arena;           /* of all below, but for the edges and scratch   */
    uint8_t *is_border;        /* V: on the border of what its frame saw        */
    uint32_t (*edges)[2];      /* E x 2; owned                                  */
    size_t edge_count;
    float *edge_lengths; /* E, of the reference            */
    uint32_t *part_of;   /* V: which part of the reference */
    size_t part_count;
    double *part_sums; /* of each part: area, area x position, points; x 5 */
    uint8_t *flags;    /* V                                                */
    npg_arena scratch; /* of a frame                                       */
    uint32_t *parents; /* of the places so far: max(N, V)                  */
    double *sums;      /* their size and weighted middle: x 4              */
};

static double length_of(const float *vert_pos, const uint32_t edge[2])
{
    return npg_vec3_distance(vert_pos + 3 * (size_t)edge[0], vert_pos + 3 * (size_t)edge[1]);
}

static npg_status measure_reference(npg_misfit_finder *f)
{
    const npg_mesh *mesh = f->reference;
    size_t v = mesh->vert_count;
    bool is_open;
    f->size = npg_points_diagonal(mesh->vert_pos, v);
    f->part_of = npg_arena_take(&f->arena, v, sizeof *f->part_of);
    f->is_border = npg_arena_take(&f->arena, v, 1);
    f->flags = npg_arena_take(&f->arena, v, 1);
    NPG_TRY(npg_arena_status(&f->arena));
    NPG_TRY(npg_mesh_border(f->is_border, &is_open, mesh));
    if (is_open) f->is_closed = false;
    NPG_TRY(npg_mesh_components(f->part_of, &f->part_count, v, mesh->faces, mesh->face_count));
    NPG_TRY(npg_mesh_edges(&f->edges, &f->edge_count, mesh->faces, mesh->face_count));
    f->part_sums = npg_arena_take(&f->arena, f->part_count, 5 * sizeof *f->part_sums);
    f->edge_lengths = npg_arena_take(&f->arena, f->edge_count, sizeof *f->edge_lengths);
    NPG_TRY(npg_arena_status(&f->arena));
    for (size_t e = 0; e < f->edge_count; e++)
        f->edge_lengths[e] = (float)length_of(mesh->vert_pos, f->edges[e]);
    return NPG_OK;
}

npg_status npg_misfit_open(npg_misfit_finder **out, const npg_mesh *reference, double unseen_share)
{
    npg_misfit_finder *finder;
    NPG_TRY(npg_alloc(&finder, NPG_FOR_MESH, sizeof *finder));
    finder->reference = reference;
    finder->is_closed = unseen_share <= UNSEEN_MOST;
    finder->arena.purpose = NPG_FOR_MESH;
    finder->scratch.purpose = NPG_FOR_QUERY;
    npg_status status = measure_reference(finder);
    if (status) npg_misfit_close(&finder);
    *out = finder;
    return status;
}

void npg_misfit_close(npg_misfit_finder **slot)
{
    if (!*slot) return;
    npg_release(&(*slot)->edges);
    npg_arena_release(&(*slot)->arena);
    npg_release(slot);
}

/* ---- places: sets of things that belong together ---- */

static void begin_places(npg_misfit_finder *f, size_t count)
{
    for (size_t i = 0; i < count; i++) f->parents[i] = (uint32_t)i;
    for (size_t i = 0; i < 4 * count; i++) f->sums[i] = 0;
}

static void add_to_place(npg_misfit_finder *f, uint32_t i, const float *pos, double weight)
{
    double *sum = f->sums + 4 * (size_t)npg_set_root(f->parents, i);
    sum[0] += weight;
    for (size_t a = 0; a < 3; a++) sum[1 + a] += weight * (double)pos[a];
}

/* The largest of the places; one that is smaller than `least` does not count. */
static void largest_place(npg_misfit *misfit, const npg_misfit_finder *f, size_t count, double whole,
                          double least)
{
    const double *best = NULL;
    for (size_t i = 0; i < count; i++)
        if (f->sums[4 * i] >= least && f->sums[4 * i] > (best ? best[0] : 0)) best = f->sums + 4 * i;
    misfit->share = best && whole > 0 ? best[0] / whole : 0;
    for (size_t a = 0; a < 3; a++) misfit->at[a] = best ? best[1 + a] / best[0] : (double)NAN;
}

/* ---- the four kinds ---- */

static npg_status link_far(npg_misfit_finder *f, const float *far, size_t count, double link)
{
    npg_neighbours near;
    NPG_TRY(npg_neighbours_take(&near, &f->scratch, far, count, far, count, LINKS));
    for (size_t i = 0; i < LINKS * count; i++)
        if ((double)near.dist_sq[i] <= link * link)
            npg_set_join(f->parents, (uint32_t)(i / LINKS), near.index[i]);
    return NPG_OK;
}

/* Points beyond the border of a reference that its frame saw in part are of what it did not see. */
static bool is_far(const npg_misfit_finder *f, const npg_surface_hit *hit, double reach)
{
    double dist_sq = (double)hit->dist_sq, beside = BESIDE_SIZE * f->size;
    if (!(dist_sq > reach * reach)) return false;
    const uint32_t *face = f->reference->faces + 3 * (size_t)hit->face;
    return !npg_hit_on_border(hit, face, f->is_border) || dist_sq > beside * beside;
}

static npg_status find_far(npg_misfit_finder *f, npg_misfit *misfit, const npg_misfit_frame *frame,
                           double reach, double link)
{
    size_t count = 0;
    for (size_t i = 0; i < frame->point_count; i++) count += is_far(f, &frame->hits[i], reach);
    *misfit = (npg_misfit){0, {(double)NAN, (double)NAN, (double)NAN}};
    if (!count) return NPG_OK;
    float *far = npg_arena_take(&f->scratch, count, 3 * sizeof *far);
    NPG_TRY(npg_arena_status(&f->scratch));
    begin_places(f, count);
    count = 0;
    for (size_t i = 0; i < frame->point_count; i++) {
        if (!is_far(f, &frame->hits[i], reach)) continue;
        for (size_t a = 0; a < 3; a++) far[3 * count + a] = frame->points[3 * i + a];
        count++;
    }
    NPG_TRY(link_far(f, far, count, link));
    for (size_t i = 0; i < count; i++) add_to_place(f, (uint32_t)i, far + 3 * i, 1);
    largest_place(misfit, f, count, (double)frame->point_count, LEAST_FAR);
    return NPG_OK;
}

static bool is_in_sight(const npg_misfit_frame *frame, size_t v)
{
    return !frame->is_in_sight || frame->is_in_sight[v];
}

/* Flag the vertices that are further than `reach` from all points, though a sensor could see them. */
static void flag_off(npg_misfit_finder *f, const npg_misfit_frame *frame, double reach)
{
    for (size_t i = 0; i < f->reference->vert_count; i++)
        f->flags[i] = (double)frame->vert_dist_sq[i] > reach * reach && is_in_sight(frame, i);
}

static void join_flagged(npg_misfit_finder *f)
{
    for (size_t e = 0; e < f->edge_count; e++)
        if (f->flags[f->edges[e][0]] && f->flags[f->edges[e][1]])
            npg_set_join(f->parents, f->edges[e][0], f->edges[e][1]);
}

static void add_flagged(npg_misfit_finder *f, npg_misfit *misfit, const npg_misfit_frame *frame)
{
    size_t v = f->reference->vert_count;
    for (size_t i = 0; i < v; i++)
        if (f->flags[i]) add_to_place(f, (uint32_t)i, frame->vert_unit + 3 * i, frame->vert_areas[i]);
    double least = fmax(LEAST_MISSED / (double)frame->point_count, LEAST_VERTS / (double)v);
    largest_place(misfit, f, v, frame->area, least * frame->area);
}

static void find_unsupported(npg_misfit_finder *f, npg_misfit *misfit, const npg_misfit_frame *frame,
                             double reach)
{
    begin_places(f, f->reference->vert_count);
    *misfit = (npg_misfit){0, {(double)NAN, (double)NAN, (double)NAN}};
    if (!f->is_closed) return;
    flag_off(f, frame, reach);
    join_flagged(f);
    add_flagged(f, misfit, frame);
}

/* Of the surface that is off the points only what is stretched stays flagged. */
static void find_stretched(npg_misfit_finder *f, npg_misfit *misfit, const npg_misfit_frame *frame,
                           double reach)
{
    enum { OFF = 1, ENDS_STRETCHED = 2 };
    size_t v = f->reference->vert_count;
    begin_places(f, v);
    *misfit = (npg_misfit){0, {(double)NAN, (double)NAN, (double)NAN}};
    if (!f->is_closed) return;
    flag_off(f, frame, reach);
    for (size_t e = 0; e < f->edge_count; e++) {
        uint32_t a = f->edges[e][0], b = f->edges[e][1];
        if (!f->flags[a] || !f->flags[b]) continue;
        if (!(length_of(frame->vert_unit, f->edges[e]) > STRETCH_LEAST * (double)f->edge_lengths[e]))
            continue;
        f->flags[a] |= ENDS_STRETCHED;
        f->flags[b] |= ENDS_STRETCHED;
    }
    for (size_t i = 0; i < v; i++) f->flags[i] &= ENDS_STRETCHED;
    join_flagged(f);
    add_flagged(f, misfit, frame);
}

/* Area, middle and points of every part as it lies in this frame, of what is in sight.  Returns all of that
 * area. */
static double sum_parts(npg_misfit_finder *f, const npg_misfit_frame *frame)
{
    double whole = 0;
    for (size_t i = 0; i < 5 * f->part_count; i++) f->part_sums[i] = 0;
    for (size_t v = 0; v < f->reference->vert_count; v++) {
        if (!is_in_sight(frame, v)) continue;
        whole += frame->vert_areas[v];
        double *sum = f->part_sums + 5 * (size_t)f->part_of[v];
        sum[0] += frame->vert_areas[v];
        for (size_t a = 0; a < 3; a++)
            sum[1 + a] += frame->vert_areas[v] * (double)frame->vert_unit[3 * v + a];
    }
    for (size_t i = 0; i < frame->point_count; i++)
        f->part_sums[5 * (size_t)f->part_of[f->reference->faces[3 * (size_t)frame->hits[i].face]] + 4] += 1;
    return whole;
}

static void find_vacated(npg_misfit_finder *f, npg_misfit *misfit, const npg_misfit_frame *frame)
{
    *misfit = (npg_misfit){0, {(double)NAN, (double)NAN, (double)NAN}};
    if (!f->is_closed || f->part_count < 2 || !frame->point_count) return;
    double whole = sum_parts(f, frame);
    for (size_t p = 0; p < f->part_count; p++) {
        const double *sum = f->part_sums + 5 * p;
        if (!(sum[0] > 0)) continue;
        double expected = (double)frame->point_count * sum[0] / whole, missing = expected - sum[4];
        double share = missing / (double)frame->point_count;
        if (!(sum[4] < VACATED_SHARE * expected) || missing < LEAST_MISSED || share <= misfit->share)
            continue;
        misfit->share = share;
        for (size_t a = 0; a < 3; a++) misfit->at[a] = sum[1 + a] / sum[0];
    }
}

npg_status npg_misfit_find(npg_misfit_finder *f, npg_misfit *misfits, const npg_misfit_frame *frame)
{
    double spacing = frame->point_count ? sqrt(frame->area / (double)frame->point_count) : 0;
    double least = fmax(REACH_SPACINGS * spacing, REACH_SIZE * f->size);
    double reach = fmin(fmax(least, REACH_MEDIANS * frame->point_dist_median), REACH_MOST * least);
    double link = fmax(LINK_SPACINGS * spacing, REACH_SIZE * f->size);
    size_t v = f->reference->vert_count, most = frame->point_count > v ? frame->point_count : v;
    f->parents = npg_arena_take(&f->scratch, most, sizeof *f->parents);
    f->sums = npg_arena_take(&f->scratch, most, 4 * sizeof *f->sums);
    npg_status status = npg_arena_status(&f->scratch);
    if (!status) status = find_far(f, &misfits[NPG_MISFIT_FAR], frame, reach, link);
    if (!status) {
        find_unsupported(f, &misfits[NPG_MISFIT_UNSUPPORTED], frame, reach);
        find_vacated(f, &misfits[NPG_MISFIT_VACATED], frame);
        find_stretched(f, &misfits[NPG_MISFIT_STRETCHED], frame, OFF_SHARE * reach);
    }
    npg_arena_release(&f->scratch);
    return status;
}
