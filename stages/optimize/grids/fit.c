/* Fit: grids, decoder and motion put together; one epoch is a walk over all frames,
 * in batches from the key outward. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "kernels/adam.h"
#include "kernels/latent.h"
#include "kernels/mlp.h"
#include "kernels/sobolev.h"
#include "optimize/grids/fit.h"
#include "pipeline/random.h"

#define BATCH 4 /* frames whose second hidden layer is kept at a time */

struct npg_fit {
    npg_fit_settings settings;
    npg_device *device;   /* loan */
    size_t real, rows;    /* V, V padded to blocks */
    npg_arena arrays;     /* holds order, row_of, rest, params */
    uint32_t *order;      /* order[i]: vertex of the reference at row i; Morton order */
    uint32_t *row_of;     /* its inverse */
    float *rest;          /* V x 3 in that order */
    uint32_t (*edges)[2]; /* between rows, owned */
    size_t edge_count;
    npg_levels levels;
    npg_latent latent;
    npg_sobolev sobolev;
    npg_buffer u, nodes, dnodes; /* differential coordinates, features, gradient: [nodes][32] */
    npg_adam grid_adam, mlp_adam;
    float *params; /* decoder's parameters between windows */
    uint64_t seed;
    npg_arena window; /* holds the arrays of the window */
    npg_mlp mlp;
    npg_motion motion;
    size_t frame_count;
    npg_fit_measure *measure;           /* or NULL: by distances */
    void *user;                         /* its user */
    size_t tied_count;                  /* frames, the first outward, that follow their tie */
    float *ties;                        /* of these, x V x 3 in the order of rows */
    size_t *place;                      /* place[k]: which frame of the caller comes k-th outward */
    size_t *rank;                       /* its inverse */
    int64_t *index;                     /* by k */
    double *times;                      /* by k */
    float *cd, *gains, *codes, *packed; /* by k; packed: one frame's positions, of measured ones all */
    float *now, *gradient;              /* of measured frames: T x V x 3 in the caller's order */
    bool *has_points;                   /* by k */
};

/* ---- opening: what does not depend on the window ---- */

static npg_status sort_vertices(npg_fit *fit, const npg_mesh *mesh, float **normals)
{
    fit->order = npg_arena_take(&fit->arrays, fit->real, sizeof *fit->order);
    fit->row_of = npg_arena_take(&fit->arrays, fit->real, sizeof *fit->row_of);
    fit->rest = npg_arena_take(&fit->arrays, fit->real, 3 * sizeof *fit->rest);
    NPG_TRY(npg_arena_status(&fit->arrays));
    NPG_TRY(npg_alloc_array(normals, NPG_FOR_FIT, fit->real, 3 * sizeof(float)));
    NPG_TRY(npg_morton_order(fit->order, mesh->vert_pos, fit->real));
    for (size_t i = 0; i < 3 * fit->real; i++) {
        fit->rest[i] = mesh->vert_pos[3 * fit->order[i / 3] + i % 3];
        (*normals)[i] = mesh->vert_normals[3 * fit->order[i / 3] + i % 3];
    }
    NPG_TRY(npg_mesh_edges(&fit->edges, &fit->edge_count, mesh->faces, mesh->face_count));
    for (size_t i = 0; i < fit->real; i++) fit->row_of[fit->order[i]] = (uint32_t)i;
    for (size_t e = 0; e < 2 * fit->edge_count; e++)
        fit->edges[e / 2][e % 2] = fit->row_of[fit->edges[e / 2][e % 2]];
    return NPG_OK;
}

static npg_status open_grid_adam(npg_fit *fit)
{
    float *rates;
    size_t rows = fit->levels.row_count;
    NPG_TRY(npg_alloc_array(&rates, NPG_FOR_FIT, rows, sizeof(float)));
    for (int l = 0; l < fit->levels.count; l++)
        for (size_t i = 0; i < fit->levels.level[l].row_count; i++)
            rates[fit->levels.level[l].first_row + i] = (float)fit->levels.level[l].rate;
    npg_status status =
        npg_adam_open(&fit->grid_adam, fit->device, rates, NPG_LATENT_CHANNELS, rows * NPG_LATENT_CHANNELS);
    npg_release(&rates);
    return status;
}

/* Features that differ from place to place from the start; with a head of zero the motion
 * still begins at rest. */
