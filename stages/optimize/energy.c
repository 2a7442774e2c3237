/* Energy: smoothing, then matching. */
#include "optimize/energy.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/limits.h"
#include "pipeline/order.h"
#include "pipeline/parallel.h"

#define THREADS_MAX 8
#define NOISE_LEAST 1e-5 /* units: points without noise still have a width */
/* A frame's own pose counts as much as TRUST times its points where frames move smoothly without help (lambda
 * small), half at EVEN, and TRUST_LEAST where it takes neighbours in time to see the motion (lambda large):
 * what slides along the surface is seen by poses alone. */
#define TRUST       3
#define TRUST_LEAST 0.1
#define EVEN        0.02

struct npg_energy {
    npg_energy_settings settings;
    npg_mesh *mesh; /* counted reference */
    uint32_t (*edges)[2];
    size_t edge_count;
    npg_mesh_neighbours ring;
    size_t threads;
    npg_point_matcher matchers[THREADS_MAX];
    npg_arena window; /* holds what follows, of the window at work */
    float *positions; /* T x W x 3: where the frames' surfaces are */
    float *posed;     /* T x W x 3: where they were aligned to, holes bridged */
    float *lambda;    /* W */
    bool *is_known;
    double *spreads, *scores;   /* T */
    npg_energy_frame *frames;   /* T, on `positions` */
    npg_time_quadric *quadrics; /* T x W: what the points say of the frames as they came */
    npg_energy_system system;   /* its arrays, too */
    double noise, lambda_median, bridged;
    bool is_of_sensors; /* a frame of the window */
};

void npg_energy_close(npg_energy **slot)
{
    if (!slot || !*slot) return;
    npg_energy *e = *slot;
    for (size_t i = 0; i < THREADS_MAX; i++) npg_point_matcher_close(&e->matchers[i]);
    npg_arena_release(&e->window);
    npg_mesh_neighbours_close(&e->ring);
    npg_release(&e->edges);
    npg_mesh_unref(&e->mesh);
    npg_release(slot);
}

static npg_status open_parts(npg_energy *e)
{
    const npg_mesh *mesh = e->mesh;
    NPG_TRY(npg_mesh_edges(&e->edges, &e->edge_count, mesh->faces, mesh->face_count));
    NPG_TRY(npg_mesh_neighbours_open(&e->ring, mesh));
    e->threads = npg_parallel_parts(THREADS_MAX, 1, THREADS_MAX);
    for (size_t i = 0; i < e->threads; i++)
        NPG_TRY(npg_point_matcher_open(&e->matchers[i], mesh, (size_t)e->settings.points));
    return NPG_OK;
}

npg_status npg_energy_open(npg_energy **out, npg_mesh *surface, const npg_energy_settings *settings)
{
    npg_energy *e;
    *out = NULL;
    NPG_TRY(npg_alloc(&e, NPG_FOR_FIT, sizeof *e));
    e->settings = *settings;
    e->window.purpose = NPG_FOR_FIT;
    e->mesh = npg_mesh_ref(surface);
    npg_status status = open_parts(e);
    if (status) npg_energy_close(&e);
    *out = e;
    return status;
}

void npg_energy_set_noise(npg_energy *e, double noise)
{
    e->noise = noise;
}

/* ---- a window ---- */

