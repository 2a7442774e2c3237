/* Free space: what the depth images of a frame say of places. */
#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/sensor_space.h"
#include "pipeline/memory.h"

/* In cells: so far beside all that was seen is clearly outside of its outline, where a sensor mixes the body with
 * what is behind it, and so far before it is clearly in front; and so far off lies what one ray may have hit. */
#define BESIDE 3
#define AROUND 1

typedef struct view {
    double to_sensor[12], first[2], step; /* as npg_depth_view, but of unit coordinates */
    ptrdiff_t width, height;
    float *cells;   /* H x W: the depth of each, infinite: nothing, 0: not known           */
    float *nearest; /* H x W: the least depth within AROUND, infinite: none                */
    float *near_by; /* H x W: the same within BESIDE; NaN: none, but not all is known there */
} view;

struct npg_free_space {
    npg_arena arena;
    size_t count;
    view *views;
};

/* ---- making ---- */

static void take_pose(view *v, const npg_depth_view *from, const npg_frame_box *box)
{
    for (int a = 0; a < 3; a++) {
        const double *row = from->to_sensor + 4 * a;
        double *to = v->to_sensor + 4 * a;
        to[3] = row[3];
        for (int c = 0; c < 3; c++) {
            to[c] = row[c];
            to[3] += row[c] * box->centre[c];
        }
        to[3] *= box->scale;
    }
}

/* out[i] = the least of the cells whose middles are within reach of that of cell i. */
static void take_least(float *out, const float *in, const view *v, ptrdiff_t reach)
{
    for (ptrdiff_t y = 0; y < v->height; y++)
        for (ptrdiff_t x = 0; x < v->width; x++) {
            float least = INFINITY;
            for (ptrdiff_t dy = -reach; dy <= reach; dy++)
                for (ptrdiff_t dx = -reach; dx <= reach; dx++) {
                    ptrdiff_t i = x + dx, j = y + dy;
                    if (dx * dx + dy * dy > reach * reach || i < 0 || j < 0 || i >= v->width ||
                        j >= v->height)
                        continue;
                    least = fminf(least, in[j * v->width + i]);
                }
            out[y * v->width + x] = least;
        }
}