static npg_status draw_features(npg_fit *fit)
{
    float *values;
    size_t count = fit->levels.row_count * NPG_LATENT_CHANNELS;
    npg_random random = npg_random_stream(fit->seed, 2, 0);
    if (fit->settings.feature_start <= 0) return NPG_OK;
    NPG_TRY(npg_alloc_array(&values, NPG_FOR_FIT, count, sizeof *values));
    for (int l = 0; l < fit->levels.count; l++) {
        const npg_level *level = &fit->levels.level[l];
        for (size_t row = level->first_row; row < level->first_row + level->row_count; row++)
            for (int c = level->channel_first; c < level->channel_end; c++)
                values[row * NPG_LATENT_CHANNELS + (size_t)c] =
                    (float)(fit->settings.feature_start * (2 * npg_random_real(&random) - 1));
    }
    npg_status status = npg_buffer_write(&fit->u, 0, values, count * sizeof *values);
    npg_release(&values);
    return status;
}

static npg_status open_grids(npg_fit *fit, const float *normals)
{
    npg_samples samples;
    size_t bytes = fit->levels.row_count * NPG_LATENT_CHANNELS * sizeof(float);
    NPG_TRY(npg_samples_open(&samples, &fit->levels, fit->rest, normals, fit->real, fit->rows));
    npg_status status = npg_latent_open(&fit->latent, fit->device, &samples);
    npg_samples_close(&samples);
    if (status) return status;
    NPG_TRY(npg_sobolev_open(&fit->sobolev, fit->device, &fit->levels));
    NPG_TRY(npg_buffer_open(&fit->u, fit->device, bytes));
    NPG_TRY(npg_buffer_open(&fit->nodes, fit->device, bytes));
    NPG_TRY(npg_buffer_open(&fit->dnodes, fit->device, bytes));
    NPG_TRY(draw_features(fit));
    return open_grid_adam(fit);
}

static npg_mlp_shape shape_of(const npg_grid_settings *s)
{
    return (npg_mlp_shape){(size_t)s->width_1, (size_t)s->width_2, 2 * (size_t)s->frequencies};
}

/* values[at] .. values[end - 1], uniform in +-1 / sqrt(inputs). */
static void draw_uniform(float *values, size_t at, size_t end, size_t inputs, npg_random *random)
{
    double bound = 1 / sqrt((double)inputs);
    for (size_t i = at; i < end; i++) values[i] = (float)(bound * (2 * npg_random_real(random) - 1));
}

/* Zero: random numbers are taken for it as for all others. */
static void draw_zero(float *values, size_t at, size_t end, npg_random *random)
{
    draw_uniform(values, at, end, 1, random);
    memset(values + at, 0, (end - at) * sizeof *values);
}

/* Weights and biases in the order of their list; the head is zero, so that all begins as the identity. */
static void draw_layers(float *to, const npg_mlp_shape *s, size_t inputs, npg_random *random)
{
    draw_uniform(to, 0, npg_mlp_places_of(s).head, s->w1, random);
    draw_zero(to, npg_mlp_places_of(s).head, npg_mlp_places_of(s).b2, random);
    draw_uniform(to, npg_mlp_places_of(s).b2, npg_mlp_places_of(s).head_bias, s->w1, random);
    draw_zero(to, npg_mlp_places_of(s).head_bias, npg_mlp_places_of(s).w1z, random);
    draw_uniform(to, npg_mlp_places_of(s).w1z, npg_mlp_places_of(s).end, inputs, random);
}

static npg_status draw_params(npg_fit *fit)
{
    const npg_grid_settings *settings = &fit->settings.grid;
    npg_mlp_shape s = shape_of(settings);
    npg_random random = npg_random_stream(fit->seed, 0, 0);
    size_t count = npg_mlp_places_of(&s).end;
    size_t inputs = (size_t)(settings->position_channels + settings->normal_channels) + s.code_size;
    float rate = (float)settings->mlp_rate;
    fit->params = npg_arena_take(&fit->arrays, count, sizeof *fit->params);
    NPG_TRY(npg_arena_status(&fit->arrays));
    draw_layers(fit->params, &s, inputs, &random);
    return npg_adam_open(&fit->mlp_adam, fit->device, &rate, count, count);
}