static npg_status open_window(npg_energy *e, const npg_energy_frame *frames, size_t count)
{
    size_t w = e->mesh->vert_count, most = (size_t)e->settings.points;
    npg_arena *a = &e->window;
    npg_arena_release(a);
    e->is_of_sensors = false;
    e->bridged = 0;
    e->positions = npg_arena_take(a, count * w, 3 * sizeof(float));
    e->posed = npg_arena_take(a, count * w, 3 * sizeof(float));
    e->lambda = npg_arena_take(a, w, sizeof(float));
    e->is_known = npg_arena_take(a, count, sizeof(bool));
    e->spreads = npg_arena_take(a, count, sizeof(double));
    e->scores = npg_arena_take(a, count, sizeof(double));
    e->frames = npg_arena_take(a, count, sizeof *e->frames);
    e->quadrics = npg_arena_take(a, count * w, sizeof *e->quadrics);
    e->system = (npg_energy_system){.frame_count = count,
                                    .vert_count = w,
                                    .ring = e->ring,
                                    .lambda = npg_arena_take(a, w, sizeof(float)),
                                    .shape = e->settings.shape,
                                    .pulls = npg_arena_take(a, count * most, sizeof(npg_point_pull)),
                                    .pull_counts = npg_arena_take(a, count, sizeof(size_t)),
                                    .most = most,
                                    .ties = npg_arena_take(a, w, sizeof(float)),
                                    .shares = npg_arena_take(a, count, sizeof(float)),
                                    .right = npg_arena_take(a, count * w, 3 * sizeof(float))};
    NPG_TRY(npg_arena_status(a));
    for (size_t t = 0; t < count; t++) {
        e->frames[t] = frames[t];
        e->frames[t].positions = e->positions + t * w * 3;
        memcpy(e->frames[t].positions, frames[t].positions, w * 3 * sizeof(float));
        e->is_known[t] = frames[t].is_known;
        e->is_of_sensors |= frames[t].is_of_sensors;
    }
    return NPG_OK;
}

/* What threads do: frame after frame. */
typedef struct frame_work {
    npg_energy *e;
    size_t count;
} frame_work;

static npg_status measure_frames(void *user, size_t part)
{
    frame_work *r = user;
    for (size_t t = part; t < r->count; t += r->e->threads)
        NPG_TRY(npg_point_matcher_measure(&r->e->matchers[part], &r->e->spreads[t], &r->e->frames[t]));
    return NPG_OK;
}

/* Median over the frames that have points; 0 where none has.  Uses scores as scratch. */
static double median_spread(npg_energy *e, size_t count)
{
    size_t seen = 0;
    for (size_t t = 0; t < count; t++)
        if (e->frames[t].point_count) e->scores[seen++] = e->spreads[t];
    if (!seen) return 0;
    qsort(e->scores, seen, sizeof *e->scores, npg_order_double);
    return e->scores[seen / 2];
}

/* What each frame says: little where its surface is much farther from its points than usual: one is wrong. */
static npg_status weigh_frames(npg_energy *e, size_t count)
{
    frame_work r = {e, count};
    NPG_TRY(npg_parallel(measure_frames, &r, e->threads));
    double usual = median_spread(e, count);
    for (size_t t = 0; t < count; t++) {
        double over = usual > 0 ? e->spreads[t] / usual : 1, off = fmax(0, over - 1);
        e->system.shares[t] = e->frames[t].point_count ? (float)npg_geman_mcclure(off * off, 1) : 0;
    }
    return NPG_OK;
}

/* Uses the system's as scratch. */
static double lambda_median(npg_energy *e)
{
    size_t w = e->mesh->vert_count;
    memcpy(e->system.lambda, e->lambda, w * sizeof *e->system.lambda);
    qsort(e->system.lambda, w, sizeof *e->system.lambda, npg_order_float);
    return (double)e->system.lambda[w / 2];
}

static npg_status match_frames(void *user, size_t part)
{
    frame_work *r = user;
    npg_energy *e = r->e;
    for (size_t t = part; t < r->count; t += e->threads) {
        npg_point_pull *pulls = e->system.pulls + t * (size_t)e->settings.points;
        double width = NPG_BEYOND * fmax(fmax(e->spreads[t], e->noise), NOISE_LEAST);
        NPG_TRY(npg_point_matcher_match(&e->matchers[part], pulls, &e->system.pull_counts[t], &e->frames[t],
                                        width));
        for (size_t i = 0; i < e->system.pull_counts[t]; i++) pulls[i].strength *= e->system.shares[t];
    }
    return NPG_OK;
}

