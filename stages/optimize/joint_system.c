/* Joint system: products, preconditioner, conjugate gradients. */
#include "optimize/joint.h"

#include <math.h>
#include <string.h>

#include "pipeline/parallel.h"

#define BLOCKS 64 /* of vertices: sums are made block by block, so that threads don't matter */

void npg_joint_system_take(npg_joint_system *s, npg_arena *arena, size_t frame_count, size_t vert_count)
{
    size_t count = frame_count * vert_count, vector = 3 * sizeof(float);
    *s = (npg_joint_system){.frame_count = frame_count,
                            .vert_count = vert_count,
                            .right = npg_arena_take(arena, count, vector),
                            .step = npg_arena_take(arena, count, vector),
                            .precond = npg_arena_take(arena, count, vector),
                            .direction = npg_arena_take(arena, count, vector),
                            .image = npg_arena_take(arena, count, vector),
                            .diagonal = npg_arena_take(arena, count, sizeof(float))};
}

size_t npg_joint_system_memory(size_t frame_count, size_t vert_count)
{
    return frame_count * vert_count * 16 * sizeof(float);
}

npg_status npg_joint_ring_take(npg_joint_ring *ring, npg_arena *arena, const uint32_t (*edges)[2],
                               size_t edge_count, size_t vert_count)
{
    ring->start = npg_arena_take(arena, vert_count + 2, sizeof *ring->start);
    ring->neighbour = npg_arena_take(arena, 2 * edge_count + 1, sizeof *ring->neighbour);
    NPG_TRY(npg_arena_status(arena));
    uint32_t *at = ring->start + 1; /* shifted by one while it is filled */
    for (size_t e = 0; e < 2 * edge_count; e++) at[edges[e / 2][e % 2] + 1]++;
    for (size_t v = 0; v < vert_count; v++) at[v + 1] += at[v];
    for (size_t e = 0; e < 2 * edge_count; e++)
        ring->neighbour[at[edges[e / 2][e % 2]]++] = edges[e / 2][1 - e % 2];
    return NPG_OK;
}

/* ---- products ---- */

/* Row t of B = D^T D for T frames: coefficient of frame t + k, k = -2 .. 2. */
static float bend_of(size_t frames, size_t t, int k)
{
    static const float second[3] = {1, -2, 1};
    float sum = 0;
    if (frames < 3) return 0;
    for (int a = 0; a < 3; a++) { /* the difference in which t is the a-th and t + k the (a + k)-th */
        int64_t first = (int64_t)t - a;
        if (first < 0 || first + 2 >= (int64_t)frames || a + k < 0 || a + k > 2) continue;
        sum += second[a] * second[a + k];
    }
    return sum;
}

void npg_joint_bend(float *image, const npg_joint_system *s, const float *x, size_t t, float sign)
{
    size_t w = s->vert_count;
    for (int k = -2; k <= 2; k++) {
        int64_t at = (int64_t)t + k;
        if (at < 0 || at >= (int64_t)s->frame_count) continue;
        float share = sign * bend_of(s->frame_count, t, k);
        const float *from = x + (size_t)at * w * 3;
        for (size_t i = 0; i < 3 * w; i++) image[i] += share * s->lambda[i / 3] * from[i];
    }
}

static void add_shape(float *restrict image, const npg_joint_system *s, const float *restrict x)
{
    float shape = (float)s->shape;
    for (size_t v = 0; v < s->vert_count; v++) {
        float degree = (float)(s->ring.start[v + 1] - s->ring.start[v]);
        float sum[3] = {degree * x[3 * v], degree * x[3 * v + 1], degree * x[3 * v + 2]};
        for (uint32_t k = s->ring.start[v]; k < s->ring.start[v + 1]; k++) {
            const float *other = x + 3 * (size_t)s->ring.neighbour[k];
            for (int a = 0; a < 3; a++) sum[a] -= other[a];
        }
        for (size_t a = 0; a < 3; a++) image[3 * v + a] += shape * sum[a];
    }
}

void npg_joint_keep_shape(float *image, const npg_joint_system *s, const float *kept, const float *now)
{
    float shape = (float)s->shape;
    for (size_t v = 0; v < s->vert_count; v++)
        for (uint32_t k = s->ring.start[v]; k < s->ring.start[v + 1]; k++)
            for (size_t a = 0; a < 3; a++) {
                size_t i = 3 * v + a, o = 3 * (size_t)s->ring.neighbour[k] + a;
                image[i] -= shape * (now[i] - kept[i] - now[o] + kept[o]);
            }
}

