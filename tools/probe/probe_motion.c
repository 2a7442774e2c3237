/* Motion: how far a figure's parts go from one frame to the next. */
#include "tools/probe/probe_motion.h"

#include <math.h>
#include <stdlib.h>

#include "geometry/geometry.h"
#include "pipeline/order.h"

enum { KEPT = 5000, ASKED = 500, LEAST = 50 };

/* Thin a frame to KEPT points, spread over it, and leave out what is not finite. */
static npg_status thin_frame(float **points, size_t *count, const npg_frame *frame)
{
    NPG_TRY(npg_alloc_array(points, NPG_FOR_FILES, KEPT, 3 * sizeof **points));
    size_t spread = npg_points_spread(*points, NULL, KEPT, frame->pos_local, NULL, frame->point_count);
    float *to = *points;
    for (size_t i = 0; i < spread; i++) {
        const float *p = *points + 3 * i;
        if (!isfinite(p[0] + p[1] + p[2])) continue;
        for (int k = 0; k < 3; k++) *to++ = p[k];
    }
    *count = (size_t)(to - *points) / 3;
    return NPG_OK;
}

/* The diagonal without the outermost points; row: room for as many numbers as there are points. */
static double figure_diagonal(const float *points, size_t n, float *row)
{
    double sum = 0;
    for (size_t k = 0; k < 3; k++) {
        for (size_t i = 0; i < n; i++) row[i] = points[3 * i + k];
        qsort(row, n, sizeof *row, npg_order_float);
        double side = (double)row[n - 1 - n / 100] - (double)row[n / 100];
        sum += side * side;
    }
    return sqrt(sum);
}

/* The 90th percentile of the distance from `from` to the nearest of `to`, in diagonals of `to`; negative
 * where the figure has no size. */
static npg_status measure_step(double *step, const float *from, size_t from_count, const float *to,
                               size_t to_count)
{
    static _Thread_local float asked[3 * ASKED], dist_sq[ASKED], row[KEPT];
    static _Thread_local uint32_t nearest[ASKED];
    npg_kdtree *tree = NULL;
    size_t n = npg_points_spread(asked, NULL, ASKED, from, NULL, from_count);
    double diagonal = figure_diagonal(to, to_count, row);
    NPG_TRY(npg_kdtree_open(&tree, to, to_count));
    npg_status status = npg_kdtree_nearest(tree, nearest, dist_sq, asked, n, 1, 1);
    npg_kdtree_close(&tree);
    if (status) return status;
    qsort(dist_sq, n, sizeof *dist_sq, npg_order_float);
    *step = diagonal > 0 ? sqrt((double)dist_sq[n * 9 / 10]) / diagonal : -1;
    return NPG_OK;
}

npg_status npg_probe_motion_add(npg_probe_motion *m, const npg_frame *frame)
{
    float *points = NULL;
    size_t count = 0;
    double step = -1;
    npg_status status = thin_frame(&points, &count, frame);
    if (!status && count >= LEAST && m->last_count >= LEAST)
        status = measure_step(&step, m->last, m->last_count, points, count);
    if (!status && step >= 0) {
        m->sum += step;
        m->pairs++;
    }
    npg_release(&m->last);
    m->last = points;
    m->last_count = status ? 0 : count;
    return status;
}

void npg_probe_motion_uninit(npg_probe_motion *m)
{
    npg_release(&m->last);
}
