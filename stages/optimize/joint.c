/* Joint: smoothing, then matching and solving. */
#include "optimize/joint.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/order.h"
#include "pipeline/parallel.h"

#define THREADS_MAX 8
#define WIDTH       3    /* of the robust weight, in standard deviations of the frame */
#define TOLERANCE   1e-2 /* of a solution                                             */
#define NOISE_LEAST 1e-5 /* units: points without noise still have a width */
/* A frame's own pose counts as much as TRUST times its points where frames move smoothly without help (lambda
 * small), half at EVEN, and TRUST_LEAST where it takes neighbours in time to see the motion (lambda large):
 * what slides along the surface is seen by poses alone. */
#define TRUST       3
#define TRUST_LEAST 0.1
#define EVEN        0.02

struct npg_joint {
    npg_joint_settings settings;
    npg_mesh *mesh; /* counted reference */
    uint32_t (*edges)[2];
    size_t edge_count;
    npg_joint_ring ring;
    npg_arena rings;
    size_t threads;
    npg_joint_matcher matchers[THREADS_MAX];
    npg_arena window; /* holds what follows, of the window at work */
    float *positions; /* T x W x 3: where the frames' surfaces are */
    float *kept;      /* the same, before the points pulled        */
    float *shares, *lambda, *bend, *ties;
    const npg_joint_frame *given; /* loan */
    bool *is_known;
    double *spreads, *scores; /* T */
    npg_joint_frame *frames;  /* T, on `positions` */
    npg_joint_pull *pulls;
    size_t *pull_counts;
    npg_time_quadric *quadrics; /* T x W: what the points say of the frames as they came */
    npg_joint_system system;
    double noise, lambda_median;
};

void npg_joint_close(npg_joint **slot)
{
    if (!slot || !*slot) return;
    npg_joint *j = *slot;
    for (size_t i = 0; i < THREADS_MAX; i++) npg_joint_matcher_close(&j->matchers[i]);
    npg_arena_release(&j->window);
    npg_arena_release(&j->rings);
    npg_release(&j->edges);
    npg_mesh_unref(&j->mesh);
    npg_release(slot);
}

static npg_status open_parts(npg_joint *j)
{
    const npg_mesh *mesh = j->mesh;
    NPG_TRY(npg_mesh_edges(&j->edges, &j->edge_count, mesh->faces, mesh->face_count));
    NPG_TRY(npg_joint_ring_take(&j->ring, &j->rings, (const uint32_t(*)[2])j->edges, j->edge_count,
                                mesh->vert_count));
    j->threads = npg_parallel_parts(THREADS_MAX, 1, THREADS_MAX);
    for (size_t i = 0; i < j->threads; i++)
        NPG_TRY(npg_joint_matcher_open(&j->matchers[i], mesh, (size_t)j->settings.points));
    return NPG_OK;
}

npg_status npg_joint_open(npg_joint **out, npg_mesh *surface, const npg_joint_settings *settings)
{
    npg_joint *j;
    *out = NULL;
    NPG_TRY(npg_alloc(&j, NPG_FOR_FIT, sizeof *j));
    j->settings = *settings;
    j->rings.purpose = j->window.purpose = NPG_FOR_FIT;
    j->mesh = npg_mesh_ref(surface);
    npg_status status = open_parts(j);
    if (status) npg_joint_close(&j);
    *out = j;
    return status;
}

void npg_joint_set_noise(npg_joint *j, double noise)
{
    j->noise = noise;
}

/* ---- a window ---- */

static npg_status open_window(npg_joint *j, const npg_joint_frame *frames, size_t count)
{
    size_t w = j->mesh->vert_count, most = (size_t)j->settings.points;
    npg_arena *a = &j->window;
    npg_arena_release(a);
    j->positions = npg_arena_take(a, count * w, 3 * sizeof(float));
    j->kept = npg_arena_take(a, count * w, 3 * sizeof(float));
    j->shares = npg_arena_take(a, count, sizeof(float));
    j->lambda = npg_arena_take(a, w, sizeof(float));
    j->bend = npg_arena_take(a, w, sizeof(float));
    j->ties = npg_arena_take(a, w, sizeof(float));
    j->is_known = npg_arena_take(a, count, sizeof(bool));
    j->spreads = npg_arena_take(a, count, sizeof(double));
    j->scores = npg_arena_take(a, count, sizeof(double));
    j->frames = npg_arena_take(a, count, sizeof *j->frames);
    j->pulls = npg_arena_take(a, count * most, sizeof *j->pulls);
    j->pull_counts = npg_arena_take(a, count, sizeof *j->pull_counts);
    j->quadrics = npg_arena_take(a, count * w, sizeof *j->quadrics);
    npg_joint_system_take(&j->system, a, count, w);
    NPG_TRY(npg_arena_status(a));
    for (size_t t = 0; t < count; t++) {
        j->frames[t] = frames[t];
        j->frames[t].positions = j->positions + t * w * 3;
        memcpy(j->frames[t].positions, frames[t].positions, w * 3 * sizeof(float));
        j->is_known[t] = frames[t].is_known;
    }
    return NPG_OK;
}