static void add_tie(float *restrict image, const npg_joint_system *s, const float *restrict x, size_t t)
{
    for (size_t i = 0; i < 3 * s->vert_count; i++) image[i] += s->shares[t] * s->ties[i / 3] * x[i];
}

static void add_pull(float *image, const npg_joint_pull *p, const float *x)
{
    float at[3] = {0}, across = 0;
    for (size_t c = 0; c < 3; c++)
        for (size_t a = 0; a < 3; a++) at[a] += p->weight[c] * x[3 * (size_t)p->corner[c] + a];
    for (int a = 0; a < 3; a++) across += p->normal[a] * at[a];
    across *= p->strength;
    for (size_t c = 0; c < 3; c++)
        for (size_t a = 0; a < 3; a++)
            image[3 * (size_t)p->corner[c] + a] += p->weight[c] * across * p->normal[a];
}

/* ---- conjugate gradients ---- */

typedef struct work {
    npg_joint_system *s;
    size_t threads;
    float by;            /* what `step` and `right` move by along `direction` and `image` */
    double *frame_sums;  /* T */
    double sums[BLOCKS]; /* of vertices */
} work;

static npg_status multiply_frames(void *user, size_t part)
{
    work *w = user;
    npg_joint_system *s = w->s;
    size_t size = 3 * s->vert_count;
    for (size_t t = part; t < s->frame_count; t += w->threads) {
        float *image = s->image + t * size;
        const float *x = s->direction + t * size;
        memset(image, 0, size * sizeof *image);
        w->frame_sums[t] = 0;
        add_shape(image, s, x);
        npg_joint_bend(image, s, s->direction, t, 1);
        add_tie(image, s, x, t);
        for (size_t i = 0; i < s->pull_counts[t]; i++) add_pull(image, &s->pulls[t * s->most + i], x);
        for (size_t i = 0; i < size; i++) w->frame_sums[t] += (double)image[i] * (double)x[i];
    }
    return NPG_OK;
}

/* The diagonal of all but the motion, which each vertex' factors hold whole. */
static void gather_diagonal(npg_joint_system *s, size_t t)
{
    float *diagonal = s->diagonal + t * s->vert_count;
    for (size_t v = 0; v < s->vert_count; v++)
        diagonal[v] = (float)s->shape * (float)(s->ring.start[v + 1] - s->ring.start[v]) +
                      s->shares[t] * s->ties[v] + 1e-6f;
    for (size_t i = 0; i < s->pull_counts[t]; i++) {
        const npg_joint_pull *p = &s->pulls[t * s->most + i];
        for (size_t c = 0; c < 3; c++) /* a third: the mean over the directions */
            diagonal[p->corner[c]] += p->strength / 3 * p->weight[c] * p->weight[c];
    }
}

static void factor_vertex(npg_joint_system *s, npg_band *band, size_t v)
{
    size_t n = s->frame_count;
    memset(band->main, 0, 3 * n * sizeof *band->main);
    npg_band_add_bend(band, (double)s->lambda[v]);
    for (size_t t = 0; t < n; t++) band->main[t] += (double)s->diagonal[t * s->vert_count + v];
    npg_band_factor(band);
    for (size_t t = 0; t < n; t++) {
        float *to = s->precond + 3 * (t * s->vert_count + v);
        to[0] = (float)band->main[t];
        to[1] = (float)band->near[t];
        to[2] = (float)band->far[t];
    }
}

static npg_status gather_diagonals(void *user, size_t part)
{
    work *w = user;
    for (size_t t = part; t < w->s->frame_count; t += w->threads) gather_diagonal(w->s, t);
    return NPG_OK;
}

static npg_status factor_vertices(void *user, size_t part)
{
    work *w = user;
    npg_joint_system *s = w->s;
    size_t n = s->frame_count;
    double *memory;
    NPG_TRY(npg_alloc_array(&memory, NPG_FOR_FIT, 3 * n, sizeof *memory));
    npg_band band = {n, memory, memory + n, memory + 2 * n};
    for (size_t v = part; v < s->vert_count; v += w->threads) factor_vertex(s, &band, v);
    npg_release(&memory);
    return NPG_OK;
}

