/* Depth map: nearest distances by direction, and the outline of what was seen. */
#include "geometry/geometry.h"
#include "geometry/sensor_space.h"

#include <math.h>
#include <string.h>

#include "pipeline/memory.h"

#define BINS_LEAST  16    /* along a side of the map */
#define BINS_MOST   1024  /* 4 MiB of distances */
#define SPHERE_SIDE 3.545 /* sqrt(4 pi): the side of a square as large as the sphere of directions */
#define OUTLINE     2     /* bins beside a point that still may be the body's */

struct npg_depth_map {
    npg_arena arena;
    float sensor[3];
    double axes[3][3]; /* the third looks at the points' middle */
    int bins;          /* along a side */
    double margin;
    float *near;      /* bins x bins: distance, infinity where there is none                 */
    uint8_t *outside; /* bins x bins: reached from behind without crossing the outline        */
};

/* ---- directions ---- */

/* The bin of a place, and its distance; false at the sensor. */
static bool find_bin(const npg_depth_map *m, int at[2], double *dist, const float place[3])
{
    double way[3], d[3], sum = 0;
    npg_vec3_between(way, m->sensor, place);
    *dist = npg_vec3_length(way);
    if (!(*dist > 0) || !isfinite(*dist)) return false;
    for (int a = 0; a < 3; a++) {
        d[a] = npg_vec3_dot(m->axes[a], way);
        sum += fabs(d[a]);
    }
    double uv[2] = {d[0] / sum, d[1] / sum};
    if (d[2] < 0) { /* the far half is folded over the square's corners */
        double u = uv[0], v = uv[1];
        uv[0] = (1 - fabs(v)) * (u < 0 ? -1 : 1);
        uv[1] = (1 - fabs(u)) * (v < 0 ? -1 : 1);
    }
    for (int i = 0; i < 2; i++) {
        at[i] = (int)floor((uv[i] + 1) / 2 * m->bins);
        at[i] = at[i] < 0 ? 0 : at[i] >= m->bins ? m->bins - 1 : at[i];
    }
    return true;
}

/* A bin near the square's border continues on the same side, mirrored at its middle. */
static size_t bin_at(const npg_depth_map *m, int x, int y)
{
    int last = m->bins - 1;
    if (x < 0 || x > last) {
        x = x < 0 ? -1 - x : 2 * last + 1 - x;
        y = last - y;
    }
    if (y < 0 || y > last) {
        y = y < 0 ? -1 - y : 2 * last + 1 - y;
        x = last - x;
    }
    return (size_t)y * (size_t)m->bins + (size_t)x;
}

/* ---- making ---- */

/* Mean direction and distance of the sensor's points. */
static void aim(npg_depth_map *m, double *mean_dist, const float *points, size_t n)
{
    double middle[3] = {0, 0, 0}, sum = 0;
    for (size_t i = 0; i < n; i++) {
        double way[3];
        npg_vec3_between(way, m->sensor, points + 3 * i);
        for (int a = 0; a < 3; a++) middle[a] += way[a];
        sum += npg_vec3_length(way);
    }
    memcpy(m->axes[2], middle, sizeof middle);
    if (!npg_vec3_make_unit(m->axes[2])) m->axes[2][2] = 1;
    npg_vec3_span_plane(m->axes[0], m->axes[1], m->axes[2]);
    *mean_dist = n ? sum / (double)n : 0;
}

static void add_points(npg_depth_map *m, const float *points, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        int at[2];
        double dist;
        if (!find_bin(m, at, &dist, points + 3 * i)) continue;
        float *near = &m->near[bin_at(m, at[0], at[1])];
        if ((float)dist < *near) *near = (float)dist;
    }
}

/* The outline is what lies within OUTLINE bins of a point; what can be reached from the bin that is
 * opposite to the axis without crossing it is outside.  Holes in the body are not. */
