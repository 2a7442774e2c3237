/* Misfit: finds where in a frame the surface fails in one place. */
#include "evaluate/evaluate_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "pipeline/frame_box.h"

/* Set by trial.  evaluate_internal.h says how they are used. */
#define LINKS         6   /* neighbours that are searched for others of a cluster of far points         */
#define STRETCH_LEAST 1.5 /* times an edge's length in the reference                               */
#define LEAST_FAR     12  /* points in a place                                                     */
#define LEAST_MISSED  20  /* points that would lie on a place of the surface                       */
#define LEAST_VERTS   6   /* vertices whose mean area it has                                       */
#define MOST_OF       0.6 /* of the points that a part should have; of the reach, which stretched surface is off */

struct npg_misfit_finder {
    npg_arena arena;           /* of all below, but for the edges               */
    const npg_mesh *reference; /* loan                                          */
    double size;               /* its diagonal                                  */
    bool is_closed;            /* has no border, and its frame saw all of it    */
    uint8_t *is_border;        /* V: on the border of what its frame saw        */
    uint32_t (*edges)[2];      /* E x 2; owned                                  */
    size_t edge_count;
    uint32_t *part_of; /* V: which part of the reference */
    size_t part_count;
    double *part_sums; /* of each part: area, area x position, points; x 5 */
    uint8_t *flags;    /* V                                                */
};

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
    return npg_arena_status(&f->arena);
}

npg_status npg_misfit_open(npg_misfit_finder **out, const npg_mesh *reference, double unseen_share)
{
    NPG_TRY(npg_object_open(out, NPG_FOR_MESH, sizeof **out));
    npg_misfit_finder *finder = *out;
    finder->reference = reference;
    finder->is_closed = unseen_share <= NPG_FEW;
    npg_status status = measure_reference(finder);
    if (status) npg_misfit_close(out);
    return status;
}

void npg_misfit_close(npg_misfit_finder **slot)
{
    if (!*slot) return;
    npg_release(&(*slot)->edges);
    npg_object_close(slot);
}

/* ---- the four kinds ---- */

/* The largest place is one where its share is `least` of all; `all` counts `per_all`. */
static void take_place(npg_misfit *misfit, const npg_patch *place, double least, double per_all)
{
    if (!(place->share > 0) || place->share < least) return;
    misfit->share = place->share * per_all;
    for (int a = 0; a < 3; a++) misfit->at[a] = (double)place->at[a];
}

static npg_status largest_far(npg_patch *place, npg_arena *scratch, const float *far, size_t count,
                              double link)
{
    npg_neighbours near;
    uint32_t *parents = npg_arena_take(scratch, count, sizeof *parents);
    NPG_TRY(npg_neighbours_take(&near, scratch, far, count, far, count, LINKS));
    for (size_t i = 0; i < count; i++) parents[i] = (uint32_t)i;
    for (size_t i = 0; i < LINKS * count; i++)
        if ((double)near.dist_sq[i] <= link * link)
            npg_set_join(parents, (uint32_t)(i / LINKS), near.index[i]);
    return npg_patch_of_sets(place, parents, NULL, far, NULL, count);
}

/* Points beyond the border of a reference that its frame saw in part are of what it did not see. */
static bool is_far(const npg_misfit_finder *f, const npg_surface_hit *hit, double reach)
{
    double dist_sq = (double)hit->dist_sq, beside = NPG_REMOTE_SHARE * f->size;
    if (!(dist_sq > reach * reach)) return false;
    const uint32_t *face = f->reference->faces + 3 * (size_t)hit->face;
    return !npg_hit_on_border(hit, face, f->is_border) || dist_sq > beside * beside;
}

static npg_status find_far(npg_misfit_finder *f, npg_misfit *misfit, const npg_misfit_frame *frame,
                           double reach, double link)
{
    npg_arena scratch = {.purpose = NPG_FOR_QUERY};
    npg_patch place;
    size_t count = 0;
    float *far = npg_arena_take(&scratch, frame->point_count, 3 * sizeof *far);
    for (size_t i = 0; i < frame->point_count && far; i++) {
        if (!is_far(f, &frame->hits[i], reach)) continue;
        memcpy(far + 3 * count++, frame->points + 3 * i, 3 * sizeof *far);
    }
    npg_status status = count ? largest_far(&place, &scratch, far, count, link) : npg_arena_status(&scratch);
    if (!status && count) /* less a hair: shares are rounded */
        take_place(misfit, &place, (LEAST_FAR - 1e-6) / (double)count,
                   (double)count / (double)frame->point_count);
    npg_arena_release(&scratch);
    return status;
}

static bool is_in_sight(const npg_misfit_frame *frame, size_t v)
{
    return !frame->is_in_sight || frame->is_in_sight[v];
}

