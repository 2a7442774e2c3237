/* transform, nearest, chamfer, isometry: the checker's cases. */
#include <math.h>
#include <string.h>

#include "kernels/check.h"
#include "kernels/mlp.h"
#include "kernels/motion.h"

#define FRAMES 3

typedef struct motion_data {
    size_t real, rows, edge_count, count[FRAMES];
    float *rest, *out, *points[FRAMES];
    double *rest_wide, *out_wide, *points_wide[FRAMES], *edge_rest;
    double *x, *g, *dout; /* of all frames: real x 3, real x 3, rows x 8 */
    uint32_t (*edges)[2];
    size_t *to_points, *to_verts; /* of one frame */
    npg_arena arrays;             /* holds all of these */
} motion_data;

/* Put points into Morton order, in both copies. */
static npg_status sort_points(float *points, double *wide, size_t count)
{
    uint32_t *order;
    NPG_TRY(npg_alloc_array(&order, NPG_FOR_RUN, count, sizeof *order));
    npg_status status = npg_morton_order(order, points, count);
    for (size_t i = 0; !status && i < 3 * count; i++) wide[i] = (double)points[3 * order[i / 3] + i % 3];
    for (size_t i = 0; !status && i < 3 * count; i++) points[i] = (float)wide[i];
    npg_release(&order);
    return status;
}

static npg_status make_points(motion_data *d, int size, npg_random *random)
{
    size_t most = 0;
    for (size_t t = 0; t < FRAMES; t++) {
        /* one point, a full leaf, and many; some of them in one place */
        d->count[t] = t == 0 ? 1 : t == 1 ? 16 * (size_t)size : 61 * (size_t)(size * size) + 5;
        npg_check_values(&d->arrays, &d->points[t], &d->points_wide[t], d->count[t] * 3, 0.7, random);
        NPG_TRY(npg_arena_status(&d->arrays));
        for (size_t i = d->count[t] / 2; i < d->count[t] / 2 + 3 && i < d->count[t]; i++)
            memcpy(d->points[t] + 3 * i, d->points[t], 3 * sizeof(float));
        NPG_TRY(sort_points(d->points[t], d->points_wide[t], d->count[t]));
        if (d->count[t] > most) most = d->count[t];
    }
    d->to_verts = npg_arena_take(&d->arrays, most, sizeof(size_t));
    d->to_points = npg_arena_take(&d->arrays, d->real, sizeof(size_t));
    return npg_arena_status(&d->arrays);
}

static npg_status open_motion_data(motion_data *d, int size, uint64_t seed)
{
    npg_random random = npg_random_stream(seed, 14, (uint64_t)size);
    d->real = size == 1 ? 4 : (size_t)(size * size) * 53 + 1;
    d->rows = NPG_PADDED(d->real);
    d->edge_count = 2 * d->real - 3;
    d->arrays.purpose = NPG_FOR_RUN;
    npg_check_values(&d->arrays, &d->rest, &d->rest_wide, d->real * 3, 0.9, &random);
    npg_check_values(&d->arrays, &d->out, &d->out_wide, FRAMES * d->rows * NPG_MLP_OUT, 2, &random);
    d->edges = npg_arena_take(&d->arrays, d->edge_count, sizeof *d->edges);
    d->edge_rest = npg_arena_take(&d->arrays, d->edge_count, sizeof(double));
    d->x = npg_arena_take(&d->arrays, FRAMES * d->real * 3, sizeof(double));
    d->g = npg_arena_take(&d->arrays, FRAMES * d->real * 3, sizeof(double));
    d->dout = npg_arena_take(&d->arrays, FRAMES * d->rows * NPG_MLP_OUT, sizeof(double));
    NPG_TRY(npg_arena_status(&d->arrays));
    NPG_TRY(sort_points(d->rest, d->rest_wide, d->real));
    for (size_t i = 0; i < FRAMES * d->rows; i++) { /* padding repeats the last vertex, as in a fit */
        size_t v = i % d->rows < d->real ? i : i / d->rows * d->rows + d->real - 1;
        memcpy(d->out + i * NPG_MLP_OUT, d->out + v * NPG_MLP_OUT, NPG_MLP_OUT * sizeof(float));
        memcpy(d->out_wide + i * NPG_MLP_OUT, d->out_wide + v * NPG_MLP_OUT, NPG_MLP_OUT * sizeof(double));
    }
    NPG_TRY(make_points(d, size, &random));
    for (size_t e = 0; e < d->edge_count; e++) { /* a strip: every vertex with the next two */
        d->edges[e][0] = (uint32_t)(e / 2);
        d->edges[e][1] = (uint32_t)(e / 2 + 1 + e % 2);
        const double *a = d->rest_wide + 3 * d->edges[e][0], *b = d->rest_wide + 3 * d->edges[e][1];
        d->edge_rest[e] =
            (double)(float)sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
    }
    return NPG_OK;
}