static npg_status find_outside(npg_depth_map *m)
{
    size_t count = (size_t)m->bins * (size_t)m->bins, ends = 0, done = 0;
    uint32_t *queue;
    NPG_TRY(npg_alloc_array(&queue, NPG_FOR_MESH, count, sizeof *queue));
    for (int y = 0; y < m->bins; y++)
        for (int x = 0; x < m->bins; x++)
            for (int i = 0; i < (2 * OUTLINE + 1) * (2 * OUTLINE + 1); i++)
                if (isfinite(m->near[bin_at(m, x + i % (2 * OUTLINE + 1) - OUTLINE,
                                            y + i / (2 * OUTLINE + 1) - OUTLINE)]))
                    m->outside[bin_at(m, x, y)] = 2;
    if (!m->outside[0]) queue[ends++] = 0;
    m->outside[0] |= 1;
    while (done < ends) {
        int x = (int)(queue[done] % (uint32_t)m->bins), y = (int)(queue[done] / (uint32_t)m->bins);
        done++;
        const size_t beside[4] = {bin_at(m, x - 1, y), bin_at(m, x + 1, y), bin_at(m, x, y - 1),
                                  bin_at(m, x, y + 1)};
        for (int i = 0; i < 4; i++) {
            if (m->outside[beside[i]]) continue;
            m->outside[beside[i]] = 1;
            queue[ends++] = (uint32_t)beside[i];
        }
    }
    for (size_t i = 0; i < count; i++) m->outside[i] = m->outside[i] == 1;
    npg_release(&queue);
    return NPG_OK;
}

npg_status npg_depth_map_open(npg_depth_map **out, const float sensor[3], const float *points, size_t n,
                              double side, double margin)
{
    double mean_dist;
    *out = NULL;
    NPG_REQUIRE(side > 0 && margin >= 0);
    NPG_TRY(npg_object_open(out, NPG_FOR_MESH, sizeof **out));
    npg_depth_map *m = *out;
    memcpy(m->sensor, sensor, sizeof m->sensor);
    m->margin = margin;
    aim(m, &mean_dist, points, n);
    m->bins = (int)fmin(BINS_MOST, fmax(BINS_LEAST, ceil(SPHERE_SIDE * mean_dist / side)));
    size_t count = (size_t)m->bins * (size_t)m->bins;
    m->near = npg_arena_take(&m->arena, count, sizeof *m->near);
    m->outside = npg_arena_take(&m->arena, count, sizeof *m->outside);
    npg_status status = npg_arena_status(&m->arena);
    for (size_t i = 0; i < count && !status; i++) m->near[i] = INFINITY;
    if (!status) add_points(m, points, n);
    if (!status && n) status = find_outside(m);
    if (status) npg_depth_map_close(out);
    return status;
}

void npg_depth_map_close(npg_depth_map **map)
{
    npg_object_close(map);
}

/* ---- looking ---- */

npg_sight_kind npg_depth_map_look(const npg_depth_map *m, const float place[3])
{
    int at[2];
    double dist, nearest = INFINITY, farthest = 0;
    if (!find_bin(m, at, &dist, place)) return NPG_SEEN_UNKNOWN;
    for (int i = 0; i < 9; i++) {
        double near = (double)m->near[bin_at(m, at[0] + i % 3 - 1, at[1] + i / 3 - 1)];
        if (!isfinite(near)) continue;
        nearest = fmin(nearest, near);
        farthest = fmax(farthest, near);
    }
    size_t own = bin_at(m, at[0], at[1]);
    if (!isfinite(nearest)) return m->outside[own] ? NPG_SEEN_BESIDE : NPG_SEEN_UNKNOWN;
    if (dist > farthest + m->margin) return NPG_SEEN_HIDDEN;
    if (dist >= nearest - m->margin) return NPG_SEEN_AT;
    return isfinite((double)m->near[own]) ? NPG_SEEN_EMPTY : NPG_SEEN_UNKNOWN;
}

size_t npg_depth_map_memory(void)
{
    return (size_t)BINS_MOST * BINS_MOST * (sizeof(float) + 1 + sizeof(uint32_t));
}
