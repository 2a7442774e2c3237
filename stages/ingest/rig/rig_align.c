/* How far the poses of a rig's sensors are off, from the surfaces that more than one of them sees.
 *
 * In each of a few frames every sensor's points are matched with the nearest points of the others whose
 * normals agree, and each sensor in turn is moved so that the distances along the others' normals become
 * least (point to plane), sensor 0 held, until nothing moves any more.
 *
 * Based on: Chen, Medioni, Object modelling by registration of multiple range images, 1992. */
#include <math.h>
#include <string.h>

#include "geometry/kdtree.h"
#include "geometry/vec3.h"
#include "ingest/rig/rig.h"
#include "pipeline/memory.h"

#define TARGETS_MAX 8000 /* points of a sensor and frame that others are matched with */
#define SOURCES_MAX 1500 /* points of a sensor and frame that are matched             */
#define ROUNDS      40
#define REACH       0.05 /* of the depth: pairs further apart at the start are none; halved to REACH_END */
#define REACH_END   0.006
#define AGREE       0.8  /* cosine of two normals of one surface                          */
#define OVERLAP_MIN 0.02 /* share of a sensor's points below which its pose can't be told */
#define STILL       1e-7 /* of the depth: a round that moves less ends the search         */

/* Points of one sensor in one frame, as its uncorrected pose puts them. */
typedef struct view {
    float *points, *normals; /* N x 3, owned */
    npg_kdtree *tree;
    size_t count;
    double centre[3]; /* the sensor's own place */
} view;

typedef struct measuring {
    npg_rig *rig;
    size_t frame_count, sensor_count;
    view *views;         /* frame_count x sensor_count, owned                */
    double *corrections; /* sensor_count x 12, world to world; owned         */
    double depth;        /* median-like size: mean distance sensor to points */
    uint32_t *index;     /* SOURCES_MAX, scratch, owned                      */
    float *dist_sq, *queries;
    npg_rig_offset *offsets;
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
    npg_release(&m->corrections);
    npg_release(&m->index);
    npg_release(&m->dist_sq);
    npg_release(&m->queries);
}

/* ---- what the sensors see ---- */

static void turn(double out[3], const double pose[12], const double v[3])
{
    for (size_t r = 0; r < 3; r++) out[r] = npg_vec3_dot(pose + 4 * r, v);
}

static npg_status fill_view(view *v, const npg_depth_points *points, const double pose[12])
{
    size_t step = points->count / TARGETS_MAX + 1;
    size_t count = (points->count + step - 1) / step;
    NPG_TRY(npg_alloc_array(&v->points, NPG_FOR_FILES, count, 3 * sizeof(float)));
    NPG_TRY(npg_alloc_array(&v->normals, NPG_FOR_FILES, count, 3 * sizeof(float)));
    for (size_t i = 0; i < points->count; i += step, v->count++) {
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
    }
    for (size_t a = 0; a < 3; a++) v->centre[a] = pose[4 * a + 3];
    return v->count ? npg_kdtree_open(&v->tree, v->points, v->count) : NPG_OK;
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
    m->offsets[s].frames++;
    m->offsets[s].points += points.count;
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
    for (size_t s = 0; s < m->sensor_count; s++) points += m->offsets[s].points;
    if (points) m->depth /= (double)points;
    return NPG_OK;
}

/* ---- pairs ---- */

/* Sums of the normal equations over all pairs of one sensor. */
typedef struct sums {
    double a[6][6], b[6], square;
    size_t pairs, asked;
    double about[3];
} sums;

static void add_pair(sums *s, const double p[3], const double q[3], const double n[3], double reach)
{
    double d[3], arm[3], row[6];
    npg_vec3_sub(d, p, q);
    double r = npg_vec3_dot(n, d), share = r / reach, w = 1 - share * share;
    if (w <= 0) return;
    w *= w; /* Tukey: pairs at the end of the reach count nothing */
    npg_vec3_sub(arm, p, s->about);
    npg_vec3_cross(row, arm, n);
    memcpy(row + 3, n, 3 * sizeof *n);
    for (size_t i = 0; i < 6; i++) {
        for (size_t k = 0; k < 6; k++) s->a[i][k] += w * row[i] * row[k];
        s->b[i] -= w * row[i] * r;
    }
    s->square += r * r;
    s->pairs++;
}

