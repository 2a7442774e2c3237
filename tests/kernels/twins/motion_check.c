/* transform, nearest, chamfer, isometry: the checker's cases. */
#include <math.h>
#include <string.h>

#include "kernels/mlp.h"
#include "kernels/motion.h"
#include "tests/kernels/twins/check.h"
#include "tests/kernels/twins/twins.h"

#define FRAMES 3

typedef struct motion_data {
    npg_check *check; /* its arena has the arrays */
    npg_motion motion;
    npg_buffer *out_buffer, *dout_buffer;
    size_t real, rows, edge_count, count[FRAMES];
    float *rest, *out, *points[FRAMES];
    double *rest_wide, *out_wide, *points_wide[FRAMES], *edge_rest;
    double *x, *g; /* of all frames: real x 3 each */
    uint32_t (*edges)[2];
    size_t *to_points, *to_verts; /* of one frame */
} motion_data;

static double distance_to(const double *a, const double *b)
{
    return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

/* Put points into Morton order, in both copies. */
static npg_status sort_points(motion_data *d, float *points, double *wide, size_t count)
{
    uint32_t *order = npg_arena_take(&d->check->arena, count, sizeof *order);
    NPG_TRY(npg_arena_status(&d->check->arena));
    NPG_TRY(npg_morton_order(order, points, count));
    for (size_t i = 0; i < 3 * count; i++) wide[i] = (double)points[3 * order[i / 3] + i % 3];
    for (size_t i = 0; i < 3 * count; i++) points[i] = (float)wide[i];
    return NPG_OK;
}

static npg_status make_points(motion_data *d, int size)
{
    for (size_t t = 0; t < FRAMES; t++) {
        /* one point, a full leaf, and many; some of them in one place */
        d->count[t] = t == 0 ? 1 : t == 1 ? 16 * (size_t)size : 61 * (size_t)(size * size) + 5;
        d->points[t] = npg_check_values(d->check, &d->points_wide[t], d->count[t] * 3, 0.7);
        NPG_TRY(npg_arena_status(&d->check->arena));
        for (size_t i = d->count[t] / 2; i < d->count[t] / 2 + 3 && i < d->count[t]; i++)
            memcpy(d->points[t] + 3 * i, d->points[t], 3 * sizeof(float));
        NPG_TRY(sort_points(d, d->points[t], d->points_wide[t], d->count[t]));
    }
    return NPG_OK;
}

static npg_status make_data(motion_data *d, int size)
{
    npg_arena *a = &d->check->arena;
    d->real = size == 1 ? 4 : (size_t)(size * size) * 53 + 1;
    d->rows = NPG_PADDED(d->real);
    d->edge_count = 2 * d->real - 3;
    d->rest = npg_check_values(d->check, &d->rest_wide, d->real * 3, 0.9);
    d->out = npg_check_values(d->check, &d->out_wide, FRAMES * d->rows * NPG_MLP_OUT, 2);
    d->edges = npg_arena_take(a, d->edge_count, sizeof *d->edges);
    d->edge_rest = npg_arena_take(a, d->edge_count, sizeof(double));
    d->x = npg_arena_take(a, FRAMES * d->real * 3, sizeof(double));
    d->g = npg_arena_take(a, FRAMES * d->real * 3, sizeof(double));
    d->to_points = npg_arena_take(a, d->real, sizeof(size_t));
    NPG_TRY(npg_arena_status(a));
    NPG_TRY(sort_points(d, d->rest, d->rest_wide, d->real));
    for (size_t i = 0; i < FRAMES * d->rows; i++) { /* padding repeats the last vertex, as in a fit */
        size_t v = i % d->rows < d->real ? i : i / d->rows * d->rows + d->real - 1;
        memcpy(d->out + i * NPG_MLP_OUT, d->out + v * NPG_MLP_OUT, NPG_MLP_OUT * sizeof(float));
        memcpy(d->out_wide + i * NPG_MLP_OUT, d->out_wide + v * NPG_MLP_OUT, NPG_MLP_OUT * sizeof(double));
    }
    NPG_TRY(make_points(d, size));
    d->to_verts = npg_arena_take(a, d->count[FRAMES - 1], sizeof(size_t));
    for (size_t e = 0; e < d->edge_count; e++) { /* a strip: every vertex with the next two */
        d->edges[e][0] = (uint32_t)(e / 2);
        d->edges[e][1] = (uint32_t)(e / 2 + 1 + e % 2);
        d->edge_rest[e] =
            (double)(float)distance_to(d->rest_wide + 3 * d->edges[e][0], d->rest_wide + 3 * d->edges[e][1]);
    }
    return npg_arena_status(a);
}

static npg_status open_motion(motion_data *d)
{
    npg_target targets[FRAMES];
    size_t size = FRAMES * d->rows * NPG_MLP_OUT;
    for (size_t t = 0; t < FRAMES; t++) targets[t] = (npg_target){d->points[t], d->count[t]};
    NPG_TRY(npg_motion_open(&d->motion, d->check->device, d->rest, d->real, d->rows,
                            (const uint32_t(*)[2])d->edges, d->edge_count, targets, FRAMES));
    NPG_TRY(npg_check_buffer(d->check, &d->out_buffer, d->out, size));
    NPG_TRY(npg_check_buffer(d->check, &d->dout_buffer, NULL, size));
    return npg_motion_apply(&d->motion, d->out_buffer, 0, FRAMES);
}

/* Positions of all frames from the device, real x 3 each; from the arena. */
static npg_status read_frames(float **points, const npg_buffer *buffer, const motion_data *d)
{
    npg_arena *a = &d->check->arena;
    float *packed = npg_arena_take(a, FRAMES * d->rows, 3 * sizeof *packed);
    *points = npg_arena_take(a, FRAMES * d->real, 3 * sizeof **points);
    NPG_TRY(npg_arena_status(a));
    NPG_TRY(npg_buffer_read(buffer, 0, packed, FRAMES * d->rows * 3 * sizeof *packed));
    for (size_t i = 0; i < FRAMES * d->real; i++)
        for (size_t axis = 0; axis < 3; axis++)
            (*points)[3 * i + axis] =
                packed[3 * (i / d->real) * d->rows + NPG_POINT_AT(i % d->real) + axis * NPG_LANES];
    return NPG_OK;
}

static npg_status compare_frames(const motion_data *d, const npg_buffer *buffer, const double *want)
{
    float *got;
    NPG_TRY(read_frames(&got, buffer, d));
    npg_check_compare(d->check, got, want, FRAMES * d->real * 3);
    return NPG_OK;
}

typedef npg_status compare_with(motion_data *d);

static npg_status check_motion(npg_check *check, int size, compare_with *compare)
{
    motion_data d = {.check = check};
    npg_status status = make_data(&d, size);
    if (!status) status = open_motion(&d);
    if (!status) status = compare(&d);
    npg_motion_close(&d.motion);
    return status;
}

/* ---- transform ---- */

/* The gradient that is passed back here is the positions themselves, brought in as the data term with gain 1.
 * rest: real x 3, of all frames, or of each where `stride` (of a frame) is not 0. */
static npg_status compare_transform_of(motion_data *d, const double *rest, size_t stride)
{
    const float gains[FRAMES] = {1, 1, 1};
    npg_motion *motion = &d->motion;
    size_t size = FRAMES * d->rows * NPG_MLP_OUT, bytes = FRAMES * d->rows * 3 * sizeof(float);
    float *x = npg_arena_take(&d->check->arena, 1, bytes);
    double *dout = npg_arena_take(&d->check->arena, size, sizeof *dout);
    NPG_TRY(npg_arena_status(&d->check->arena));
    for (size_t i = 0; i < FRAMES * d->real; i++) {
        size_t t = i / d->real, v = i % d->real, at = (t * d->rows + v) * NPG_MLP_OUT;
        npg_transform_ref(d->x + 3 * i, d->out_wide + at, rest + t * stride + 3 * v);
        npg_transform_back_ref(dout + at, d->x + 3 * i, d->out_wide + at, rest + t * stride + 3 * v);
    }
    NPG_TRY(compare_frames(d, &motion->x, d->x));
    NPG_TRY(npg_buffer_read(&motion->x, 0, x, bytes));
    NPG_TRY(npg_buffer_write(&motion->g, 0, x, bytes));
    NPG_TRY(npg_motion_back(motion, d->dout_buffer, d->out_buffer, gains, 0, 0, FRAMES));
    return npg_check_compare_buffer(d->check, d->dout_buffer, dout, size);
}

static npg_status compare_transform(motion_data *d)
{
    double *wide;
    NPG_TRY(compare_transform_of(d, d->rest_wide, 0));
    float *bases = npg_check_values(d->check, &wide, FRAMES * d->real * 3, 0.9);
    NPG_TRY(npg_arena_status(&d->check->arena));
    NPG_TRY(npg_motion_rebase(&d->motion, d->check->device, bases));
    NPG_TRY(npg_motion_apply(&d->motion, d->out_buffer, 0, FRAMES));
    return compare_transform_of(d, wide, 3 * d->real);
}

npg_status npg_check_transform(npg_check *check, int size)
{
    return check_motion(check, size, compare_transform);
}

/* ---- nearest and chamfer ---- */

/* Correspondences of one frame by the twin, from the positions that the device has. */
static void pair_up(motion_data *d, const double *x, size_t t)
{
    double dist_sq;
    for (size_t v = 0; v < d->real; v++)
        d->to_points[v] = npg_nearest_ref(&dist_sq, x + 3 * v, d->points_wide[t], d->count[t]);
    for (size_t p = 0; p < d->count[t]; p++)
        d->to_verts[p] = npg_nearest_ref(&dist_sq, d->points_wide[t] + 3 * p, x, d->real);
}

/* Indices may differ where distances are equal: what must agree is the distance.  `first`: where the frame's
 * answers begin. */
static npg_status compare_answers(motion_data *d, const npg_buffer *answers, size_t first, const double *from,
                                  size_t count, const double *to, const size_t *want)
{
    int32_t *index = npg_arena_take(&d->check->arena, count, sizeof *index);
    NPG_TRY(npg_arena_status(&d->check->arena));
    NPG_TRY(npg_buffer_read(answers, first * sizeof *index, index, count * sizeof *index));
    for (size_t i = 0; i < count; i++)
        d->check->error = fmax(d->check->error, fabs(distance_to(from + 3 * i, to + 3 * index[i]) -
                                                     distance_to(from + 3 * i, to + 3 * want[i])));
    return NPG_OK;
}

static npg_status compare_pairs(motion_data *d)
{
    size_t first = 0;
    for (size_t t = 0; t < FRAMES; first += d->count[t++]) {
        const double *x = d->x + t * d->real * 3, *points = d->points_wide[t];
        pair_up(d, x, t);
        NPG_TRY(compare_answers(d, &d->motion.to_points, t * d->rows, x, d->real, points, d->to_points));
        NPG_TRY(compare_answers(d, &d->motion.to_verts, first, points, d->count[t], x, d->to_verts));
    }
    return NPG_OK;
}

/* From positions as the device has them, so that both sides pair the same points. */
static npg_status run_chamfer(motion_data *d)
{
    float *x;
    NPG_TRY(read_frames(&x, &d->motion.x, d));
    for (size_t i = 0; i < FRAMES * d->real * 3; i++) d->x[i] = (double)x[i];
    return npg_motion_chamfer(&d->motion, 0.3, 0, FRAMES);
}

static npg_status compare_nearest(motion_data *d)
{
    NPG_TRY(run_chamfer(d));
    NPG_TRY(compare_pairs(d));
    /* again, now from the answers as candidates */
    NPG_TRY(npg_motion_chamfer(&d->motion, 0.3, 0, FRAMES));
    return compare_pairs(d);
}

static npg_status compare_chamfer(motion_data *d)
{
    double want[FRAMES];
    NPG_TRY(run_chamfer(d));
    for (size_t t = 0; t < FRAMES; t++) {
        pair_up(d, d->x + t * d->real * 3, t);
        want[t] = npg_chamfer_pairs_ref(d->g + t * d->real * 3, d->x + t * d->real * 3, d->real,
                                        d->points_wide[t], d->count[t], d->to_points, d->to_verts, 0.3);
    }
    NPG_TRY(npg_check_compare_buffer(d->check, &d->motion.cd, want, FRAMES));
    return compare_frames(d, &d->motion.g, d->g);
}

npg_status npg_check_nearest(npg_check *check, int size)
{
    return check_motion(check, size, compare_nearest);
}

npg_status npg_check_chamfer(npg_check *check, int size)
{
    return check_motion(check, size, compare_chamfer);
}

/* ---- isometry ---- */

static npg_status compare_isometry(motion_data *d)
{
    const float gains[FRAMES] = {0.5f, 2, 0};
    double want[FRAMES] = {0};
    size_t blocks = d->rows / NPG_LANES;
    float sums[FRAMES] = {0}, *part = npg_arena_take(&d->check->arena, FRAMES * blocks, sizeof *part);
    NPG_TRY(npg_arena_status(&d->check->arena));
    NPG_TRY(compare_chamfer(d));
    for (size_t t = 0; t < FRAMES; t++) {
        double *g = d->g + t * d->real * 3;
        for (size_t i = 0; i < d->real * 3; i++) g[i] *= (double)gains[t] / 7;
        want[t] = npg_isometry_ref(g, d->x + t * d->real * 3, (const uint32_t(*)[2])d->edges, d->edge_rest,
                                   d->edge_count);
        for (size_t i = 0; i < d->real * 3; i++) g[i] *= 7;
    }
    NPG_TRY(npg_motion_back(&d->motion, d->dout_buffer, d->out_buffer, gains, 7, 0, FRAMES));
    NPG_TRY(compare_frames(d, &d->motion.g, d->g));
    NPG_TRY(npg_buffer_read(&d->motion.part, 0, part, FRAMES * blocks * sizeof *part));
    for (size_t i = 0; i < FRAMES * blocks; i++) sums[i / blocks] += 0.5f * part[i];
    npg_check_compare(d->check, sums, want, FRAMES);
    return NPG_OK;
}

npg_status npg_check_isometry(npg_check *check, int size)
{
    return check_motion(check, size, compare_isometry);
}