static npg_status open_motion(npg_motion *motion, npg_buffer *out, npg_device *device, const motion_data *d)
{
    npg_target targets[FRAMES];
    for (size_t t = 0; t < FRAMES; t++) targets[t] = (npg_target){d->points[t], d->count[t]};
    NPG_TRY(npg_motion_open(motion, device, d->rest, d->real, d->rows, (const uint32_t(*)[2])d->edges,
                            d->edge_count, targets, FRAMES));
    NPG_TRY(npg_buffer_from(out, device, d->out, FRAMES * d->rows * NPG_MLP_OUT * sizeof(float)));
    return npg_motion_apply(motion, out, 0, FRAMES);
}

/* Positions of all frames from the device, real x 3 each, into a float list. */
static npg_status read_frames(float *points, const npg_buffer *buffer, const motion_data *d)
{
    float *packed;
    NPG_TRY(npg_alloc_array(&packed, NPG_FOR_RUN, d->rows, 3 * sizeof(float)));
    npg_status status = NPG_OK;
    for (size_t t = 0; t < FRAMES && !status; t++) {
        size_t bytes = d->rows * 3 * sizeof(float);
        status = npg_buffer_read(buffer, t * bytes, packed, bytes);
        npg_unpack16(points + t * d->real * 3, packed, d->real);
    }
    npg_release(&packed);
    return status;
}

static npg_status compare_frames(double *error, const npg_buffer *buffer, const double *want,
                                 const motion_data *d)
{
    float *got;
    NPG_TRY(npg_alloc_array(&got, NPG_FOR_RUN, FRAMES * d->real, 3 * sizeof(float)));
    npg_status status = read_frames(got, buffer, d);
    if (!status) npg_check_compare(error, got, want, FRAMES * d->real * 3);
    npg_release(&got);
    return status;
}

/* ---- transform ---- */

static void transform_twins(motion_data *d)
{
    for (size_t t = 0; t < FRAMES; t++)
        for (size_t v = 0; v < d->real; v++) {
            const double *out = d->out_wide + (t * d->rows + v) * NPG_MLP_OUT;
            npg_transform_ref(d->x + (t * d->real + v) * 3, out, d->rest_wide + 3 * v);
        }
}

static void transform_back_twins(motion_data *d)
{
    for (size_t t = 0; t < FRAMES; t++)
        for (size_t v = 0; v < d->real; v++) {
            size_t at = (t * d->rows + v) * NPG_MLP_OUT;
            npg_transform_back_ref(d->dout + at, d->g + (t * d->real + v) * 3, d->out_wide + at,
                                   d->rest_wide + 3 * v);
        }
}

/* The gradient that is passed back here is the positions themselves, brought in as the
 * data term with gain 1. */