/* Flag the vertices that are further than `reach` from all points, though a sensor could see them and points of
 * the reference did: what was closed over nothing is no evidence. */
static void flag_off(npg_misfit_finder *f, const npg_misfit_frame *frame, double reach)
{
    const uint8_t *vert_unseen = f->reference->vert_unseen;
    for (size_t i = 0; i < f->reference->vert_count; i++)
        f->flags[i] = (double)frame->vert_dist_sq[i] > reach * reach && is_in_sight(frame, i) &&
                      !(vert_unseen && vert_unseen[i]);
}

static npg_status take_flagged(npg_misfit *misfit, const npg_misfit_finder *f, const npg_misfit_frame *frame)
{
    npg_patch place;
    NPG_TRY(npg_patch_largest(&place, f->flags, frame->vert_unit, frame->vert_areas, f->reference));
    take_place(
        misfit, &place,
        fmax(LEAST_MISSED / (double)frame->point_count, LEAST_VERTS / (double)f->reference->vert_count), 1);
    return NPG_OK;
}

/* Of the surface that is off the points only what is stretched stays flagged. */
static npg_status find_stretched(npg_misfit_finder *f, npg_misfit *misfit, const npg_misfit_frame *frame,
                                 double reach)
{
    enum { OFF = 1, ENDS_STRETCHED = 2 };
    const npg_mesh *mesh = f->reference;
    flag_off(f, frame, reach);
    for (size_t e = 0; e < f->edge_count; e++) {
        uint32_t a = f->edges[e][0], b = f->edges[e][1];
        if (!f->flags[a] || !f->flags[b]) continue;
        if (!(npg_edge_length(frame->vert_unit, f->edges[e]) >
              STRETCH_LEAST * npg_edge_length(mesh->vert_pos, f->edges[e])))
            continue;
        f->flags[a] |= ENDS_STRETCHED;
        f->flags[b] |= ENDS_STRETCHED;
    }
    for (size_t i = 0; i < mesh->vert_count; i++) f->flags[i] &= ENDS_STRETCHED;
    return take_flagged(misfit, f, frame);
}

/* Area, middle and points of every part as it lies in this frame, of what is in sight and has points no farther than
 * `near`: the rest is bare, which is another misfit.  Returns all of that area. */
static double sum_parts(npg_misfit_finder *f, const npg_misfit_frame *frame, double near)
{
    double whole = 0;
    for (size_t i = 0; i < 5 * f->part_count; i++) f->part_sums[i] = 0;
    for (size_t v = 0; v < f->reference->vert_count; v++) {
        if (!is_in_sight(frame, v) || (double)frame->vert_dist_sq[v] > near * near) continue;
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

static void find_vacated(npg_misfit_finder *f, npg_misfit *misfit, const npg_misfit_frame *frame, double near)
{
    if (f->part_count < 2 || !frame->point_count) return;
    double whole = sum_parts(f, frame, near);
    for (size_t p = 0; p < f->part_count; p++) {
        const double *sum = f->part_sums + 5 * p;
        if (!(sum[0] > 0)) continue;
        double expected = (double)frame->point_count * sum[0] / whole, missing = expected - sum[4];
        double share = missing / (double)frame->point_count;
        if (!(sum[4] < MOST_OF * expected) || missing < LEAST_MISSED || share <= misfit->share) continue;
        misfit->share = share;
        for (size_t a = 0; a < 3; a++) misfit->at[a] = sum[1 + a] / sum[0];
    }
}

npg_status npg_misfit_find(npg_misfit_finder *f, npg_misfit *misfits, const npg_misfit_frame *frame)
{
    double spacing = frame->point_count ? sqrt(frame->area / (double)frame->point_count) : 0;
    double least = fmax(NPG_BEYOND * spacing, NPG_DETAIL_SHARE * f->size);
    double reach =
        fmin(fmax(least, NPG_CLEARLY * NPG_WITHIN * frame->point_dist_median), NPG_CLEARLY * least);
    double link = fmax(NPG_SAMPLED * spacing, NPG_DETAIL_SHARE * f->size);
    for (int i = 0; i < NPG_MISFITS; i++)
        misfits[i] = (npg_misfit){0, {(double)NAN, (double)NAN, (double)NAN}};
    NPG_TRY(find_far(f, &misfits[NPG_MISFIT_FAR], frame, reach, link));
    if (!f->is_closed) return NPG_OK;
    find_vacated(f, &misfits[NPG_MISFIT_VACATED], frame, NPG_SAMPLED * spacing);
    flag_off(f, frame, reach);
    NPG_TRY(take_flagged(&misfits[NPG_MISFIT_UNSUPPORTED], f, frame));
    return find_stretched(f, &misfits[NPG_MISFIT_STRETCHED], frame, MOST_OF * reach);
}
