/* Normals: principal components, and the view from a sensor. */
#include "outlier/normals.h"

#include <math.h>
#include <string.h>

#include "geometry/kdtree.h"
#include "geometry/mesh_tools.h"
#include "geometry/vec3.h"
#include "kernels/jacobi.h"
#include "pipeline/frame_box.h"
#include "pipeline/memory.h"

#define JACOBI_ROUNDS 12 /* sweeps, more than a 3 x 3 matrix needs */

/* ---- smallest eigenvector of a symmetric 3 x 3 matrix ---- */

static void smallest_axis(float axis[3], double m[3][3])
{
    double v[3][3];
    npg_jacobi(m[0], v[0], 3, JACOBI_ROUNDS);
    int least = m[0][0] <= m[1][1] ? 0 : 1;
    if (m[2][2] < m[least][least]) least = 2;
    double length = sqrt(v[0][least] * v[0][least] + v[1][least] * v[1][least] + v[2][least] * v[2][least]);
    for (int a = 0; a < 3; a++) axis[a] = (float)(v[a][least] / length);
}

/* ---- estimate ---- */

void npg_normal_of(float normal[3], const float *points, size_t count)
{
    double mean[3] = {0}, m[3][3] = {{0}};
    for (size_t i = 0; i < 3 * count; i++) mean[i % 3] += (double)points[i] / (double)count;
    for (size_t i = 0; i < count; i++) {
        double d[3];
        for (size_t a = 0; a < 3; a++) d[a] = (double)points[3 * i + a] - mean[a];
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) m[a][b] += d[a] * d[b];
    }
    smallest_axis(normal, m);
}

typedef struct estimate {
    float *const *normals; /* one list per number of neighbours */
    const int *neighbours;
    size_t count;
    const float *points;
} estimate;

/* An npg_kdtree_visit: lists are nearest first, so that fewer neighbours are the beginning of more. */
static void estimate_point(void *user, uint32_t point, const uint32_t *index, const float *dist_sq)
{
    const estimate *e = user;
    float around[3 * NPG_KDTREE_NEIGHBOURS];
    (void)dist_sq;
    for (size_t i = 0, found = 0; i < e->count; i++) {
        for (; found < (size_t)e->neighbours[i] && index[found] != UINT32_MAX; found++)
            memcpy(around + 3 * found, e->points + 3 * (size_t)index[found], 3 * sizeof *around);
        npg_normal_of(e->normals[i] + 3 * (size_t)point, around, found);
    }
}

npg_status npg_normals_estimate_several(float *const *normals, const float *points, size_t n,
                                        const int *neighbours, size_t count)
{
    npg_kdtree *tree = NULL;
    estimate e = {.normals = normals, .neighbours = neighbours, .count = count, .points = points};
    NPG_REQUIRE(count && neighbours[0] >= 3 && neighbours[count - 1] <= NPG_KDTREE_NEIGHBOURS);
    NPG_TRY(npg_kdtree_open(&tree, points, n));
    npg_status status = npg_kdtree_each(tree, (size_t)neighbours[count - 1], NULL, estimate_point, &e, 0);
    npg_kdtree_close(&tree);
    return status;
}

npg_status npg_normals_estimate_at(float *const *normals, const uint32_t *at, size_t at_count,
                                   const float *points, size_t n, const int *neighbours, size_t count)
{
    npg_kdtree *tree = NULL;
    uint32_t *index = NULL;
    float *dist_sq = NULL, *queries = NULL;
    size_t most = (size_t)neighbours[count - 1];
    estimate e = {.normals = normals, .neighbours = neighbours, .count = count, .points = points};
    npg_status status = npg_kdtree_open(&tree, points, n);
    if (!status) status = npg_alloc_array(&queries, NPG_FOR_FRAMES, at_count, 3 * sizeof *queries);
    if (!status) status = npg_alloc_array(&index, NPG_FOR_FRAMES, at_count, most * sizeof *index);
    if (!status) status = npg_alloc_array(&dist_sq, NPG_FOR_FRAMES, at_count, most * sizeof *dist_sq);
    if (!status) npg_rows_gather(queries, points, at, at_count);
    if (!status) status = npg_kdtree_nearest(tree, index, dist_sq, queries, at_count, most, 0);
    for (size_t i = 0; i < at_count && !status; i++)
        estimate_point(&e, (uint32_t)i, index + most * i, dist_sq + most * i);
    npg_kdtree_close(&tree);
    npg_release(&queries);
    npg_release(&index);
    npg_release(&dist_sq);
    return status;
}

