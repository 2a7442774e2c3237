/* Cleaning: from the points of a file to those worth using. */
#include "outlier/outlier_internal.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "geometry/limits.h"
#include "pipeline/frame_box.h"

#define FLAT 1e-5 /* thickness over length below which a cloud is a plane     */

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

/* ---- one point per cell ---- */

typedef struct grid { /* a table of cells by open addressing; entries are the first point of a cell */
    const float *points;
    double lo[3], scale; /* cell = floor((p - lo) * scale); scale 0: cells are exact places */
    uint32_t *table;
    size_t mask;
} grid;

static void cell_of(int64_t cell[3], const grid *g, const float *p)
{
    for (int a = 0; a < 3; a++) {
        if (g->scale > 0) {
            cell[a] = (int64_t)floor(((double)p[a] - g->lo[a]) * g->scale);
        } else {
            float value = p[a] + 0.0f; /* -0 and 0 are one place */
            uint32_t bits;
            memcpy(&bits, &value, sizeof bits);
            cell[a] = bits;
        }
    }
}

/* Multiplies and shifts as in MurmurHash3's last step; any hash that spreads neighbouring cells will do. */
static uint64_t hash_of(const int64_t cell[3])
{
    uint64_t h = 0x9e3779b97f4a7c15u;
    for (int a = 0; a < 3; a++) {
        h = (h ^ (uint64_t)cell[a]) * 0xff51afd7ed558ccdu;
        h ^= h >> 32;
    }
    return h;
}

/* True when point i is the first of its cell. */
static bool is_first_of_cell(grid *g, uint32_t i)
{
    int64_t mine[3], theirs[3];
    cell_of(mine, g, g->points + 3 * (size_t)i);
    for (size_t at = hash_of(mine) & g->mask;; at = (at + 1) & g->mask) {
        if (g->table[at] == UINT32_MAX) {
            g->table[at] = i;
            return true;
        }
        cell_of(theirs, g, g->points + 3 * (size_t)g->table[at]);
        if (!memcmp(mine, theirs, sizeof mine)) return false;
    }
}

/* keep[i] (may be NULL) = point i is the first of its cell; *count of those.
 * Stops early beyond count_max. */
static npg_status first_of_cells(uint8_t *keep, size_t *count, const npg_frame *frame, double side,
                                 size_t count_max)
{
    grid g = {.points = frame->pos_local, .scale = side > 0 ? 1 / side : 0};
    npg_bounds bounds = npg_bounds_empty();
    size_t size = 64, n = frame->point_count;
    size_t most = n < count_max ? n : count_max + 1;
    npg_bounds_add_points(&bounds, frame->pos_local, n);
    memcpy(g.lo, bounds.lo, sizeof g.lo);
    while (size < 2 * most) size *= 2; /* at most half full, so that a free place is near */
    *count = 0;
    NPG_TRY(npg_alloc_array(&g.table, NPG_FOR_FRAMES, size, sizeof *g.table));
    memset(g.table, 0xff, size * sizeof *g.table);
    g.mask = size - 1;
    for (size_t i = 0; i < n && *count <= count_max; i++) {
        bool is_first = is_first_of_cell(&g, (uint32_t)i);
        if (keep) keep[i] = is_first;
        *count += is_first;
    }
    npg_release(&g.table);
    return NPG_OK;
}

static npg_status keep_first_of_cells(npg_frame *frame, size_t *dropped, double side)
{
    uint8_t *keep;
    size_t count, before = frame->point_count;
    if (before >= UINT32_MAX) return npg_error(NPG_BAD_INPUT, "%zu points in one frame", before);
    NPG_TRY(npg_alloc(&keep, NPG_FOR_FRAMES, before));
    npg_status status = first_of_cells(keep, &count, frame, side, before);
    if (!status && count < before) npg_frame_keep(frame, keep);
    if (!status) *dropped += before - count;
    npg_release(&keep);
    return status;
}

npg_status npg_clean_duplicates(npg_frame *frame)
{
    return keep_first_of_cells(frame, &frame->cleaning.duplicate, 0);
}

/* The number of cells that a surface takes goes with the inverse square of their side: each round uses that
 * to come nearer, aiming at 80 % of the most, and takes the geometric mean of a side with too many cells and
 * one with few enough where the estimate leaves that interval. */
npg_status npg_clean_cap(npg_frame *frame, double *side, size_t point_max)
{
    npg_bounds bounds = npg_bounds_empty();
    double too_small = 0, enough = 0;
    *side = 0;
    if (!point_max || frame->point_count <= point_max) return NPG_OK;
    npg_bounds_add_points(&bounds, frame->pos_local, frame->point_count);
    /* A guess to begin with: a surface as large as a square whose diagonal is that of the box. */
    double cell_side = npg_bounds_diagonal(&bounds) / sqrt(2.0 * (double)point_max);
    for (int round = 0; round < NPG_ROUNDS_MOST; round++) {
        size_t count;
        NPG_TRY(first_of_cells(NULL, &count, frame, cell_side, point_max));
        if (count <= point_max) {
            enough = cell_side;
            if (2 * count > point_max) break;
        } else {
            too_small = cell_side;
        }
        double guess = count > point_max ? 1.5 * cell_side
                                         : cell_side * sqrt((double)(count + 1) / (0.8 * (double)point_max));
        bool between = guess > too_small && (!(enough > 0) || guess < enough);
        cell_side = between ? guess : sqrt(too_small * enough);
    }
    while (!(enough > 0)) { /* ends: one cell holds all */
        size_t count;
        cell_side *= 2;
        NPG_TRY(first_of_cells(NULL, &count, frame, cell_side, point_max));
        if (count <= point_max) enough = cell_side;
    }
    *side = enough;
    return keep_first_of_cells(frame, &frame->cleaning.thinned, enough);
}

npg_status npg_clean_points(npg_frame *frame, double *side, size_t point_max)
{
    NPG_TRY(npg_clean_finite(frame));
    NPG_TRY(npg_clean_duplicates(frame));
    return npg_clean_cap(frame, side, point_max);
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