/* What the points say, at their faces' corners. */
static npg_status gather_quadrics(void *user, size_t part)
{
    frame_work *r = user;
    npg_energy *e = r->e;
    for (size_t t = part; t < r->count; t += e->threads)
        for (size_t i = 0; i < e->system.pull_counts[t]; i++) {
            const npg_point_pull *p = &e->system.pulls[t * (size_t)e->settings.points + i];
            float across = 0;
            for (int a = 0; a < 3; a++) across += p->normal[a] * p->offset[a];
            for (int c = 0; c < 3; c++)
                npg_time_quadric_add(&e->quadrics[t * e->mesh->vert_count + p->corner[c]],
                                     p->weight[c] * p->strength, p->normal, across);
        }
    return NPG_OK;
}

static double points_of(const npg_energy *e, size_t count)
{
    size_t sum = 0, frames = 0;
    for (size_t t = 0; t < count; t++) {
        sum += e->frames[t].point_count;
        frames += e->frames[t].point_count > 0;
    }
    return fmax(1, (double)sum) / fmax(1, (double)frames);
}

static npg_status smooth(npg_energy *e, size_t count)
{
    const npg_time_frames f = {count,       e->mesh->vert_count, e->positions, e->system.shares,
                               e->is_known, points_of(e, count)};
    const uint32_t(*edges)[2] = (const uint32_t(*)[2])e->edges;
    frame_work r = {e, count};
    NPG_TRY(weigh_frames(e, count));
    NPG_TRY(npg_parallel(match_frames, &r, e->threads));
    NPG_TRY(npg_parallel(gather_quadrics, &r, e->threads));
    if (!e->is_of_sensors) NPG_TRY(npg_time_bridge(&f, &e->bridged, e->quadrics, edges, e->edge_count));
    memcpy(e->posed, e->positions, 3 * count * e->mesh->vert_count * sizeof *e->posed);
    NPG_TRY(npg_time_smooth_choose(e->lambda, &f, e->quadrics, edges, e->edge_count));
    e->lambda_median = lambda_median(e);
    NPG_TRY(npg_time_smooth_apply(&f, e->lambda));
    NPG_TRY(npg_parallel(measure_frames, &r, e->threads));
    e->noise = fmax(median_spread(e, count), NOISE_LEAST);
    return NPG_OK;
}

/* ---- the system ---- */

static void pull_to_pose(float *right, const npg_energy *e, size_t t)
{
    const float *now = e->frames[t].positions, *pose = e->posed + 3 * t * e->mesh->vert_count;
    for (size_t i = 0; i < 3 * e->mesh->vert_count; i++)
        right[i] += e->system.shares[t] * e->system.ties[i / 3] * (pose[i] - now[i]);
}

void npg_energy_even(float *right, const npg_energy *e, const float *d, size_t t)
{
    memset(right, 0, 3 * e->mesh->vert_count * sizeof *right);
    npg_energy_bend(right, &e->system, e->positions, t, -1);
    npg_energy_bend(right, &e->system, d, t, -1);
    npg_energy_tie(right, &e->system, d, t, -1);
    pull_to_pose(right, e, t);
}

/* The right side: -gradient / 2 of the energy where the surface is now. */
static void fill_right(npg_energy *e, size_t t)
{
    npg_energy_system *s = &e->system;
    size_t w = s->vert_count;
    float *right = s->right + t * w * 3;
    memset(right, 0, w * 3 * sizeof *right);
    npg_energy_bend(right, s, e->positions, t, -1);
    pull_to_pose(right, e, t);
    for (size_t i = 0; i < s->pull_counts[t]; i++) {
        const npg_point_pull *p = &s->pulls[t * s->most + i];
        float across = 0;
        for (int a = 0; a < 3; a++) across += p->normal[a] * p->offset[a];
        for (size_t c = 0; c < 3; c++)
            for (size_t a = 0; a < 3; a++)
                right[3 * (size_t)p->corner[c] + a] += p->weight[c] * p->strength * across * p->normal[a];
    }
}