npg_status npg_fit_open(npg_fit **out, npg_device *device, const npg_fit_settings *settings,
                        const npg_mesh *reference, uint64_t seed)
{
    npg_fit *fit;
    float *normals = NULL;
    *out = NULL;
    NPG_REQUIRE(reference->vert_normals && reference->vert_count);
    NPG_TRY(npg_alloc(&fit, NPG_FOR_FIT, sizeof *fit));
    fit->settings = *settings;
    fit->device = device;
    fit->seed = seed;
    fit->arrays.purpose = fit->window.purpose = NPG_FOR_FIT;
    fit->real = reference->vert_count;
    fit->rows = npg_mlp_rows(device, fit->real);
    npg_fit_levels(&fit->levels, &settings->grid);
    npg_status status = sort_vertices(fit, reference, &normals);
    if (!status) status = open_grids(fit, normals);
    if (!status) status = draw_params(fit);
    if (!status && settings->is_of_ways) memset(fit->rest, 0, fit->real * 3 * sizeof *fit->rest);
    npg_release(&normals);
    if (status) npg_fit_close(&fit);
    *out = fit;
    return status;
}

static void close_window(npg_fit *fit)
{
    npg_mlp_close(&fit->mlp);
    npg_motion_close(&fit->motion);
    npg_arena_release(&fit->window);
    fit->frame_count = fit->tied_count = 0;
}

void npg_fit_close(npg_fit **slot)
{
    if (!slot || !*slot) return;
    npg_fit *fit = *slot;
    close_window(fit);
    npg_latent_close(&fit->latent);
    npg_sobolev_close(&fit->sobolev);
    npg_adam_close(&fit->grid_adam);
    npg_adam_close(&fit->mlp_adam);
    npg_buffer_close(&fit->u);
    npg_buffer_close(&fit->nodes);
    npg_buffer_close(&fit->dnodes);
    npg_release(&fit->edges);
    npg_arena_release(&fit->arrays);
    npg_release(slot);
}

/* ---- opening a window ---- */

static npg_status alloc_window(npg_fit *fit, size_t count)
{
    size_t code = 2 * (size_t)fit->settings.grid.frequencies, all = fit->measure ? count : 1;
    npg_arena *a = &fit->window;
    fit->place = npg_arena_take(a, count, sizeof(size_t));
    fit->rank = npg_arena_take(a, count, sizeof(size_t));
    fit->index = npg_arena_take(a, count, sizeof(int64_t));
    fit->times = npg_arena_take(a, count, sizeof(double));
    fit->cd = npg_arena_take(a, count, sizeof(float));
    fit->gains = npg_arena_take(a, count, sizeof(float));
    fit->codes = npg_arena_take(a, count * code, sizeof(float));
    fit->packed = npg_arena_take(a, all * fit->rows, 3 * sizeof(float));
    fit->now = npg_arena_take(a, all * fit->real, 3 * sizeof(float));
    fit->gradient = npg_arena_take(a, all * fit->real, 3 * sizeof(float));
    fit->has_points = npg_arena_take(a, count, sizeof(bool));
    return npg_arena_status(a);
}

/* The caller's frames from the key outward: nearest first, the earlier one on ties. */
static void sort_outward(npg_fit *fit, const npg_fit_frame *frames, size_t count, int64_t key)
{
    for (size_t i = 0; i < count; i++) {
        size_t k = i;
        for (; k > 0; k--) {
            int64_t before = frames[fit->place[k - 1]].index;
            if (llabs(before - key) <= llabs(frames[i].index - key)) break;
            fit->place[k] = fit->place[k - 1];
        }
        fit->place[k] = i;
    }
    for (size_t k = 0; k < count; k++) {
        const npg_fit_frame *frame = &frames[fit->place[k]];
        fit->rank[fit->place[k]] = k;
        fit->index[k] = frame->index;
        fit->times[k] = frame->time;
        fit->has_points[k] = frame->count > 0;
        if (frame->tie && k == fit->tied_count) fit->tied_count++;
    }
}

/* A frame's points in Morton order; an empty frame gets one point that the confidence then ignores. */
static npg_status copy_target(npg_target *target, const npg_fit_frame *frame)
{
    static const float nowhere[3] = {0, 0, 0};
    uint32_t *order = NULL;
    float *points = NULL;
    size_t count = frame->count ? frame->count : 1;
    const float *from = frame->count ? frame->points : nowhere;
    npg_status status = npg_alloc_array(&order, NPG_FOR_FIT, count, sizeof *order);
    if (!status) status = npg_alloc_array(&points, NPG_FOR_FIT, count, 3 * sizeof *points);
    if (!status) status = npg_morton_order(order, from, count);
    for (size_t i = 0; !status && i < 3 * count; i++) points[i] = from[3 * order[i / 3] + i % 3];
    npg_release(&order);
    *target = (npg_target){points, count};
    return status;
}