/* Pairs of sensor s in one frame with what sensor o sees there, each where its correction puts it. */
static npg_status pair_views(measuring *m, sums *out, uint8_t *is_seen, const view *of, size_t s,
                             const view *with, size_t o, double reach)
{
    const double *mine = m->corrections + 12 * s, *other = m->corrections + 12 * o;
    size_t step = of->count / SOURCES_MAX + 1, count = 0;
    double back[12];
    npg_pose_invert(back, other);
    for (size_t i = 0; i < of->count; i += step, count++) {
        double p[3], at[3];
        for (size_t a = 0; a < 3; a++) at[a] = (double)of->points[3 * i + a];
        npg_pose_apply(p, mine, at);
        npg_pose_apply(at, back, p);
        for (size_t a = 0; a < 3; a++) m->queries[3 * count + a] = (float)at[a];
    }
    NPG_TRY(npg_kdtree_nearest(with->tree, m->index, m->dist_sq, m->queries, count, 1, 0));
    for (size_t k = 0; k < count; k++) {
        size_t i = k * step, j = m->index[k];
        double p[3], n[3], q[3], own[3], at[3], raw[3];
        if (!((double)m->dist_sq[k] < reach * reach)) continue;
        for (size_t a = 0; a < 3; a++) raw[a] = (double)of->normals[3 * i + a];
        turn(own, mine, raw);
        for (size_t a = 0; a < 3; a++) raw[a] = (double)with->normals[3 * j + a];
        turn(n, other, raw);
        if (npg_vec3_dot(own, n) < AGREE) continue;
        for (size_t a = 0; a < 3; a++) at[a] = (double)of->points[3 * i + a];
        npg_pose_apply(p, mine, at);
        for (size_t a = 0; a < 3; a++) at[a] = (double)with->points[3 * j + a];
        npg_pose_apply(q, other, at);
        add_pair(out, p, q, n, reach);
        is_seen[k] = 1;
    }
    return NPG_OK;
}

static npg_status pair_sensor(measuring *m, sums *out, size_t s, double reach)
{
    uint8_t is_seen[SOURCES_MAX + 1];
    *out = (sums){.pairs = 0};
    size_t seen = 0;
    for (size_t f = 0; f < m->frame_count && !seen; f++) {
        const view *of = view_of(m, f, s);
        seen = of->count;
        if (seen) npg_pose_apply(out->about, m->corrections + 12 * s, of->centre);
    }
    seen = 0;
    for (size_t f = 0; f < m->frame_count; f++) {
        const view *of = view_of(m, f, s);
        memset(is_seen, 0, sizeof is_seen);
        for (size_t o = 0; o < m->sensor_count && of->count; o++)
            if (o != s && view_of(m, f, o)->count)
                NPG_TRY(pair_views(m, out, is_seen, of, s, view_of(m, f, o), o, reach));
        size_t step = of->count / SOURCES_MAX + 1;
        for (size_t k = 0; k * step < of->count; k++) seen += is_seen[k];
        out->asked += of->count ? (of->count + step - 1) / step : 0;
    }
    m->offsets[s].overlap = out->asked ? (double)seen / (double)out->asked : 0;
    m->offsets[s].rms = out->pairs ? sqrt(out->square / (double)out->pairs) : 0;
    return NPG_OK;
}

/* ---- moves ---- */

/* x of A x = b, A symmetric and positive with the little that is added to it; Cholesky. */
static bool solve(double x[6], double a[6][6], const double b[6])
{
    double l[6][6] = {{0}}, y[6], trace = 0;
    for (size_t i = 0; i < 6; i++) trace += a[i][i];
    for (size_t i = 0; i < 6; i++)
        for (size_t k = 0; k <= i; k++) {
            double sum = a[i][k] + (i == k ? 1e-9 * trace : 0);
            for (size_t j = 0; j < k; j++) sum -= l[i][j] * l[k][j];
            if (i == k && !(sum > 0)) return false;
            l[i][k] = i == k ? sqrt(sum) : sum / l[k][k];
        }
    for (size_t i = 0; i < 6; i++) {
        y[i] = b[i];
        for (size_t j = 0; j < i; j++) y[i] -= l[i][j] * y[j];
        y[i] /= l[i][i];
    }
    for (size_t i = 6; i-- > 0;) {
        x[i] = y[i];
        for (size_t j = i + 1; j < 6; j++) x[i] -= l[j][i] * x[j];
        x[i] /= l[i][i];
    }
    return true;
}

/* The move of a small turn (x[0..2], radians, about a point) and shift (x[3..5]). */
static void move_of(double out[12], const double x[6], const double about[3])
{
    double angle = npg_vec3_length(x), q[4] = {0, 0, 0, cos(angle / 2)}, t[3] = {0}, moved[3];
    for (int a = 0; a < 3 && angle > 0; a++) q[a] = x[a] / angle * sin(angle / 2);
    npg_pose_of_quaternion(out, q, t, "a move");
    npg_pose_apply(moved, out, about);
    for (size_t a = 0; a < 3; a++) out[4 * a + 3] = about[a] - moved[a] + x[3 + a];
}

