/* Rigid ICP: trimmed iterated closest points between two looks. */
#include "track/track.h"

#include <stdlib.h>
#include <string.h>

#include "geometry/limits.h"
#include "pipeline/order.h"

npg_status npg_look_open(npg_look *look, const float *points, size_t point_count)
{
    NPG_TRY(npg_alloc_array(&look->points, NPG_FOR_FIT, NPG_LOOK_POINTS, 3 * sizeof *look->points));
    look->count = npg_points_spread(look->points, NULL, NPG_LOOK_POINTS, points, NULL, point_count);
    return npg_kdtree_open(&look->tree, look->points, look->count);
}

void npg_look_close(npg_look *look)
{
    npg_kdtree_close(&look->tree);
    npg_release(&look->points);
}

/* ---- rigid motions ---- */

static void move_points(float *moved, const npg_rigid *m, const float *points, size_t count)
{
    for (size_t i = 0; i < 3 * count; i++)
        moved[i] = (float)npg_rigid_at(m, points + i / 3 * 3, (int)(i % 3));
}

static npg_rigid inverse(const npg_rigid *m)
{
    npg_rigid back = {0};
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            back.rotation[r][c] = m->rotation[c][r];
            back.translation[r] -= m->rotation[c][r] * m->translation[c];
        }
    return back;
}

/* From the middle of the one to that of the other. */
static npg_rigid between_middles(const npg_look *from, const npg_look *to)
{
    npg_rigid motion = {.rotation = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    for (size_t i = 0; i < 3 * to->count; i++)
        motion.translation[i % 3] += (double)to->points[i] / (double)to->count;
    for (size_t i = 0; i < 3 * from->count; i++)
        motion.translation[i % 3] -= (double)from->points[i] / (double)from->count;
    return motion;
}

/* ---- pairs ---- */

typedef struct pairs {
    float moved[3 * NPG_LOOK_POINTS], dist_sq[NPG_LOOK_POINTS];
    uint32_t near[NPG_LOOK_POINTS];
} pairs;

/* The nearest of `to` for each of `from` after the motion. */
static npg_status find_pairs(pairs *p, const npg_look *from, const npg_look *to, const npg_rigid *motion)
{
    move_points(p->moved, motion, from->points, from->count);
    return npg_kdtree_nearest(to->tree, p->near, p->dist_sq, p->moved, from->count, 1, 1);
}

/* Squared distance that most of the pairs do not exceed. */
static double bar_of(const pairs *p, size_t count)
{
    double sorted[NPG_LOOK_POINTS];
    for (size_t i = 0; i < count; i++) sorted[i] = (double)p->dist_sq[i];
    qsort(sorted, count, sizeof *sorted, npg_order_double);
    return sorted[(size_t)(NPG_MOST * (double)(count - 1))];
}

static npg_status improve(npg_rigid *motion, pairs *p, const npg_look *from, const npg_look *to)
{
    float a[3 * NPG_LOOK_POINTS], b[3 * NPG_LOOK_POINTS];
    size_t kept = 0;
    NPG_TRY(find_pairs(p, from, to, motion));
    double bar = bar_of(p, from->count);
    for (size_t i = 0; i < from->count; i++) {
        if ((double)p->dist_sq[i] > bar) continue;
        memcpy(a + 3 * kept, from->points + 3 * i, 3 * sizeof *a);
        memcpy(b + 3 * kept++, to->points + 3 * (size_t)p->near[i], 3 * sizeof *b);
    }
    npg_rigid_fit(motion->rotation, motion->translation, a, b, kept);
    return NPG_OK;
}

static npg_status mean_between(double *mean, pairs *p, const npg_look *from, const npg_look *to,
                               const npg_rigid *motion)
{
    NPG_TRY(find_pairs(p, from, to, motion));
    *mean = 0;
    for (size_t i = 0; i < from->count; i++) *mean += (double)p->dist_sq[i] / (double)from->count;
    return NPG_OK;
}

/* ---- the search ---- */

static npg_status settle(npg_rigid *motion, double *unlike, const npg_look *from, const npg_look *to)
{
    pairs p;
    double there, back;
    for (int round = 0; round < NPG_ROUNDS_MOST; round++) NPG_TRY(improve(motion, &p, from, to));
    npg_rigid undone = inverse(motion);
    NPG_TRY(mean_between(&there, &p, from, to, motion));
    NPG_TRY(mean_between(&back, &p, to, from, &undone));
    *unlike = there + back;
    return NPG_OK;
}

npg_status npg_rigid_icp(npg_rigid *motion, double *unlike, const npg_look *from, const npg_look *to,
                         const npg_rigid *guess)
{
    npg_rigid guessed = *guess;
    double unlike_guessed;
    *motion = between_middles(from, to);
    NPG_TRY(settle(motion, unlike, from, to));
    NPG_TRY(settle(&guessed, &unlike_guessed, from, to));
    if (unlike_guessed >= *unlike) return NPG_OK;
    *motion = guessed;
    *unlike = unlike_guessed;
    return NPG_OK;
}