static npg_status open_motion_on(npg_fit *fit, const npg_target *targets)
{
    return npg_motion_open(&fit->motion, fit->device, fit->rest, fit->real, fit->rows,
                           (const uint32_t(*)[2])fit->edges, fit->edge_count, targets, fit->frame_count);
}

/* V x 3 in the order of rows. */
static void copy_rows(float *to, const npg_fit *fit, const float *from)
{
    for (size_t i = 0; i < fit->real; i++)
        memcpy(to + 3 * i, from + 3 * (size_t)fit->order[i], 3 * sizeof *to);
}

static npg_status take_bases(npg_fit *fit, const npg_fit_frame *frames)
{
    float *bases;
    if (!frames->base) return NPG_OK;
    NPG_TRY(npg_alloc_array(&bases, NPG_FOR_FIT, fit->frame_count * fit->real, 3 * sizeof *bases));
    for (size_t k = 0; k < fit->frame_count; k++)
        copy_rows(bases + k * 3 * fit->real, fit, frames[fit->place[k]].base);
    npg_status status = npg_motion_rebase(&fit->motion, fit->device, bases);
    npg_release(&bases);
    return status;
}

static npg_status take_ties(npg_fit *fit, const npg_fit_frame *frames)
{
    fit->ties = npg_arena_take(&fit->window, fit->tied_count * fit->real + 1, 3 * sizeof(float));
    NPG_TRY(npg_arena_status(&fit->window));
    for (size_t k = 0; k < fit->tied_count; k++)
        copy_rows(fit->ties + k * 3 * fit->real, fit, frames[fit->place[k]].tie);
    return NPG_OK;
}

static npg_status open_targets(npg_fit *fit, const npg_fit_frame *frames)
{
    npg_target *targets;
    size_t count = fit->frame_count;
    NPG_TRY(npg_alloc_array(&targets, NPG_FOR_FIT, count, sizeof *targets));
    npg_status status = NPG_OK;
    for (size_t k = 0; k < count && !status; k++) status = copy_target(&targets[k], &frames[fit->place[k]]);
    if (!status) status = open_motion_on(fit, targets);
    for (size_t k = 0; k < count; k++) npg_release((void *)&targets[k].points);
    npg_release(&targets);
    if (!status) status = take_bases(fit, frames);
    return status ? status : take_ties(fit, frames);
}

npg_status npg_fit_begin(npg_fit *fit, const npg_fit_frame *frames, size_t count, int64_t key,
                         npg_fit_measure *measure, void *user)
{
    NPG_REQUIRE(fit && frames && count);
    npg_mlp_shape shape = shape_of(&fit->settings.grid);
    close_window(fit);
    fit->measure = measure;
    fit->user = user;
    fit->frame_count = count;
    NPG_TRY(alloc_window(fit, count));
    sort_outward(fit, frames, count, key);
    NPG_TRY(npg_mlp_open(&fit->mlp, fit->device, &shape, fit->rows, count,
                         measure || count < BATCH ? count : BATCH));
    NPG_TRY(
        npg_buffer_write(&fit->mlp.params, 0, fit->params, npg_mlp_places_of(&shape).end * sizeof(float)));
    return measure ? open_motion_on(fit, NULL) : open_targets(fit, frames);
}

void npg_time_code(float *codes, const double *times, size_t count, size_t frequencies)
{
    for (size_t i = 0; i < count; i++)
        for (size_t j = 0; j < frequencies; j++) {
            double at = M_PI * (double)(1 << j) * times[i];
            codes[2 * i * frequencies + j] = (float)sin(at);
            codes[(2 * i + 1) * frequencies + j] = (float)cos(at);
        }
}

/* ---- one epoch ---- */

