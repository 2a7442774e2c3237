/* One view: pictures of the cloud, cells of a pinhole camera's. */
#include "outlier/outlier_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "outlier/normals.h"
#include "pipeline/frame_box.h"
#include "pipeline/memory.h"

#define VIEW_CELLS_MAX 512 /* per side of the picture */
/* Of hidden points, by trial: one view has 0.05 at most, clouds of several 0.08 and more. */
#define HIDDEN_MAX 0.06
#define POINTS     5000 /* that are drawn; normals, of half as many, cost most of the time */
#define PLACES     400  /* directions all round: 10 degrees apart */

typedef struct view { /* a pinhole picture toward the middle of the cloud */
    double right[3], up[3], forward[3], sensor[3];
    double distance;   /* from the sensor to the middle */
    double half_width; /* tangent of half the angle */
    size_t cells;      /* per side */
    double cell_width; /* at the cloud's middle */
} view;

/* False when the sensor is inside the ball around the box or so near that the picture would be wider than
 * 120 degrees: asin(1 / 1.15) is 60. */
static bool aim_view(view *v, const npg_bounds *bounds, const double sensor[3], size_t point_count)
{
    double middle[3], radius = npg_bounds_diagonal(bounds) / 2;
    for (int a = 0; a < 3; a++) {
        middle[a] = (bounds->lo[a] + bounds->hi[a]) / 2;
        v->forward[a] = middle[a] - sensor[a];
        v->sensor[a] = sensor[a];
    }
    double distance = v->distance = npg_vec3_length(v->forward);
    if (!(distance > 1.15 * radius)) return false;
    npg_vec3_make_unit(v->forward);
    npg_vec3_span_plane(v->right, v->up, v->forward);
    v->half_width = radius / sqrt(distance * distance - radius * radius);
    v->cells = (size_t)sqrt((double)point_count / 4); /* four points a cell, if they filled the picture */
    if (v->cells > VIEW_CELLS_MAX) v->cells = VIEW_CELLS_MAX;
    v->cell_width = 2 * v->half_width * distance / (double)v->cells;
    return v->cells >= 4;
}

/* The cell a point falls into, and its depth behind the cloud's middle: pictures hold floats, and from far
 * away those of depths from the sensor would all be the same. */
static size_t project(double *depth, const view *v, const float *p)
{
    double d[3], at[2];
    for (int a = 0; a < 3; a++) d[a] = (double)p[a] - v->sensor[a];
    double from_sensor = npg_vec3_dot(d, v->forward);
    at[0] = npg_vec3_dot(d, v->right) / from_sensor;
    at[1] = npg_vec3_dot(d, v->up) / from_sensor;
    *depth = from_sensor - v->distance;
    size_t cell = 0;
    for (int i = 0; i < 2; i++) {
        double x = (at[i] / v->half_width + 1) / 2 * (double)v->cells;
        size_t c = x < 0 ? 0 : x >= (double)v->cells ? v->cells - 1 : (size_t)x;
        cell = cell * v->cells + c;
    }
    return cell;
}

/* ---- hidden points ---- */

/* Share of points that are hidden behind others; nearest: room for the picture's cells. */
static double hidden_share(const view *v, float *nearest, const float *points, size_t n)
{
    double depth, hidden_depth = NPG_WITHIN * v->cell_width;
    size_t hidden = 0;
    for (size_t i = 0; i < v->cells * v->cells; i++) nearest[i] = INFINITY;
    for (size_t i = 0; i < n; i++) {
        size_t cell = project(&depth, v, points + 3 * i);
        nearest[cell] = fminf(nearest[cell], (float)depth);
    }
    for (size_t i = 0; i < n; i++) {
        size_t cell = project(&depth, v, points + 3 * i);
        hidden += depth > (double)nearest[cell] + hidden_depth;
    }
    return (double)hidden / (double)n;
}

