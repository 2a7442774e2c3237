/* Cleaning: from the points of a file to those worth using. */
#include "outlier/outlier_internal.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "pipeline/cost.h"
#include "pipeline/frame_box.h"

#define FLAT 1e-5 /* thickness over length below which a cloud is a plane */

npg_status npg_clean_finite(npg_frame *frame)
{
    uint8_t *keep;
    size_t dropped = 0;
    NPG_TRY(npg_alloc(&keep, NPG_FOR_FRAMES, frame->point_count));
    for (size_t i = 0; i < frame->point_count; i++) {
        const float *p = frame->pos_local + 3 * i;
        keep[i] = fabsf(p[0]) <= NPG_COORDINATE_MAX && fabsf(p[1]) <= NPG_COORDINATE_MAX &&
                  fabsf(p[2]) <= NPG_COORDINATE_MAX; /* false for NaN */
        dropped += !keep[i];
    }
    if (dropped) npg_frame_keep(frame, keep);
    frame->cleaning.not_finite += dropped;
    npg_release(&keep);
    return NPG_OK;
}

/* ---- one point per place ---- */

typedef struct places { /* a table by open addressing; entries are the first point at a place */
    const float *points;
    uint32_t *table;
    size_t mask;
} places;

static void place_of(uint32_t place[3], const float *p)
{
    for (int a = 0; a < 3; a++) {
        float value = p[a] + 0.0f; /* -0 and 0 are one place */
        memcpy(&place[a], &value, sizeof place[a]);
    }
}

/* Multiplies and shifts as in MurmurHash3's last step; any hash that spreads neighbouring places will do. */
static uint64_t hash_of(const uint32_t place[3])
{
    uint64_t h = 0x9e3779b97f4a7c15u;
    for (int a = 0; a < 3; a++) {
        h = (h ^ place[a]) * 0xff51afd7ed558ccdu;
        h ^= h >> 32;
    }
    return h;
}

/* True when point i is the first at its place. */
static bool is_first(places *all, uint32_t i)
{
    uint32_t mine[3], theirs[3];
    place_of(mine, all->points + 3 * (size_t)i);
    for (size_t at = hash_of(mine) & all->mask;; at = (at + 1) & all->mask) {
        if (all->table[at] == UINT32_MAX) {
            all->table[at] = i;
            return true;
        }
        place_of(theirs, all->points + 3 * (size_t)all->table[at]);
        if (!memcmp(mine, theirs, sizeof mine)) return false;
    }
}

/* keep[i] = point i is the first at its place; *count of those. */
static npg_status mark_first(uint8_t *keep, size_t *count, const npg_frame *frame)
{
    places all = {.points = frame->pos_local};
    size_t size = 64, n = frame->point_count;
    while (size < 2 * n) size *= 2; /* at most half full, so that a free place is near */
    *count = 0;
    NPG_TRY(npg_alloc_array(&all.table, NPG_FOR_FRAMES, size, sizeof *all.table));
    memset(all.table, 0xff, size * sizeof *all.table);
    all.mask = size - 1;
    for (size_t i = 0; i < n; i++) *count += keep[i] = is_first(&all, (uint32_t)i);
    npg_release(&all.table);
    return NPG_OK;
}

npg_status npg_clean_duplicates(npg_frame *frame)
{
    uint8_t *keep;
    size_t count, before = frame->point_count;
    if (before >= UINT32_MAX) return npg_error(NPG_BAD_INPUT, "%zu points in one frame", before);
    NPG_TRY(npg_alloc(&keep, NPG_FOR_FRAMES, before));
    npg_status status = mark_first(keep, &count, frame);
    if (!status && count < before) npg_frame_keep(frame, keep);
    if (!status) frame->cleaning.duplicate += before - count;
    npg_release(&keep);
    return status;
}

/* ---- no more than are of use ---- */

