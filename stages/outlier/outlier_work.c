/* Outlier as work to be timed: isolated points and normals of one cloud. */
#include "outlier/normals.h"
#include "outlier/outlier.h"
#include "outlier/outlier_internal.h"
#include "pipeline/memory.h"

enum { NEIGHBOURS = 12, NORMAL_NEIGHBOURS = 16 }; /* the defaults of the options */

typedef struct cloud {
    const float *points;
    size_t count;
    uint8_t *keep;
    float *normals;
} cloud;

static npg_status find_isolated(void *user)
{
    const cloud *c = user;
    return npg_find_isolated(c->keep, c->points, c->count, NEIGHBOURS, 5, 0);
}

static npg_status estimate_normals(void *user)
{
    const cloud *c = user;
    return npg_normals_estimate(c->normals, c->points, c->count, NORMAL_NEIGHBOURS);
}

npg_status npg_outlier_work(const float *points, size_t point_count, npg_work_visit *visit, void *user)
{
    cloud c = {.points = points, .count = point_count};
    const double N = (double)point_count;
    /* At least: the distances to the neighbours that are found, and the points and results once. */
    npg_work isolated = {.name = "outlier_isolated",
                         .call = find_isolated,
                         .user = &c,
                         .flops = N * NEIGHBOURS * 9,
                         .bytes = N * (12 + 5),
                         .points = N,
                         .on_host = true};
    npg_work normals = {.name = "outlier_normals",
                        .call = estimate_normals,
                        .user = &c,
                        .flops = N * NORMAL_NEIGHBOURS * (8 + 21),
                        .bytes = N * 24,
                        .points = N,
                        .on_host = true};
    npg_status status = npg_alloc(&c.keep, NPG_FOR_RUN, point_count);
    if (!status) status = npg_alloc_array(&c.normals, NPG_FOR_RUN, point_count, 3 * sizeof(float));
    if (!status) status = visit(user, &isolated);
    if (!status) status = visit(user, &normals);
    npg_release(&c.keep);
    npg_release(&c.normals);
    return status;
}