static npg_status fill_frames(void *user, size_t part)
{
    frame_work *r = user;
    for (size_t t = part; t < r->count; t += r->e->threads) fill_right(r->e, t);
    return NPG_OK;
}

/* lambda in units of the points that pull at a vertex. */
static void set_bend(npg_energy *e, size_t count)
{
    double strength = 0, frames = 0;
    for (size_t t = 0; t < count; t++) {
        for (size_t i = 0; i < e->system.pull_counts[t]; i++)
            strength += (double)e->system.pulls[t * e->system.most + i].strength;
        frames += e->system.pull_counts[t] > 0;
    }
    double each = frames > 0 ? strength / (frames * (double)e->mesh->vert_count) : 1;
    for (size_t v = 0; v < e->mesh->vert_count; v++) {
        double even = (double)e->lambda[v] * e->lambda_median / (EVEN * EVEN);
        e->system.ties[v] = (float)(each * (TRUST_LEAST + TRUST / (1 + even)));
        e->system.lambda[v] = (float)((double)e->lambda[v] * (each + (double)e->system.ties[v]));
    }
}

npg_status npg_energy_set(npg_energy *e, const npg_energy_frame *frames, size_t count)
{
    frame_work r = {e, count};
    NPG_REQUIRE(e && frames && count);
    NPG_TRY(open_window(e, frames, count));
    NPG_TRY(smooth(e, count));
    NPG_TRY(npg_parallel(match_frames, &r, e->threads));
    set_bend(e, count);
    return npg_parallel(fill_frames, &r, e->threads);
}

const float *npg_energy_smoothed(const npg_energy *e)
{
    return e->positions;
}

double npg_energy_noise(const npg_energy *e)
{
    return e->noise;
}

double npg_energy_lambda(const npg_energy *e)
{
    return e->lambda_median;
}

double npg_energy_bridged(const npg_energy *e)
{
    return e->bridged;
}

npg_energy_system *npg_energy_system_of(npg_energy *e)
{
    return &e->system;
}

/* ---- at the start ---- */

static double pulls_at_start(const npg_energy *e, size_t t)
{
    double sum = 0;
    for (size_t i = 0; i < e->system.pull_counts[t]; i++) {
        const npg_point_pull *p = &e->system.pulls[t * e->system.most + i];
        double across = 0;
        for (int a = 0; a < 3; a++) across += (double)p->normal[a] * (double)p->offset[a];
        sum += (double)p->strength * across * across;
    }
    return sum;
}

/* Each second difference counts at its first frame. */
static double poses_and_bend_at_start(const npg_energy *e, size_t t)
{
    size_t row = 3 * e->mesh->vert_count;
    const float *now = e->frames[t].positions, *pose = e->posed + t * row;
    bool is_inner = t + 2 < e->system.frame_count;
    double sum = 0;
    for (size_t i = 0; i < row; i++) {
        double off = (double)now[i] - (double)pose[i];
        double bend = is_inner ? (double)now[i] - 2 * (double)now[i + row] + (double)now[i + 2 * row] : 0;
        sum += (double)(e->system.shares[t] * e->system.ties[i / 3]) * off * off +
               (double)e->system.lambda[i / 3] * bend * bend;
    }
    return sum;
}

double npg_energy_at_start(const npg_energy *e)
{
    double sum = 0;
    for (size_t t = 0; t < e->system.frame_count; t++)
        sum += pulls_at_start(e, t) + poses_and_bend_at_start(e, t);
    return sum;
}

size_t npg_energy_memory(const npg_energy_settings *settings, size_t vert_count, size_t frames)
{
    const size_t vector = 3 * sizeof(float);
    size_t errors = 41 * vert_count * sizeof(double);
    return frames * vert_count * (sizeof(npg_time_quadric) + sizeof(double) + 3 * vector) + errors +
           frames * (size_t)settings->points * sizeof(npg_point_pull) + vert_count * 22 * sizeof(float) * 8;
}