static npg_status compare_transform(npg_device *device, motion_data *d, npg_motion *motion, npg_buffer *out,
                                    npg_buffer *dout, double *error)
{
    const float gains[FRAMES] = {1, 1, 1};
    float *x;
    NPG_TRY(open_motion(motion, out, device, d));
    transform_twins(d);
    NPG_TRY(compare_frames(error, &motion->x, d->x, d));
    NPG_TRY(npg_alloc_array(&x, NPG_FOR_RUN, FRAMES * d->rows, 3 * sizeof(float)));
    npg_status status = npg_buffer_read(&motion->x, 0, x, FRAMES * d->rows * 3 * sizeof(float));
    if (!status) status = npg_buffer_write(&motion->g, 0, x, FRAMES * d->rows * 3 * sizeof(float));
    npg_release(&x);
    NPG_TRY(status);
    memcpy(d->g, d->x, FRAMES * d->real * 3 * sizeof *d->g);
    transform_back_twins(d);
    NPG_TRY(npg_buffer_open(dout, device, FRAMES * d->rows * NPG_MLP_OUT * sizeof(float)));
    NPG_TRY(npg_motion_back(motion, dout, out, gains, 0, 0, FRAMES));
    return npg_check_buffer(error, dout, d->dout, FRAMES * d->rows * NPG_MLP_OUT);
}