size_t npg_clean_point_max(double asked, double face_max)
{
    return asked > 0 ? (size_t)asked : (size_t)fmax(NPG_POINTS_A_FACE * face_max, NPG_FRAME_POINTS);
}

/* By their order, not one of each cell: the cells at the fringe of noise hold fewer points, which would all stay. */
npg_status npg_clean_cap(npg_frame *frame, size_t point_max)
{
    uint8_t *keep;
    size_t before = frame->point_count;
    if (before <= point_max) return NPG_OK;
    NPG_TRY(npg_alloc(&keep, NPG_FOR_FRAMES, before));
    for (size_t i = 0; i < point_max; i++) keep[npg_spread_index(i, point_max, before)] = 1;
    npg_frame_keep(frame, keep);
    frame->cleaning.thinned += before - point_max;
    npg_release(&keep);
    return NPG_OK;
}

npg_status npg_clean_points(npg_frame *frame, size_t point_max)
{
    NPG_TRY(npg_clean_finite(frame));
    NPG_TRY(npg_clean_duplicates(frame));
    return npg_clean_cap(frame, point_max);
}

/* ---- is it a body? ---- */

static npg_status too_few(const npg_frame *frame)
{
    const npg_cleaning *c = &frame->cleaning;
    char why[200] = "";
    if (frame->point_count < c->read)
        snprintf(why, sizeof why,
                 " (%zu not finite or farther than %g from the first point, %zu duplicate, %zu isolated)",
                 c->not_finite, (double)NPG_COORDINATE_MAX, c->duplicate, c->isolated);
    return npg_error(NPG_BAD_INPUT, "%zu usable points of %zu, a surface takes %d%s", frame->point_count,
                     c->read, NPG_PATCH, why);
}

/* How many of the three extents are not zero, from the points' covariance without its eigenvalues (squared
 * extents): the trace is their sum, the sum of the 2 x 2 minors that of their products in pairs, the
 * determinant the product of all three.  With trace 1 the minors are about the second largest, and the
 * determinant over the minors is about the smallest. */
npg_status npg_clean_check(const npg_frame *frame)
{
    double mean[3] = {0}, m[6] = {0}, n = (double)frame->point_count;
    if (frame->point_count < NPG_PATCH) return too_few(frame);
    for (size_t i = 0; i < 3 * frame->point_count; i++) mean[i % 3] += (double)frame->pos_local[i] / n;
    for (size_t i = 0; i < frame->point_count; i++) {
        double d[3];
        for (size_t a = 0; a < 3; a++) d[a] = (double)frame->pos_local[3 * i + a] - mean[a];
        const double products[6] = {d[0] * d[0], d[1] * d[1], d[2] * d[2],
                                    d[0] * d[1], d[0] * d[2], d[1] * d[2]};
        for (int k = 0; k < 6; k++) m[k] += products[k] / n;
    }
    double trace = m[0] + m[1] + m[2], far_sq = mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2];
    if (!(trace > 1e-24 * far_sq)) /* less is rounding of the mean: doubles keep 1e-16 of it */
        return npg_error(NPG_BAD_INPUT, "all %zu points are in one place", frame->point_count);
    for (int k = 0; k < 6; k++) m[k] /= trace;
    double minors = m[0] * m[1] + m[0] * m[2] + m[1] * m[2] - m[3] * m[3] - m[4] * m[4] - m[5] * m[5];
    double determinant = m[0] * (m[1] * m[2] - m[5] * m[5]) - m[3] * (m[3] * m[2] - m[5] * m[4]) +
                         m[4] * (m[3] * m[5] - m[1] * m[4]);
    if (minors < FLAT * FLAT)
        return npg_error(NPG_BAD_INPUT, "all %zu points lie on one line", frame->point_count);
    if (determinant / minors < FLAT * FLAT)
        return npg_error(NPG_BAD_INPUT, "all %zu points lie on one plane", frame->point_count);
    return NPG_OK;
}
