/* How well the sensors of a rig agree: the share of what one sees that others see, too, and how far their
 * surfaces lie apart there.
 *
 * In each of a few frames every sensor's points are matched with the mean of the nearest points of each other
 * sensor; the distance is taken along the normals of both, which a curved surface does not bias (symmetric
 * point to plane).
 *
 * Based on: Rusinkiewicz, A symmetric objective function for ICP, 2019. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "geometry/kdtree.h"
#include "geometry/vec3.h"
#include "ingest/rig/rig.h"
#include "pipeline/memory.h"

#define TARGETS_MAX 8000 /* points of a sensor and frame that others are matched with                       */
#define SOURCES_MAX                                                                                          \
    1500              /* points of a sensor and frame that are matched                                    */
#define NEAREST 8     /* points whose mean is the other half of a pair: one alone is chosen by its noise  */
#define REACH   0.025 /* of the depth: surfaces further apart are different ones, or a sensor is far off  */
#define BESIDE                                                                                               \
    1.5           /* spacings that a pair may lie apart along the surface: where the other sensor's view ends,
                             the nearest point is not the same place                                     */
#define AGREE 0.8 /* cosine of two normals of one surface */

/* Points of one sensor in one frame, in the world. */
typedef struct view {
    float *points, *normals; /* N x 3, owned */
    double spacing;          /* of the points */
    npg_kdtree *tree;
    size_t count;
} view;

typedef struct measuring {
    npg_rig *rig;
    size_t frame_count, sensor_count;
    view *views;     /* frame_count x sensor_count, owned                */
    double depth;    /* median-like size: mean distance sensor to points */
    uint32_t *index; /* SOURCES_MAX, scratch, owned                      */
    float *dist_sq, *queries;
    npg_rig_view *views_of;
} measuring;

static view *view_of(const measuring *m, size_t f, size_t s)
{
    return &m->views[f * m->sensor_count + s];
}

static void close_measuring(measuring *m)
{
    for (size_t i = 0; m->views && i < m->frame_count * m->sensor_count; i++) {
        npg_kdtree_close(&m->views[i].tree);
        npg_release(&m->views[i].points);
        npg_release(&m->views[i].normals);
    }
    npg_release(&m->views);
    npg_release(&m->index);
    npg_release(&m->dist_sq);
    npg_release(&m->queries);
}

/* ---- what the sensors see ---- */

static void turn(double out[3], const double pose[12], const double v[3])
{
    for (size_t r = 0; r < 3; r++) out[r] = npg_vec3_dot(pose + 4 * r, v);
}

/* Mean distance of a few points to their neighbours. */
static npg_status measure_spacing(view *v)
{
    enum { SAMPLE = 256 };
    float queries[3 * SAMPLE] = {0}, dist_sq[2 * SAMPLE];
    uint32_t index[2 * SAMPLE];
    size_t count = v->count < SAMPLE ? v->count : SAMPLE;
    for (size_t i = 0; i < count; i++)
        memcpy(queries + 3 * i, v->points + 3 * (i * v->count / count), 3 * sizeof(float));
    NPG_TRY(npg_kdtree_nearest(v->tree, index, dist_sq, queries, count, 2, 0));
    for (size_t i = 0; i < count; i++)
        if (isfinite(dist_sq[2 * i + 1])) v->spacing += sqrt((double)dist_sq[2 * i + 1]) / (double)count;
    return NPG_OK;
}

static npg_status fill_view(view *v, const npg_depth_points *points, const double pose[12])
{
    size_t step = points->count / TARGETS_MAX + 1;
    size_t count = (points->count + step - 1) / step;
    NPG_TRY(npg_alloc_array(&v->points, NPG_FOR_FILES, count, 3 * sizeof(float)));
    NPG_TRY(npg_alloc_array(&v->normals, NPG_FOR_FILES, count, 3 * sizeof(float)));
    for (size_t i = 0; i < points->count; i += step) {
        double p[3], n[3], world[3], facing[3];
        for (size_t a = 0; a < 3; a++) {
            p[a] = (double)points->pos[3 * i + a];
            n[a] = (double)points->normals[3 * i + a];
        }
        npg_pose_apply(world, pose, p);
        turn(facing, pose, n);
        for (size_t a = 0; a < 3; a++) {
            v->points[3 * v->count + a] = (float)world[a];
            v->normals[3 * v->count + a] = (float)facing[a];
        }
        v->count++;
    }
    if (!v->count) return NPG_OK;
    NPG_TRY(npg_kdtree_open(&v->tree, v->points, v->count));
    return measure_spacing(v);
}

static npg_status see(measuring *m, size_t at, size_t frame, size_t s)
{
    const npg_rig_shot *shot = npg_rig_shot_of(m->rig, frame, s);
    npg_depth_points points;
    double pose[12];
    if (!shot) return NPG_OK;
    NPG_TRY(npg_depth_points_read(&points, m->rig, s, shot));
    npg_rig_pose(m->rig, pose, s, shot);
    npg_status status = fill_view(view_of(m, at, s), &points, pose);
    m->views_of[s].frames++;
    m->views_of[s].points += points.count;
    for (size_t i = 0; i < points.count; i++) m->depth += (double)points.pos[3 * i + 2];
    npg_depth_points_clear(&points);
    return status;
}