/* line (T x 3) = the vertex' factors' inverse times its residual. */
static void precondition(double *line, const npg_joint_system *s, size_t v)
{
    size_t n = s->frame_count, row = 3 * s->vert_count;
    const float *f = s->precond + 3 * v, *r = s->right + 3 * v;
    for (size_t k = 0; k < 3; k++) {
        for (size_t t = 0; t < n; t++) {
            line[3 * t + k] = (double)r[t * row + k];
            if (t > 0) line[3 * t + k] -= (double)f[(t - 1) * row + 1] * line[3 * (t - 1) + k];
            if (t > 1) line[3 * t + k] -= (double)f[(t - 2) * row + 2] * line[3 * (t - 2) + k];
        }
        for (size_t t = n; t-- > 0;) {
            line[3 * t + k] /= (double)f[t * row];
            if (t + 1 < n) line[3 * t + k] -= (double)f[t * row + 1] * line[3 * (t + 1) + k];
            if (t + 2 < n) line[3 * t + k] -= (double)f[t * row + 2] * line[3 * (t + 2) + k];
        }
    }
}

/* Step and residual move on; image becomes the preconditioned residual. */
static npg_status move_blocks(void *user, size_t part)
{
    work *w = user;
    npg_joint_system *s = w->s;
    size_t row = 3 * s->vert_count;
    double *line;
    NPG_TRY(npg_alloc_array(&line, NPG_FOR_FIT, 3 * s->frame_count, sizeof *line));
    for (size_t block = part; block < BLOCKS; block += w->threads) {
        size_t first = block * s->vert_count / BLOCKS, last = (block + 1) * s->vert_count / BLOCKS;
        w->sums[block] = 0;
        for (size_t v = first; v < last; v++) {
            for (size_t t = 0; t < s->frame_count; t++)
                for (size_t i = t * row + 3 * v; i < t * row + 3 * v + 3; i++) {
                    s->step[i] += w->by * s->direction[i];
                    s->right[i] -= w->by * s->image[i];
                }
            precondition(line, s, v);
            for (size_t t = 0; t < s->frame_count; t++)
                for (size_t k = 0; k < 3; k++) {
                    size_t i = t * row + 3 * v + k;
                    s->image[i] = (float)line[3 * t + k];
                    w->sums[block] += (double)s->image[i] * (double)s->right[i];
                }
        }
    }
    npg_release(&line);
    return NPG_OK;
}

static double sum_of(const double *values, size_t count)
{
    double sum = 0;
    for (size_t i = 0; i < count; i++) sum += values[i];
    return sum;
}

static npg_status iterate(work *w, double tolerance, int64_t most, int64_t *taken, npg_joint_watch *watch,
                          void *user)
{
    npg_joint_system *s = w->s;
    size_t count = 3 * s->frame_count * s->vert_count;
    NPG_TRY(npg_parallel(move_blocks, w, w->threads)); /* by 0: the first preconditioned residual */
    double start = sum_of(w->sums, BLOCKS), now = start, goal = tolerance * tolerance * start, share = 0;
    for (*taken = 0; *taken < most && now > goal; ++*taken) {
        for (size_t i = 0; i < count; i++) s->direction[i] = s->image[i] + (float)share * s->direction[i];
        NPG_TRY(npg_parallel(multiply_frames, w, w->threads));
        double along = sum_of(w->frame_sums, s->frame_count), before = now;
        if (!(along > 0)) break;
        w->by = (float)(now / along);
        NPG_TRY(npg_parallel(move_blocks, w, w->threads));
        now = sum_of(w->sums, BLOCKS);
        share = now / before;
        if (watch) NPG_TRY(watch(user, *taken, most, sqrt(fmax(0, now) / start)));
    }
    return NPG_OK;
}

npg_status npg_joint_system_solve(npg_joint_system *s, double tolerance, int64_t most, int64_t *taken,
                                  npg_joint_watch *watch, void *user)
{
    work w = {.s = s, .threads = npg_parallel_parts(s->frame_count, 1, BLOCKS)};
    size_t bytes = 3 * s->frame_count * s->vert_count * sizeof(float);
    memset(s->step, 0, bytes);
    memset(s->direction, 0, bytes);
    memset(s->image, 0, bytes);
    NPG_TRY(npg_alloc_array(&w.frame_sums, NPG_FOR_FIT, s->frame_count, sizeof *w.frame_sums));
    npg_status status = npg_parallel(gather_diagonals, &w, w.threads);
    if (!status) status = npg_parallel(factor_vertices, &w, w.threads);
    if (!status) status = iterate(&w, tolerance, most, taken, watch, user);
    npg_release(&w.frame_sums);
    return status;
}