/* What threads do: frame after frame. */
typedef struct frame_work {
    npg_joint *j;
    size_t count;
} frame_work;

static npg_status measure_frames(void *user, size_t part)
{
    frame_work *r = user;
    for (size_t t = part; t < r->count; t += r->j->threads)
        NPG_TRY(npg_joint_measure(&r->j->matchers[part], &r->j->spreads[t], &r->j->frames[t]));
    return NPG_OK;
}

/* Median over the frames that have points; 0 where none has.  Uses scores as scratch. */
static double median_spread(npg_joint *j, size_t count)
{
    size_t seen = 0;
    for (size_t t = 0; t < count; t++)
        if (j->frames[t].point_count) j->scores[seen++] = j->spreads[t];
    if (!seen) return 0;
    qsort(j->scores, seen, sizeof *j->scores, npg_order_double);
    return j->scores[seen / 2];
}

/* What each frame's pose is worth: little where its surface is much farther from its points than usual. */
static npg_status weigh_frames(npg_joint *j, size_t count)
{
    frame_work r = {j, count};
    NPG_TRY(npg_parallel(measure_frames, &r, j->threads));
    double usual = median_spread(j, count);
    for (size_t t = 0; t < count; t++) {
        double over = usual > 0 ? j->spreads[t] / usual : 1, off = fmax(0, over - 1);
        j->shares[t] = j->frames[t].point_count ? (float)(1 / (1 + off * off)) : 0;
    }
    return NPG_OK;
}

/* Uses bend as scratch. */
static double lambda_median(npg_joint *j)
{
    size_t w = j->mesh->vert_count;
    memcpy(j->bend, j->lambda, w * sizeof *j->bend);
    qsort(j->bend, w, sizeof *j->bend, npg_order_float);
    return (double)j->bend[w / 2];
}

static npg_status match_frames(void *user, size_t part)
{
    frame_work *r = user;
    npg_joint *j = r->j;
    for (size_t t = part; t < r->count; t += j->threads) {
        npg_joint_pull *pulls = j->pulls + t * (size_t)j->settings.points;
        double width = WIDTH * fmax(fmax(j->spreads[t], j->noise), NOISE_LEAST);
        NPG_TRY(npg_joint_match(&j->matchers[part], pulls, &j->pull_counts[t], &j->frames[t], width));
    }
    return NPG_OK;
}

/* What the points say, at their faces' corners. */
static npg_status gather_quadrics(void *user, size_t part)
{
    frame_work *r = user;
    npg_joint *j = r->j;
    for (size_t t = part; t < r->count; t += j->threads)
        for (size_t i = 0; i < j->pull_counts[t]; i++) {
            const npg_joint_pull *p = &j->pulls[t * (size_t)j->settings.points + i];
            float across = 0;
            for (int a = 0; a < 3; a++) across += p->normal[a] * p->offset[a];
            for (int c = 0; c < 3; c++)
                npg_time_quadric_add(&j->quadrics[t * j->mesh->vert_count + p->corner[c]],
                                     p->weight[c] * p->strength, p->normal, across);
        }
    return NPG_OK;
}

static double points_of(const npg_joint *j, size_t count)
{
    size_t sum = 0, frames = 0;
    for (size_t t = 0; t < count; t++) {
        sum += j->frames[t].point_count;
        frames += j->frames[t].point_count > 0;
    }
    return fmax(1, (double)sum) / fmax(1, (double)frames);
}

static npg_status smooth(npg_joint *j, size_t count)
{
    const npg_time_frames f = {count,     j->mesh->vert_count, j->positions,
                               j->shares, j->is_known,         points_of(j, count)};
    frame_work r = {j, count};
    NPG_TRY(weigh_frames(j, count));
    NPG_TRY(npg_parallel(match_frames, &r, j->threads));
    NPG_TRY(npg_parallel(gather_quadrics, &r, j->threads));
    NPG_TRY(
        npg_time_smooth_choose(j->lambda, &f, j->quadrics, (const uint32_t(*)[2])j->edges, j->edge_count));
    j->lambda_median = lambda_median(j);
    NPG_TRY(npg_time_smooth_apply(&f, j->lambda));
    NPG_TRY(npg_parallel(measure_frames, &r, j->threads));
    j->noise = fmax(median_spread(j, count), NOISE_LEAST);
    return NPG_OK;
}

/* ---- the system ---- */

static void pull_to_pose(npg_joint *j, float *right, size_t t)
{
    const float *now = j->frames[t].positions, *pose = j->given[t].positions;
    for (size_t i = 0; i < 3 * j->mesh->vert_count; i++)
        right[i] += j->shares[t] * j->ties[i / 3] * (pose[i] - now[i]);
}