static npg_status open_view(view *v, npg_arena *arena, const npg_depth_view *from, const float *cells,
                            const npg_frame_box *box)
{
    npg_arena scratch = {.purpose = NPG_FOR_FIT};
    size_t count = (size_t)from->width * from->height;
    *v = (view){.first = {from->first[0], from->first[1]},
                .step = from->step,
                .width = from->width,
                .height = from->height};
    take_pose(v, from, box);
    v->cells = npg_arena_take(arena, count, sizeof *v->cells);
    v->nearest = npg_arena_take(arena, count, sizeof *v->nearest);
    v->near_by = npg_arena_take(arena, count, sizeof *v->near_by);
    float *of_each = npg_arena_take(&scratch, count, sizeof *of_each),
          *known = npg_arena_take(&scratch, count, sizeof *known);
    npg_status status = npg_arena_status(arena);
    if (!status) status = npg_arena_status(&scratch);
    for (size_t i = 0; i < count && !status; i++) {
        v->cells[i] = (float)(box->scale * (double)cells[i]);
        of_each[i] = v->cells[i] > 0;
    }
    if (!status) take_least(known, of_each, v, BESIDE);
    for (size_t i = 0; i < count && !status; i++) of_each[i] = v->cells[i] > 0 ? v->cells[i] : INFINITY;
    if (!status) take_least(v->nearest, of_each, v, AROUND);
    if (!status) take_least(v->near_by, of_each, v, BESIDE);
    for (size_t i = 0; i < count && !status; i++)
        if (isinf(v->near_by[i]) && !(known[i] > 0)) v->near_by[i] = NAN;
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_free_space_open(npg_free_space **out, const npg_frame *frame, const npg_frame_box *box)
{
    *out = NULL;
    if (!frame->views) return NPG_OK;
    NPG_TRY(npg_object_open(out, NPG_FOR_FIT, sizeof **out));
    npg_free_space *s = *out;
    s->views = npg_arena_take(&s->arena, frame->sensor_count, sizeof *s->views);
    npg_status status = npg_arena_status(&s->arena);
    for (size_t i = 0; i < frame->sensor_count && !status; i++)
        if (frame->views[i].width)
            status = open_view(&s->views[s->count++], &s->arena, &frame->views[i],
                               frame->view_cells + frame->views[i].at, box);
    if (status) npg_free_space_close(out);
    return status;
}

void npg_free_space_close(npg_free_space **space)
{
    npg_object_close(space);
}

/* ---- looking ---- */

/* A place in the sensor's axes. */
static void see_from(double at[3], const view *v, const float place[3])
{
    for (int a = 0; a < 3; a++) {
        const double *row = v->to_sensor + 4 * a;
        at[a] = row[3];
        for (int c = 0; c < 3; c++) at[a] += row[c] * (double)place[c];
    }
}

static npg_sight_kind look(const view *v, const float place[3], double *margin)
{
    double at[3];
    see_from(at, v, place);
    if (!(at[2] > 0)) return NPG_SEEN_UNKNOWN;
    double x = floor((at[0] / at[2] - v->first[0]) / v->step),
           y = floor((at[1] / at[2] - v->first[1]) / v->step);
    if (!(x >= 0 && y >= 0 && x < (double)v->width && y < (double)v->height)) return NPG_SEEN_UNKNOWN;
    ptrdiff_t i = (ptrdiff_t)y * v->width + (ptrdiff_t)x;
    *margin = BESIDE * v->step * at[2];
    if (!(v->cells[i] > 0)) return NPG_SEEN_UNKNOWN;
    if (isnan(v->near_by[i])) return NPG_SEEN_UNKNOWN;
    if (isinf(v->near_by[i])) return NPG_SEEN_BESIDE;
    if (at[2] < (double)v->near_by[i] - *margin) return NPG_SEEN_EMPTY;
    if (isinf(v->cells[i])) return NPG_SEEN_UNKNOWN; /* beside the outline, but not clearly */
    if (at[2] < (double)v->nearest[i] - *margin) return NPG_SEEN_EMPTY;
    return at[2] <= (double)v->cells[i] + *margin ? NPG_SEEN_AT : NPG_SEEN_HIDDEN;
}

npg_sight_kind npg_free_space_look(const npg_free_space *space, const float place[3])
{
    npg_sight_kind all = NPG_SEEN_UNKNOWN;
    double margin;
    for (size_t i = 0; i < space->count; i++) {
        npg_sight_kind one = look(&space->views[i], place, &margin);
        if (one == NPG_SEEN_EMPTY || one == NPG_SEEN_BESIDE) return one;
        if (one == NPG_SEEN_AT || (one == NPG_SEEN_HIDDEN && all == NPG_SEEN_UNKNOWN)) all = one;
    }
    return all;
}

bool npg_free_space_is_empty(const npg_free_space *space, const float place[3])
{
    if (!space) return false;
    npg_sight_kind kind = npg_free_space_look(space, place);
    return kind == NPG_SEEN_EMPTY || kind == NPG_SEEN_BESIDE;
}

/* ---- the way out ---- */

/* In the sensor's axes. */
typedef struct way_out {
    double from[3], to[3], dist_sq;
} way_out;

/* On the ray of a cell: what was seen, or the nearest place behind it. */
static void try_cell(way_out *way, const view *v, ptrdiff_t x, ptrdiff_t y)
{
    if (x < 0 || y < 0 || x >= v->width || y >= v->height) return;
    double depth = (double)v->cells[y * v->width + x], to[3], off[3];
    const double ray[3] = {v->first[0] + ((double)x + 0.5) * v->step,
                           v->first[1] + ((double)y + 0.5) * v->step, 1};
    if (!(depth > 0) || isinf(depth)) return;
    depth = fmax(depth, npg_vec3_dot(ray, way->from) / npg_vec3_dot(ray, ray));
    for (int a = 0; a < 3; a++) to[a] = depth * ray[a];
    npg_vec3_sub(off, to, way->from);
    if (!(npg_vec3_dot(off, off) < way->dist_sq)) return;
    way->dist_sq = npg_vec3_dot(off, off);
    memcpy(way->to, to, sizeof to);
}

/* Ring by ring around the place's own cell, for as long as a ring may hold a nearer place: none of its rays, at
 * most `longest` times their depth long, comes nearer than the ring is at the place's depth, over that. */
static void search(way_out *way, const view *v)
{
    double slope[3] = {0, 0, 1};
    ptrdiff_t own[2];
    for (int a = 0; a < 2; a++) {
        double last = v->first[a] + (double)(a ? v->height : v->width) * v->step;
        slope[a] = fmax(fabs(v->first[a]), fabs(last));
        own[a] = (ptrdiff_t)floor((way->from[a] / way->from[2] - v->first[a]) / v->step);
    }
    double ring = v->step * way->from[2] / npg_vec3_length(slope);
    for (ptrdiff_t r = 0; r < v->width + v->height; r++) {
        double least = fmax(0, ((double)r - 0.5) * ring);
        if (least * least > way->dist_sq) return;
        for (ptrdiff_t y = -r; y <= r; y++)
            for (ptrdiff_t x = -r; x <= r; x += !r || y == r || y == -r ? 1 : 2 * r)
                try_cell(way, v, own[0] + x, own[1] + y);
    }
}

bool npg_free_space_leave(const npg_free_space *space, float to[3], const float place[3])
{
    double margin, nearest_sq = HUGE_VAL;
    for (size_t i = 0; i < space->count; i++) {
        const view *v = &space->views[i];
        npg_sight_kind kind = look(v, place, &margin);
        if (kind != NPG_SEEN_EMPTY && kind != NPG_SEEN_BESIDE) continue;
        way_out way = {.dist_sq = nearest_sq};
        see_from(way.from, v, place);
        search(&way, v);
        if (!(way.dist_sq < nearest_sq)) continue;
        nearest_sq = way.dist_sq;
        for (int a = 0; a < 3; a++) way.to[a] -= way.from[a];
        for (int c = 0; c < 3; c++) {
            to[c] = place[c];
            for (int a = 0; a < 3; a++) to[c] += (float)(v->to_sensor[4 * a + c] * way.to[a]);
        }
    }
    return isfinite(nearest_sq);
}

double npg_free_space_margin(const npg_free_space *space, const float place[3])
{
    double least = 0, margin;
    for (size_t i = 0; i < space->count; i++)
        if (look(&space->views[i], place, &margin) == NPG_SEEN_AT && (!(least > 0) || margin < least))
            least = margin;
    return least;
}

double npg_free_space_lost_share(const npg_free_space *space, const float *points,
                                 const npg_surface_hit *hits, size_t count)
{
    size_t known = 0, lost = 0;
    for (size_t i = 0; i < count; i++) {
        double margin = npg_free_space_margin(space, points + 3 * i);
        known += margin > 0;
        lost += margin > 0 && (double)hits[i].dist_sq > margin * margin;
    }
    return known ? (double)lost / (double)known : 0;
}

size_t npg_free_space_memory(size_t sensor_count)
{
    return sensor_count * (sizeof(view) + (size_t)NPG_VIEW_SIDE * NPG_VIEW_SIDE * 3 * sizeof(float));
}