npg_status npg_cloud_is_single_view(bool *yes, const float *points, size_t n, const double sensor[3])
{
    view v;
    float *nearest;
    npg_bounds bounds = npg_bounds_of(points, n);
    *yes = false;
    if (!aim_view(&v, &bounds, sensor, n)) return NPG_OK;
    NPG_TRY(npg_alloc_array(&nearest, NPG_FOR_FRAMES, v.cells * v.cells, sizeof *nearest));
    *yes = hidden_share(&v, nearest, points, n) < HIDDEN_MAX;
    npg_release(&nearest);
    return NPG_OK;
}

/* ---- a place that is looked for ---- */

typedef struct search {
    const float *points;
    size_t count;
    npg_bounds bounds;
    float *cells, *counts; /* room for a picture, owned */
} search;

static void place_of(double sensor[3], const search *s, const double direction[3], double away)
{
    away *= NPG_SENSOR_AWAY * npg_bounds_diagonal(&s->bounds);
    for (int a = 0; a < 3; a++) sensor[a] = (s->bounds.lo[a] + s->bounds.hi[a]) / 2 + away * direction[a];
}

/* Share that is hidden from there; 1 where there is no picture. */
static double hidden_from(view *v, const search *s, const double direction[3])
{
    double sensor[3];
    place_of(sensor, s, direction, 1);
    return aim_view(v, &s->bounds, sensor, s->count) ? hidden_share(v, s->cells, s->points, s->count) : 1;
}

/* Mean depth of each cell, NAN where there is no point. */
static void draw_depths(const view *v, search *s)
{
    for (size_t i = 0; i < v->cells * v->cells; i++) s->cells[i] = s->counts[i] = 0;
    for (size_t i = 0; i < s->count; i++) {
        double depth;
        size_t cell = project(&depth, v, s->points + 3 * i);
        s->cells[cell] += (float)depth;
        s->counts[cell]++;
    }
    for (size_t i = 0; i < v->cells * v->cells; i++)
        s->cells[i] = s->counts[i] > 0 ? s->cells[i] / s->counts[i] : NAN;
}

/* Cells on the outline that are farther away, and nearer, than the one two steps inward. */
static void count_outline(const view *v, search *s, size_t *farther, size_t *nearer)
{
    const size_t side = v->cells;
    draw_depths(v, s);
    for (size_t cell = 0; cell < side * side; cell++) {
        size_t at[2] = {cell / side, cell % side};
        for (int way = 0; way < 4; way++) {
            size_t along = at[way / 2], stride = way / 2 ? 1 : side;
            if (along < 2 || along + 2 >= side) continue;
            const float *here = s->cells + cell;
            ptrdiff_t inward = way % 2 ? (ptrdiff_t)stride : -(ptrdiff_t)stride;
            float difference = *here - here[2 * inward];
            bool is_outline = isnan(here[-inward]) && !isnan(here[inward]) && !isnan(difference) &&
                              fabs((double)difference) < NPG_WITHIN * v->cell_width;
            *farther += is_outline && difference > 0;
            *nearer += is_outline && difference < 0;
        }
    }
}

/* A body that is broad and flat has most of its normals across, wherever it is seen from; where that hides some of it, the
 * mean of the directions around from which less is hidden is nearer. */
static void look_around(double direction[3], search *s)
{
    double mean[3] = {0}, around[3];
    view v;
    for (size_t i = 0; i < PLACES; i++) {
        npg_direction_spread(around, i, PLACES);
        if (npg_vec3_dot(around, direction) < M_SQRT1_2) continue;
        double weight = fmax(0, HIDDEN_MAX - hidden_from(&v, s, around));
        for (int a = 0; a < 3; a++) mean[a] += weight * around[a];
    }
    npg_vec3_make_unit(mean); /* or it stays 0, which sees nothing */
    memcpy(direction, mean, sizeof mean);
}

/* By how much the cloud bulges toward `direction`, as what is on its outline is farther away, in leads that chance
 * gives; -HUGE_VAL where it is not one view from there, nor from around: there *direction goes then. */