npg_status npg_check_transform(npg_device *device, int size, uint64_t seed, double *error)
{
    motion_data d = {0};
    npg_motion motion = {0};
    npg_buffer out = {0}, dout = {0};
    *error = 0;
    npg_status status = open_motion_data(&d, size, seed);
    if (!status) status = compare_transform(device, &d, &motion, &out, &dout, error);
    npg_motion_close(&motion);
    npg_buffer_close(&out);
    npg_buffer_close(&dout);
    npg_arena_release(&d.arrays);
    return status;
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

static double distance_to(const double *a, const double *b)
{
    return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

/* Indices may differ where distances are equal: what must agree is the distance. */
static npg_status compare_pairs(npg_motion *motion, motion_data *d, double *error)
{
    int32_t *index;
    size_t first = 0, most = d->real;
    for (size_t t = 0; t < FRAMES; t++) most = d->count[t] > most ? d->count[t] : most;
    NPG_TRY(npg_alloc_array(&index, NPG_FOR_RUN, most, sizeof *index));
    npg_status status = NPG_OK;
    for (size_t t = 0; t < FRAMES && !status; t++) {
        const double *x = d->x + t * d->real * 3;
        pair_up(d, x, t);
        status = npg_buffer_read(&motion->to_points, t * d->rows * 4, index, d->real * 4);
        for (size_t v = 0; v < d->real && !status; v++)
            *error = fmax(*error, fabs(distance_to(x + 3 * v, d->points_wide[t] + 3 * index[v]) -
                                       distance_to(x + 3 * v, d->points_wide[t] + 3 * d->to_points[v])));
        if (!status) status = npg_buffer_read(&motion->to_verts, first * 4, index, d->count[t] * 4);
        for (size_t p = 0; p < d->count[t] && !status; p++)
            *error = fmax(*error, fabs(distance_to(d->points_wide[t] + 3 * p, x + 3 * index[p]) -
                                       distance_to(d->points_wide[t] + 3 * p, x + 3 * d->to_verts[p])));
        first += d->count[t];
    }
    npg_release(&index);
    return status;
}

/* Positions as the device has them, so that both sides pair the same points. */
static npg_status take_positions(npg_motion *motion, motion_data *d)
{
    float *x;
    NPG_TRY(npg_alloc_array(&x, NPG_FOR_RUN, FRAMES * d->real, 3 * sizeof(float)));
    npg_status status = read_frames(x, &motion->x, d);
    for (size_t i = 0; i < FRAMES * d->real * 3; i++) d->x[i] = (double)x[i];
    npg_release(&x);
    return status;
}

static npg_status run_chamfer(npg_device *device, motion_data *d, npg_motion *motion, npg_buffer *out,
                              double alpha)
{
    NPG_TRY(open_motion(motion, out, device, d));
    NPG_TRY(take_positions(motion, d));
    return npg_motion_chamfer(motion, alpha, 0, FRAMES);
}

static npg_status compare_nearest(npg_device *device, motion_data *d, npg_motion *motion, npg_buffer *out,
                                  double *error)
{
    NPG_TRY(run_chamfer(device, d, motion, out, 0.3));
    NPG_TRY(compare_pairs(motion, d, error));
    /* again, now from the answers as candidates */
    NPG_TRY(npg_motion_chamfer(motion, 0.3, 0, FRAMES));
    return compare_pairs(motion, d, error);
}

static npg_status compare_chamfer(npg_device *device, motion_data *d, npg_motion *motion, npg_buffer *out,
                                  double *error)
{
    NPG_TRY(run_chamfer(device, d, motion, out, 0.3));
    double want[FRAMES];
    for (size_t t = 0; t < FRAMES; t++) {
        pair_up(d, d->x + t * d->real * 3, t);
        want[t] = npg_chamfer_pairs_ref(d->g + t * d->real * 3, d->x + t * d->real * 3, d->real,
                                        d->points_wide[t], d->count[t], d->to_points, d->to_verts, 0.3);
    }
    NPG_TRY(npg_check_buffer(error, &motion->cd, want, FRAMES));
    return compare_frames(error, &motion->g, d->g, d);
}

typedef npg_status compare_with(npg_device *device, motion_data *d, npg_motion *motion, npg_buffer *out,
                                double *error);

static npg_status check_motion(npg_device *device, int size, uint64_t seed, compare_with *compare,
                               double *error)
{
    motion_data d = {0};
    npg_motion motion = {0};
    npg_buffer out = {0};
    *error = 0;
    npg_status status = open_motion_data(&d, size, seed);
    if (!status) status = compare(device, &d, &motion, &out, error);
    npg_motion_close(&motion);
    npg_buffer_close(&out);
    npg_arena_release(&d.arrays);
    return status;
}

npg_status npg_check_nearest(npg_device *device, int size, uint64_t seed, double *error)
{
    return check_motion(device, size, seed, compare_nearest, error);
}
npg_status npg_check_chamfer(npg_device *device, int size, uint64_t seed, double *error)
{
    return check_motion(device, size, seed, compare_chamfer, error);
}

/* ---- isometry ---- */

static npg_status compare_isometry(npg_device *device, motion_data *d, npg_motion *motion, npg_buffer *out,
                                   double *error)
{
    const float gains[FRAMES] = {0.5f, 2, 0};
    npg_buffer dout = {0};
    double want[FRAMES] = {0};
    float *part;
    size_t blocks = d->rows / NPG_LANES;
    NPG_TRY(compare_chamfer(device, d, motion, out, error));
    for (size_t t = 0; t < FRAMES; t++) {
        double *g = d->g + t * d->real * 3;
        for (size_t i = 0; i < d->real * 3; i++) g[i] *= (double)gains[t] / 7;
        want[t] = npg_isometry_ref(g, d->x + t * d->real * 3, (const uint32_t(*)[2])d->edges, d->edge_rest,
                                   d->edge_count);
        for (size_t i = 0; i < d->real * 3; i++) g[i] *= 7;
    }
    NPG_TRY(npg_buffer_open(&dout, device, FRAMES * d->rows * NPG_MLP_OUT * sizeof(float)));
    npg_status status = npg_motion_back(motion, &dout, out, gains, 7, 0, FRAMES);
    npg_buffer_close(&dout);
    NPG_TRY(status);
    NPG_TRY(compare_frames(error, &motion->g, d->g, d));
    NPG_TRY(npg_alloc_array(&part, NPG_FOR_RUN, FRAMES * blocks, sizeof *part));
    status = npg_buffer_read(&motion->part, 0, part, FRAMES * blocks * sizeof *part);
    float sums[FRAMES] = {0};
    for (size_t i = 0; i < FRAMES * blocks; i++) sums[i / blocks] += 0.5f * part[i];
    if (!status) npg_check_compare(error, sums, want, FRAMES);
    npg_release(&part);
    return status;
}

npg_status npg_check_isometry(npg_device *device, int size, uint64_t seed, double *error)
{
    return check_motion(device, size, seed, compare_isometry, error);
}