/* The right side: -gradient / 2 of the energy where the surface is now. */
static void fill_right(npg_joint *j, size_t t)
{
    npg_joint_system *s = &j->system;
    size_t w = s->vert_count;
    float *right = s->right + t * w * 3;
    memset(right, 0, w * 3 * sizeof *right);
    npg_joint_keep_shape(right, s, j->kept + t * w * 3, j->frames[t].positions);
    npg_joint_bend(right, s, j->positions, t, -1);
    pull_to_pose(j, right, t);
    for (size_t i = 0; i < s->pull_counts[t]; i++) {
        const npg_joint_pull *p = &s->pulls[t * s->most + i];
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
    for (size_t t = part; t < r->count; t += r->j->threads) fill_right(r->j, t);
    return NPG_OK;
}

/* lambda in units of the points that pull at a vertex. */
static void set_bend(npg_joint *j, size_t count)
{
    double strength = 0, frames = 0;
    for (size_t t = 0; t < count; t++) {
        for (size_t i = 0; i < j->pull_counts[t]; i++)
            strength += (double)j->pulls[t * j->system.most + i].strength;
        frames += j->pull_counts[t] > 0;
    }
    double each = frames > 0 ? strength / (frames * (double)j->mesh->vert_count) : 1;
    for (size_t v = 0; v < j->mesh->vert_count; v++) {
        double even = (double)j->lambda[v] * j->lambda_median / (EVEN * EVEN);
        j->ties[v] = (float)(each * (TRUST_LEAST + TRUST / (1 + even)));
        j->bend[v] = (float)((double)j->lambda[v] * (each + (double)j->ties[v]));
    }
}

static npg_status solve_system(npg_joint *j, size_t count, int64_t *steps, npg_joint_watch *watch, void *user)
{
    npg_joint_system *s = &j->system;
    frame_work r = {j, count};
    s->ring = j->ring;
    s->lambda = j->bend;
    s->ties = j->ties;
    s->shares = j->shares;
    s->pulls = j->pulls;
    s->pull_counts = j->pull_counts;
    s->most = (size_t)j->settings.points;
    s->shape = j->settings.shape;
    NPG_TRY(npg_parallel(match_frames, &r, j->threads));
    set_bend(j, count);
    NPG_TRY(npg_parallel(fill_frames, &r, j->threads));
    NPG_TRY(npg_joint_system_solve(s, TOLERANCE, j->settings.steps, steps, watch, user));
    for (size_t i = 0; i < 3 * count * s->vert_count; i++) {
        if (!isfinite(s->step[i])) return npg_error(NPG_DIVERGED, "the joint fit is not finite");
        j->positions[i] += s->step[i];
    }
    return NPG_OK;
}

/* ---- all of it ---- */

static void note(npg_joint *j, npg_joint_result *result, const npg_joint_frame *frames, size_t count)
{
    size_t w = j->mesh->vert_count;
    double sum = 0;
    for (size_t t = 0; t < count; t++)
        for (size_t v = 0; v < w; v++) {
            double sq = 0;
            for (size_t i = 3 * v; i < 3 * v + 3; i++) {
                double off = (double)j->frames[t].positions[i] - (double)frames[t].positions[i];
                sq += off * off;
            }
            sum += sqrt(sq);
        }
    result->moved = sum / (double)(count * w);
    result->noise = j->noise;
    result->lambda = j->lambda_median;
}

npg_status npg_joint_solve(npg_joint *j, npg_joint_result *result, const npg_joint_frame *frames,
                           size_t count, npg_joint_watch *watch, void *user)
{
    *result = (npg_joint_result){0};
    NPG_REQUIRE(j && frames && count);
    if (!j->settings.steps) return NPG_OK;
    npg_status status = open_window(j, frames, count);
    j->given = frames;
    if (!status) status = smooth(j, count);
    if (!status) memcpy(j->kept, j->positions, count * j->mesh->vert_count * 3 * sizeof(float));
    if (!status) status = solve_system(j, count, &result->steps, watch, user);
    if (!status) note(j, result, frames, count);
    for (size_t t = 0; t < count && !status; t++)
        memcpy(frames[t].positions, j->frames[t].positions, j->mesh->vert_count * 3 * sizeof(float));
    npg_arena_release(&j->window);
    return status;
}

size_t npg_joint_memory(const npg_joint_settings *settings, size_t vert_count, size_t frames)
{
    const size_t vector = 3 * sizeof(float);
    size_t errors = 41 * vert_count * sizeof(double);
    return npg_joint_system_memory(frames, vert_count) + frames * vert_count * sizeof(npg_time_quadric) +
           2 * frames * vert_count * vector + errors +
           frames * (size_t)settings->points * sizeof(npg_joint_pull) + vert_count * 22 * sizeof(float) * 8;
}