static npg_status begin_epoch(npg_fit *fit)
{
    npg_time_code(fit->codes, fit->times, fit->frame_count, (size_t)fit->settings.grid.frequencies);
    NPG_TRY(npg_buffer_write(&fit->mlp.code, 0, fit->codes,
                             fit->frame_count * fit->mlp.shape.code_size * sizeof(float)));
    NPG_TRY(npg_sobolev_solve(&fit->sobolev, &fit->nodes, &fit->u));
    NPG_TRY(npg_latent_sample(&fit->latent, &fit->mlp.z, &fit->nodes));
    return npg_mlp_begin(&fit->mlp);
}

static npg_status check_losses(const npg_fit *fit, size_t first, size_t count, int64_t epoch)
{
    for (size_t k = first; k < first + count; k++)
        if (!isfinite(fit->cd[k]))
            return npg_error(NPG_DIVERGED, "the loss of frame %lld is not finite in epoch %lld",
                             (long long)fit->index[k], (long long)epoch);
    return NPG_OK;
}

/* Of the mean over vertices of d^2: about what all distances of a frame of 5000 points weigh. */
#define TIE_WEIGHT 15000

/* Loss and gradient of a tied frame; the few there are go through the host. */
static npg_status measure_tied(npg_fit *fit, size_t k)
{
    size_t bytes = fit->rows * 3 * sizeof(float);
    const float *tie = fit->ties + k * fit->real * 3, weight = (float)(TIE_WEIGHT / (double)fit->real);
    float sum = 0;
    NPG_TRY(npg_buffer_read(&fit->motion.x, k * bytes, fit->packed, bytes));
    for (size_t row = 0; row < fit->rows; row++)
        for (size_t axis = 0; axis < 3; axis++) {
            float *at = &fit->packed[NPG_POINT_AT(row) + axis * NPG_LANES];
            float off = row < fit->real ? *at - tie[3 * row + axis] : 0;
            sum += weight * off * off;
            *at = 2 * weight * off;
        }
    NPG_TRY(npg_buffer_write(&fit->motion.g, k * bytes, fit->packed, bytes));
    return npg_buffer_write(&fit->motion.cd, k * sizeof sum, &sum, sizeof sum);
}

/* Losses of the frames and their gradients by position: tied frames by their ties, the others by distance. */
static npg_status measure_frames(npg_fit *fit, size_t first, size_t count)
{
    size_t end = first + count;
    for (; first < end && first < fit->tied_count; first++) NPG_TRY(measure_tied(fit, first));
    if (first == end) return NPG_OK;
    return npg_motion_chamfer(&fit->motion, fit->settings.paper.welsch, first, end - first);
}

/* Positions, losses, and the gradient at the decoder's end. */
static npg_status measure_batch(npg_fit *fit, npg_weights *weights, size_t first, size_t count, int64_t epoch)
{
    double iso = fit->settings.paper.isometry / ((double)fit->frame_count * (double)fit->edge_count);
    NPG_TRY(npg_mlp_forward(&fit->mlp, first, count));
    NPG_TRY(npg_motion_apply(&fit->motion, &fit->mlp.out, first, count));
    NPG_TRY(measure_frames(fit, first, count));
    NPG_TRY(npg_buffer_read(&fit->motion.cd, first * sizeof(float), fit->cd + first, count * sizeof(float)));
    NPG_TRY(check_losses(fit, first, count, epoch));
    for (size_t k = first; k < first + count; k++)
        fit->gains[k] = k < fit->tied_count
                            ? (float)weights->share
                            : (float)npg_weights_next(weights, fit->index[k], fit->cd[k], fit->has_points[k]);
    return npg_motion_back(&fit->motion, &fit->mlp.dout, &fit->mlp.out, fit->gains + first, iso, first,
                           count);
}

static npg_status end_epoch(npg_fit *fit)
{
    NPG_TRY(npg_mlp_end(&fit->mlp));
    NPG_TRY(npg_latent_back(&fit->latent, &fit->dnodes, &fit->mlp.dz, &fit->mlp.z));
    NPG_TRY(npg_sobolev_solve(&fit->sobolev, &fit->dnodes, &fit->dnodes));
    NPG_TRY(npg_adam_step(&fit->grid_adam, &fit->u, &fit->dnodes));
    return npg_adam_step(&fit->mlp_adam, &fit->mlp.params, &fit->mlp.grad);
}

