/* One view: pictures of the cloud, cells of a pinhole camera's. */
#include "outlier/outlier_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "pipeline/frame_box.h"
#include "pipeline/memory.h"

#define VIEW_CELLS_MAX 512 /* per side of the picture */
/* Of hidden points, by trial: one view has 0.05 at most, clouds of several 0.08 and more. */
#define HIDDEN_MAX 0.06
#define POINTS     5000 /* that are drawn, ... */
#define PLACES     400  /* ... from so many places */

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
    npg_bounds bounds = npg_bounds_empty();
    npg_bounds_add_points(&bounds, points, n);
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
    double best[3];        /* direction from the cloud's middle */
} search;

static void place_of(double sensor[3], const search *s, const double direction[3])
{
    double away = NPG_SENSOR_AWAY * npg_bounds_diagonal(&s->bounds);
    for (int a = 0; a < 3; a++) sensor[a] = (s->bounds.lo[a] + s->bounds.hi[a]) / 2 + away * direction[a];
}

/* False for so few points that there is no picture. */
static bool aim(view *v, const search *s, const double direction[3])
{
    double sensor[3];
    place_of(sensor, s, direction);
    return aim_view(v, &s->bounds, sensor, s->count);
}

/* Each direction's hidden share in shares (INFINITY: no picture); the best of them becomes s->best.  Returns its
 * share. */
static double try_places(search *s, double *shares)
{
    double least = INFINITY;
    for (size_t i = 0; i < PLACES; i++) {
        double direction[3];
        view v;
        npg_direction_spread(direction, i, PLACES);
        shares[i] = INFINITY;
        if (!aim(&v, s, direction)) continue;
        shares[i] = hidden_share(&v, s->cells, s->points, s->count);
        if (shares[i] >= least) continue;
        least = shares[i];
        memcpy(s->best, direction, sizeof s->best);
    }
    return least;
}

/* The mean line of the places from which the cloud looks like one view, both sides of the cloud alike. */
static void take_mean(search *s, const double *shares)
{
    for (int round = 0; round < NPG_ROUNDS_MOST; round++) {
        double mean[3] = {0};
        for (size_t i = 0; i < PLACES; i++) {
            double direction[3], weight = HIDDEN_MAX - shares[i];
            if (!(weight > 0)) continue;
            npg_direction_spread(direction, i, PLACES);
            if (npg_vec3_dot(direction, s->best) < 0) weight = -weight;
            for (int a = 0; a < 3; a++) mean[a] += weight * direction[a];
        }
        npg_vec3_make_unit(mean);
        for (int a = 0; a < 3; a++) s->best[a] = mean[a];
    }
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

/* Turn s->best to the side that the cloud bulges to; false where the outline does not tell: a lead that chance gives, too. */
static bool choose_side(search *s)
{
    size_t farther = 0, nearer = 0;
    double other[3] = {-s->best[0], -s->best[1], -s->best[2]};
    view v;
    if (aim(&v, s, s->best)) count_outline(&v, s, &farther, &nearer);
    if (aim(&v, s, other)) count_outline(&v, s, &nearer, &farther);
    if (nearer > farther)
        for (int a = 0; a < 3; a++) s->best[a] = other[a];
    return fabs((double)farther - (double)nearer) > NPG_BEYOND * sqrt((double)(farther + nearer));
}

static bool find_place(search *s)
{
    double shares[PLACES];
    if (!(try_places(s, shares) < HIDDEN_MAX)) return false;
    take_mean(s, shares);
    return choose_side(s);
}

size_t npg_one_view_memory(void)
{
    return POINTS * (3 + 2) * sizeof(float);
}

npg_status npg_one_view_find(bool *found, double sensor[3], const float *points, size_t n)
{
    search s = {.bounds = npg_bounds_empty()};
    float *room, *pictures = NULL;
    *found = false;
    NPG_TRY(npg_alloc_array(&room, NPG_FOR_FRAMES, POINTS, 3 * sizeof *room));
    /* four points a cell (aim_view): never more cells than points */
    npg_status status = npg_alloc_array(&pictures, NPG_FOR_FRAMES, POINTS, 2 * sizeof *pictures);
    if (!status) {
        s.points = room;
        s.count = npg_points_spread(room, NULL, POINTS, points, NULL, n);
        npg_bounds_add_points(&s.bounds, room, s.count);
        s.cells = pictures;
        s.counts = pictures + POINTS;
        *found = find_place(&s);
        if (*found) place_of(sensor, &s, s.best);
    }
    npg_release(&room);
    npg_release(&pictures);
    return status;
}