npg_status npg_normals_estimate(float *normals, const float *points, size_t n, int neighbours)
{
    return npg_normals_estimate_several(&normals, points, n, &neighbours, 1);
}

/* ---- sensor ---- */

void npg_normals_face_sensor(float *normals, size_t *flipped, const float *points, size_t n,
                             const double sensor[3])
{
    *flipped = 0;
    for (size_t i = 0; i < n; i++) {
        double toward = 0;
        for (size_t a = 0; a < 3; a++)
            toward += (double)normals[3 * i + a] * (sensor[a] - (double)points[3 * i + a]);
        if (toward >= 0) continue;
        for (size_t a = 0; a < 3; a++) normals[3 * i + a] = -normals[3 * i + a];
        ++*flipped;
    }
}

/* All set by trial. */
#define VIEW_CELLS_MAX 512 /* per side of the picture                                                */
#define HIDDEN_CELLS   2.5 /* a point this many cell widths behind the nearest of its cell is hidden */
#define HIDDEN_MAX     0.1 /* share of hidden points in one view; a closed body has near one half    */

typedef struct view { /* a pinhole picture toward the middle of the cloud */
    double right[3], up[3], forward[3], sensor[3];
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
    double distance = npg_vec3_length(v->forward);
    if (!(distance > 1.15 * radius)) return false;
    int least = fabs(v->forward[0]) < fabs(v->forward[1]) ? 0 : 1;
    if (fabs(v->forward[2]) < fabs(v->forward[least])) least = 2;
    double axis[3] = {least == 0, least == 1, least == 2};
    npg_vec3_make_unit(v->forward);
    npg_vec3_cross(v->right, axis, v->forward);
    npg_vec3_make_unit(v->right);
    npg_vec3_cross(v->up, v->forward, v->right);
    v->half_width = radius / sqrt(distance * distance - radius * radius);
    v->cells = (size_t)sqrt((double)point_count / 4); /* four points a cell, if they filled the picture */
    if (v->cells > VIEW_CELLS_MAX) v->cells = VIEW_CELLS_MAX;
    v->cell_width = 2 * v->half_width * distance / (double)v->cells;
    return v->cells >= 4;
}

/* The cell a point falls into, and its depth. */
static size_t project(double *depth, const view *v, const float *p)
{
    double d[3], at[2];
    for (int a = 0; a < 3; a++) d[a] = (double)p[a] - v->sensor[a];
    *depth = npg_vec3_dot(d, v->forward);
    at[0] = npg_vec3_dot(d, v->right) / *depth;
    at[1] = npg_vec3_dot(d, v->up) / *depth;
    size_t cell = 0;
    for (int i = 0; i < 2; i++) {
        double x = (at[i] / v->half_width + 1) / 2 * (double)v->cells;
        size_t c = x < 0 ? 0 : x >= (double)v->cells ? v->cells - 1 : (size_t)x;
        cell = cell * v->cells + c;
    }
    return cell;
}

npg_status npg_cloud_is_single_view(bool *yes, const float *points, size_t n, const double sensor[3])
{
    view v;
    float *nearest;
    size_t hidden = 0;
    npg_bounds bounds = npg_bounds_empty();
    npg_bounds_add_points(&bounds, points, n);
    *yes = false;
    if (!aim_view(&v, &bounds, sensor, n)) return NPG_OK;
    double depth, hidden_depth = HIDDEN_CELLS * v.cell_width;
    NPG_TRY(npg_alloc_array(&nearest, NPG_FOR_FRAMES, v.cells * v.cells, sizeof *nearest));
    for (size_t i = 0; i < v.cells * v.cells; i++) nearest[i] = INFINITY;
    for (size_t i = 0; i < n; i++) {
        size_t cell = project(&depth, &v, points + 3 * i);
        nearest[cell] = fminf(nearest[cell], (float)depth);
    }
    for (size_t i = 0; i < n; i++) {
        size_t cell = project(&depth, &v, points + 3 * i);
        hidden += depth > (double)nearest[cell] + hidden_depth;
    }
    npg_release(&nearest);
    *yes = (double)hidden < HIDDEN_MAX * (double)n;
    return NPG_OK;
}