static npg_status sum_up(npg_fit *fit, npg_fit_step *step)
{
    size_t blocks = fit->rows / NPG_LANES, solved = 0, all = fit->frame_count * blocks;
    float *part;
    double sum = 0, weighted = 0;
    NPG_TRY(npg_alloc_array(&part, NPG_FOR_FIT, all, sizeof(float)));
    npg_status status = npg_buffer_read(&fit->motion.part, 0, part, all * sizeof(float));
    for (size_t i = 0; !status && i < all; i++) sum += (double)part[i];
    npg_release(&part);
    step->chamfer = 0;
    for (size_t k = 0; k < fit->frame_count; k++) {
        weighted += (double)(fit->cd[k] * fit->gains[k]);
        if (!fit->has_points[k] || k < fit->tied_count) continue;
        step->chamfer += (double)fit->cd[k];
        solved++;
    }
    step->chamfer /= solved ? (double)solved : 1;
    step->isometry = 0.5 * sum / ((double)fit->frame_count * (double)fit->edge_count);
    step->loss = weighted + fit->settings.paper.isometry * step->isometry;
    return status;
}

/* Between the device's rows, outward, and the caller's order. */
static void sort_rows(npg_fit *fit, bool is_to_device)
{
    for (size_t k = 0; k < fit->frame_count; k++)
        for (size_t row = 0; row < fit->rows; row++)
            for (size_t axis = 0; axis < 3; axis++) {
                float *packed = fit->packed + 3 * k * fit->rows + NPG_POINT_AT(row) + axis * NPG_LANES;
                size_t at = 3 * (fit->place[k] * fit->real + (row < fit->real ? fit->order[row] : 0)) + axis;
                if (is_to_device)
                    *packed = row < fit->real ? fit->gradient[at] : 0;
                else if (row < fit->real)
                    fit->now[at] = *packed;
            }
}

/* All frames at once, by the caller's loss. */
static npg_status measure_by_caller(npg_fit *fit, npg_fit_step *step)
{
    size_t count = fit->frame_count, bytes = count * fit->rows * 3 * sizeof(float);
    NPG_TRY(npg_mlp_forward(&fit->mlp, 0, count));
    NPG_TRY(npg_motion_apply(&fit->motion, &fit->mlp.out, 0, count));
    NPG_TRY(npg_buffer_read(&fit->motion.x, 0, fit->packed, bytes));
    sort_rows(fit, false);
    NPG_TRY(fit->measure(fit->user, &step->loss, fit->gradient, fit->now));
    if (!isfinite(step->loss))
        return npg_error(NPG_DIVERGED, "the loss is not finite in epoch %lld", (long long)step->epoch);
    sort_rows(fit, true);
    NPG_TRY(npg_buffer_write(&fit->motion.g, 0, fit->packed, bytes));
    for (size_t k = 0; k < count; k++) fit->gains[k] = 1;
    NPG_TRY(npg_motion_back(&fit->motion, &fit->mlp.dout, &fit->mlp.out, fit->gains, 0, 0, count));
    return npg_mlp_backward(&fit->mlp, 0, count);
}

/* What the present state measures, and the gradients for a step. */
static npg_status measure_epoch(npg_fit *fit, npg_fit_step *step)
{
    npg_weights weights;
    double progress = (double)step->epoch / (double)step->epochs;
    NPG_TRY(begin_epoch(fit));
    if (fit->measure) return measure_by_caller(fit, step);
    npg_weights_begin(&weights, (npg_confidence)fit->settings.paper.confidence, progress, fit->index[0],
                      fit->frame_count);
    for (size_t first = 0; first < fit->frame_count; first += fit->mlp.batch) {
        size_t left = fit->frame_count - first, count = left < fit->mlp.batch ? left : fit->mlp.batch;
        NPG_TRY(measure_batch(fit, &weights, first, count, step->epoch));
        NPG_TRY(npg_mlp_backward(&fit->mlp, first, count));
    }
    return sum_up(fit, step);
}

/* The positions that follow from the parameters after the last step. */
static npg_status decode(npg_fit *fit)
{
    NPG_TRY(begin_epoch(fit));
    for (size_t first = 0; first < fit->frame_count; first += fit->mlp.batch) {
        size_t left = fit->frame_count - first, count = left < fit->mlp.batch ? left : fit->mlp.batch;
        NPG_TRY(npg_mlp_forward(&fit->mlp, first, count));
        NPG_TRY(npg_motion_apply(&fit->motion, &fit->mlp.out, first, count));
    }
    return npg_device_finish(fit->device);
}