/* One step of a sensor; *moved is how far it took it at the depth of the body. */
static npg_status step_sensor(measuring *m, size_t s, double reach, double *moved)
{
    sums pairs;
    double x[6], move[12], now[12];
    NPG_TRY(pair_sensor(m, &pairs, s, reach));
    if (m->offsets[s].overlap < OVERLAP_MIN || !solve(x, pairs.a, pairs.b)) return NPG_OK;
    move_of(move, x, pairs.about);
    npg_pose_combine(now, move, m->corrections + 12 * s);
    memcpy(m->corrections + 12 * s, now, sizeof now);
    *moved = fmax(*moved, npg_vec3_length(x + 3) + m->depth * npg_vec3_length(x));
    return NPG_OK;
}

static npg_status move_all(measuring *m)
{
    double reach = REACH * m->depth, end = REACH_END * m->depth, moved = 1;
    for (int round = 0; round < ROUNDS && (reach > end || moved > STILL * m->depth); round++) {
        moved = 0;
        for (size_t s = 1; s < m->sensor_count; s++) NPG_TRY(step_sensor(m, s, reach, &moved));
        reach = fmax(end, 0.8 * reach);
    }
    for (size_t s = 0; s < m->sensor_count; s++) {
        sums last;
        NPG_TRY(pair_sensor(m, &last, s, end));
    }
    return NPG_OK;
}

/* ---- the answer ---- */

static void set_offset(const measuring *m, size_t s)
{
    npg_rig_offset *o = &m->offsets[s];
    const double *c = m->corrections + 12 * s;
    double moved[3], cosine = (c[0] + c[5] + c[10] - 1) / 2;
    const view *first = NULL;
    for (size_t f = 0; f < m->frame_count && !first; f++)
        if (view_of(m, f, s)->count) first = view_of(m, f, s);
    memcpy(o->correction, c, sizeof o->correction);
    o->is_known = s == 0 || o->overlap >= OVERLAP_MIN;
    if (!first) return;
    npg_pose_apply(moved, c, first->centre);
    npg_vec3_sub(moved, moved, first->centre);
    o->dist_mm = 1000 * npg_vec3_length(moved);
    o->turn_deg = acos(fmin(1, fmax(-1, cosine))) * 180 / 3.14159265358979323846;
}

static npg_status measure(measuring *m)
{
    size_t views = m->frame_count * m->sensor_count;
    NPG_TRY(npg_alloc_array(&m->views, NPG_FOR_FILES, views, sizeof *m->views));
    NPG_TRY(npg_alloc_array(&m->corrections, NPG_FOR_FILES, m->sensor_count, 12 * sizeof(double)));
    NPG_TRY(npg_alloc_array(&m->index, NPG_FOR_FILES, SOURCES_MAX + 1, sizeof *m->index));
    NPG_TRY(npg_alloc_array(&m->dist_sq, NPG_FOR_FILES, SOURCES_MAX + 1, sizeof *m->dist_sq));
    NPG_TRY(npg_alloc_array(&m->queries, NPG_FOR_FILES, SOURCES_MAX + 1, 3 * sizeof *m->queries));
    for (size_t s = 0; s < m->sensor_count; s++) npg_pose_identity(m->corrections + 12 * s);
    NPG_TRY(see_all(m));
    NPG_TRY(move_all(m));
    for (size_t s = 0; s < m->sensor_count; s++) set_offset(m, s);
    return NPG_OK;
}

npg_status npg_rig_measure(npg_rig *rig, npg_rig_offset *offsets, size_t sample)
{
    measuring m = {.rig = rig,
                   .frame_count = sample < rig->frame_count ? sample : rig->frame_count,
                   .sensor_count = rig->sensor_count,
                   .offsets = offsets};
    memset(offsets, 0, rig->sensor_count * sizeof *offsets);
    npg_status status = measure(&m);
    close_measuring(&m);
    return status;
}

void npg_rig_correct(npg_rig *rig, const npg_rig_offset *offsets)
{
    for (size_t s = 0; s < rig->sensor_count; s++) {
        double before[12];
        memcpy(before, rig->sensors[s].correction, sizeof before);
        if (offsets[s].is_known) npg_pose_combine(rig->sensors[s].correction, offsets[s].correction, before);
    }
}