static npg_status see_all(measuring *m)
{
    size_t points = 0;
    for (size_t f = 0; f < m->frame_count; f++)
        for (size_t s = 0; s < m->sensor_count; s++)
            NPG_TRY(see(m, f, f * m->rig->frame_count / m->frame_count, s));
    for (size_t s = 0; s < m->sensor_count; s++) points += m->views_of[s].points;
    if (points) m->depth /= (double)points;
    return NPG_OK;
}

/* ---- pairs ---- */

/* Means of the nearest points and their normals. */
static bool mean_nearest(double point[3], double normal[3], const view *with, const uint32_t *index)
{
    for (size_t a = 0; a < 3; a++) point[a] = normal[a] = 0;
    for (size_t k = 0; k < NEAREST; k++) {
        if (index[k] == UINT32_MAX) return false;
        for (size_t a = 0; a < 3; a++) {
            point[a] += (double)with->points[3 * (size_t)index[k] + a] / NEAREST;
            normal[a] += (double)with->normals[3 * (size_t)index[k] + a];
        }
    }
    return npg_vec3_make_unit(normal);
}

/* Distance of point i to the surface that another sensor sees there; false where it sees none. */
static bool dist_to(double *dist, const view *of, size_t i, const view *with, const uint32_t *index,
                    double reach)
{
    double own[3], n[3], q[3], d[3];
    for (size_t a = 0; a < 3; a++) own[a] = (double)of->normals[3 * i + a];
    if (!mean_nearest(q, n, with, index) || npg_vec3_dot(own, n) < AGREE) return false;
    for (size_t a = 0; a < 3; a++) {
        n[a] += own[a];
        d[a] = (double)of->points[3 * i + a] - q[a];
    }
    npg_vec3_make_unit(n);
    double along = npg_vec3_dot(n, d), beside = BESIDE * with->spacing;
    *dist = fabs(along);
    return *dist <= reach && npg_vec3_dot(d, d) - along * along <= beside * beside;
}

typedef struct sums {
    double square;
    size_t pairs, seen, asked;
} sums;

static npg_status pair_views(measuring *m, sums *out, uint8_t *is_seen, const view *of, const view *with)
{
    size_t step = of->count / SOURCES_MAX + 1, count = 0;
    for (size_t i = 0; i < of->count; i += step, count++)
        memcpy(m->queries + 3 * count, of->points + 3 * i, 3 * sizeof(float));
    NPG_TRY(npg_kdtree_nearest(with->tree, m->index, m->dist_sq, m->queries, count, NEAREST, 0));
    for (size_t k = 0; k < count; k++) {
        double dist;
        if (!dist_to(&dist, of, k * step, with, m->index + NEAREST * k, REACH * m->depth)) continue;
        out->square += dist * dist;
        out->pairs++;
        is_seen[k] = 1;
    }
    return NPG_OK;
}

static npg_status compare_sensor(measuring *m, size_t s)
{
    uint8_t is_seen[SOURCES_MAX + 1];
    sums all = {.pairs = 0};
    for (size_t f = 0; f < m->frame_count; f++) {
        const view *of = view_of(m, f, s);
        memset(is_seen, 0, sizeof is_seen);
        for (size_t o = 0; o < m->sensor_count && of->count; o++)
            if (o != s && view_of(m, f, o)->count)
                NPG_TRY(pair_views(m, &all, is_seen, of, view_of(m, f, o)));
        size_t step = of->count / SOURCES_MAX + 1;
        for (size_t k = 0; k * step < of->count; k++) all.seen += is_seen[k];
        all.asked += of->count ? (of->count + step - 1) / step : 0;
    }
    m->views_of[s].overlap = all.asked ? (double)all.seen / (double)all.asked : 0;
    m->views_of[s].apart = all.pairs ? sqrt(all.square / (double)all.pairs) : 0;
    return NPG_OK;
}

/* ---- the answer ---- */

static npg_status compare(measuring *m)
{
    size_t views = m->frame_count * m->sensor_count;
    NPG_TRY(npg_alloc_array(&m->views, NPG_FOR_FILES, views, sizeof *m->views));
    NPG_TRY(npg_alloc_array(&m->index, NPG_FOR_FILES, SOURCES_MAX + 1, NEAREST * sizeof *m->index));
    NPG_TRY(npg_alloc_array(&m->dist_sq, NPG_FOR_FILES, SOURCES_MAX + 1, NEAREST * sizeof *m->dist_sq));
    NPG_TRY(npg_alloc_array(&m->queries, NPG_FOR_FILES, SOURCES_MAX + 1, 3 * sizeof *m->queries));
    NPG_TRY(see_all(m));
    for (size_t s = 0; s < m->sensor_count; s++) NPG_TRY(compare_sensor(m, s));
    return NPG_OK;
}

npg_status npg_rig_compare(npg_rig *rig, npg_rig_view *views_of, size_t sample)
{
    measuring m = {.rig = rig,
                   .frame_count = sample < rig->frame_count ? sample : rig->frame_count,
                   .sensor_count = rig->sensor_count,
                   .views_of = views_of};
    memset(views_of, 0, rig->sensor_count * sizeof *views_of);
    npg_status status = compare(&m);
    close_measuring(&m);
    return status;
}