/* Half a cosine from 1 down to rate_end. */
static double rate_at(double rate_end, const npg_fit_step *step)
{
    double part = step->epochs > 1 ? (double)step->epoch / (double)(step->epochs - 1) : 0;
    return rate_end + (1 - rate_end) * 0.5 * (1 + cos(M_PI * part));
}

void npg_fit_rest(npg_fit *fit)
{
    npg_mlp_shape shape = shape_of(&fit->settings.grid);
    npg_mlp_places at = npg_mlp_places_of(&shape);
    memset(fit->params + at.head, 0, (at.b2 - at.head) * sizeof *fit->params);
    memset(fit->params + at.head_bias, 0, (at.w1z - at.head_bias) * sizeof *fit->params);
}

npg_status npg_fit_run(npg_fit *fit, int64_t first, int64_t end, npg_fit_watch *watch, void *user)
{
    npg_fit_step step = {.epoch = first, .epochs = end};
    for (; step.epoch < end; step.epoch++) {
        fit->grid_adam.scale = fit->mlp_adam.scale = rate_at(fit->settings.rate_end, &step);
        NPG_TRY(measure_epoch(fit, &step));
        NPG_TRY(end_epoch(fit));
        if (watch) NPG_TRY(watch(user, &step));
    }
    NPG_TRY(npg_fit_read_params(fit));
    return decode(fit);
}

npg_status npg_fit_read_params(npg_fit *fit)
{
    return fit->frame_count ? npg_buffer_read(&fit->mlp.params, 0, fit->params, fit->mlp.params.size)
                            : NPG_OK;
}

npg_status npg_fit_write_params(npg_fit *fit)
{
    return fit->frame_count ? npg_buffer_write(&fit->mlp.params, 0, fit->params, fit->mlp.params.size)
                            : NPG_OK;
}

npg_status npg_fit_vertices(npg_fit *fit, float *vert_unit, size_t i)
{
    NPG_REQUIRE(i < fit->frame_count);
    size_t bytes = fit->rows * 3 * sizeof(float);
    NPG_TRY(npg_buffer_read(&fit->motion.x, fit->rank[i] * bytes, fit->packed, bytes));
    for (size_t row = 0; row < fit->real; row++)
        for (size_t axis = 0; axis < 3; axis++) {
            float at = fit->packed[NPG_POINT_AT(row) + axis * NPG_LANES];
            if (!isfinite(at)) return npg_error(NPG_DIVERGED, "a vertex of frame %zu is not finite", i);
            vert_unit[3 * fit->order[row] + axis] = at;
        }
    return NPG_OK;
}

npg_fit_parts npg_fit_open_parts(npg_fit *fit)
{
    npg_mlp_shape shape = shape_of(&fit->settings.grid);
    return (npg_fit_parts){&fit->levels,   &fit->u,     &fit->grid_adam,
                           &fit->mlp_adam, fit->params, npg_mlp_places_of(&shape).end};
}

#define UNITS 2 /* of the device, whose scratch memory counts: on more the drivers' own counts more */

size_t npg_fit_memory(const npg_fit_settings *s, size_t vert_count, size_t frames, size_t points)
{
    npg_levels levels = {0};
    npg_mlp_shape shape = shape_of(&s->grid);
    npg_fit_levels(&levels, &s->grid);
    const npg_tuning *tuning = &npg_tuning_wide; /* a processor: elsewhere the device has memory of its own */
    size_t block = (size_t)tuning->mlp_rows, groups = (size_t)(tuning->mlp_groups * UNITS);
    size_t rows = (vert_count + block - 1) / block * block;
    size_t batch = frames < BATCH || s->is_of_ways ? frames : BATCH;
    size_t per_row = 2 * shape.w1 + batch * shape.w2 + 2 * 8 * 8 * (size_t)levels.count / 4 + 96;
    size_t per_frame = rows * (2 * NPG_MLP_OUT + 6 + 4 + 9) + points * 8 + groups * shape.w1;
    size_t per_group = npg_mlp_places_of(&shape).end + npg_mlp_scratch(&shape, block);
    size_t grids = levels.row_count * NPG_LATENT_CHANNELS * 8, decoder = npg_mlp_places_of(&shape).end * 7;
    return 4 * (rows * per_row + frames * per_frame + groups * per_group + grids + decoder);
}