static double bulge(search *s, double direction[3])
{
    size_t farther = 0, nearer = 0;
    double sensor[3];
    view v;
    bool is_one_view = hidden_from(&v, s, direction) < HIDDEN_MAX;
    if (!is_one_view) look_around(direction, s);
    if (!is_one_view && !(hidden_from(&v, s, direction) < HIDDEN_MAX)) return -HUGE_VAL;
    count_outline(&v, s, &farther, &nearer);
    place_of(sensor, s, direction, -1);
    if (aim_view(&v, &s->bounds, sensor, s->count)) count_outline(&v, s, &nearer, &farther);
    return ((double)farther - (double)nearer) / sqrt((double)(farther + nearer + 1));
}

/* Where the normals of one side look in the mean, *length, 0..1; a whole body's cancel out.  Sides that the field leaves
 * undecided are mended from those that face where it looks so far, for as long as that makes it longer. */
static npg_status mean_normal(double mean[3], double *length, bool *mended, const search *s, npg_arena *at)
{
    float *few = npg_arena_take(at, POINTS / 2, 3 * sizeof *few);
    float *normals = npg_arena_take(at, POINTS / 2, 3 * sizeof *normals), toward[3];
    double place[3], longer;
    NPG_TRY(npg_arena_status(at));
    size_t flipped, n = npg_points_spread(few, NULL, POINTS / 2, s->points, NULL, s->count);
    NPG_TRY(npg_normals_make(normals, few, n));
    for (*mended = false, *length = 0;; *mended = true) {
        for (int a = 0; a < 3; a++) mean[a] = 0;
        for (size_t i = 0; i < 3 * n; i++) mean[i % 3] += (double)normals[i] / (double)n;
        *length += longer = npg_vec3_length(mean) - *length;
        npg_vec3_make_unit(mean);
        if ((!*mended && *length > NPG_MAJORITY) || longer < NPG_FEW) return NPG_OK;
        place_of(place, s, mean, 1);
        for (int a = 0; a < 3; a++) toward[a] = (float)place[a];
        npg_normals_face_sensor(normals, &flipped, few, n, toward);
        NPG_TRY(npg_normals_mend(normals, &flipped, few, n));
    }
}

size_t npg_one_view_memory(void)
{
    return POINTS * 8 * sizeof(float) + npg_winding_memory(POINTS / 2);
}

static npg_status find(bool *found, bool *is_sure, double sensor[3], npg_arena *arena, const float *points,
                       size_t n)
{
    search s = {.bounds = npg_bounds_empty()};
    double direction[3], length = 0;
    bool mended = false;
    float *drawn = npg_arena_take(arena, POINTS, 3 * sizeof *drawn);
    /* four points a cell (aim_view): never more cells than points */
    s.cells = npg_arena_take(arena, POINTS, sizeof *s.cells);
    s.counts = npg_arena_take(arena, POINTS, sizeof *s.counts);
    NPG_TRY(npg_arena_status(arena));
    s.points = drawn;
    s.count = npg_points_spread(drawn, NULL, POINTS, points, NULL, n);
    npg_bounds_add_points(&s.bounds, drawn, s.count);
    if (s.count) NPG_TRY(mean_normal(direction, &length, &mended, &s, arena));
    double lead = length > NPG_MAJORITY ? bulge(&s, direction) : -HUGE_VAL;
    *found = lead > 0;
    *is_sure = !mended && lead > NPG_BEYOND;
    if (*found) place_of(sensor, &s, direction, 1);
    return NPG_OK;
}

npg_status npg_one_view_find(bool *found, bool *is_sure, double sensor[3], const float *points, size_t n)
{
    npg_arena arena = {.purpose = NPG_FOR_FRAMES};
    *found = *is_sure = false;
    npg_status status = find(found, is_sure, sensor, &arena, points, n);
    npg_arena_release(&arena);
    return status;
}
