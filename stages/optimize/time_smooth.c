/* Time smooth: banded solutions, holes, leave-one-out errors, and the choice of lambda. */
#include "optimize/energy.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/limits.h"
#include "pipeline/order.h"
#include "pipeline/parallel.h"

#define LADDER       20   /* lambdas that are tried */
#define LADDER_FIRST -5.5 /* decimal logarithms     */
#define LADDER_STEP  0.5
#define FARTHER      4    /* times the mean square of the points' distances: more is motion smoothed away */
#define FEW          1600 /* points a frame that its pose was fitted to: twice as far, half of them 9 times */
#define FEWEST       10   /* times, at most */
#define FRAMES_LEAST 12   /* for that: fewer frames do not say how the motion goes */
#define FLOOR        1e-5 /* units: distances below do not matter */
#define POOL_ROUNDS  30   /* steps of averaging over neighbours: about five edges wide */

/* ---- five diagonals ---- */

void npg_band_add_bend(npg_band *b, double lambda)
{
    for (size_t t = 1; t + 1 < b->count; t++) {
        b->main[t - 1] += lambda;
        b->main[t] += 4 * lambda;
        b->main[t + 1] += lambda;
        b->near[t - 1] -= 2 * lambda;
        b->near[t] -= 2 * lambda;
        b->far[t - 1] += lambda;
    }
}

void npg_band_factor(npg_band *b)
{
    size_t n = b->count;
    for (size_t i = 0; i < n; i++) {
        double pivot = b->main[i], near = i + 1 < n ? b->near[i] : 0, far = i + 2 < n ? b->far[i] : 0;
        if (i + 1 < n) {
            b->main[i + 1] -= near * near / pivot;
            b->near[i] = near / pivot;
        }
        if (i + 2 < n) {
            b->near[i + 1] -= near * far / pivot;
            b->main[i + 2] -= far * far / pivot;
            b->far[i] = far / pivot;
        }
    }
}

void npg_band_solve(const npg_band *b, double *x, size_t stride)
{
    size_t n = b->count;
    for (size_t i = 0; i < n; i++) {
        if (i + 1 < n) x[(i + 1) * stride] -= b->near[i] * x[i * stride];
        if (i + 2 < n) x[(i + 2) * stride] -= b->far[i] * x[i * stride];
    }
    for (size_t i = n; i-- > 0;) {
        x[i * stride] /= b->main[i];
        if (i + 1 < n) x[i * stride] -= b->near[i] * x[(i + 1) * stride];
        if (i + 2 < n) x[i * stride] -= b->far[i] * x[(i + 2) * stride];
    }
}

/* ---- one lambda ---- */

static double ladder(int step)
{
    return pow(10, LADDER_FIRST + LADDER_STEP * step);
}

typedef struct smoother {
    npg_band band;
    double *memory; /* of the band and the two arrays */
    double *leave;  /* T: 1 / (1 - S_tt), 0 where a frame is not judged */
    double *line;   /* T x 3 */
} smoother;

static npg_status open_smoother(smoother *s, size_t frames)
{
    NPG_TRY(npg_alloc_array(&s->memory, NPG_FOR_FIT, 7 * frames, sizeof *s->memory));
    s->band = (npg_band){frames, s->memory, s->memory + frames, s->memory + 2 * frames};
    s->leave = s->memory + 3 * frames;
    s->line = s->memory + 4 * frames;
    return NPG_OK;
}

/* A frame that says nothing goes where the others lead it. */
static double share_of(const npg_time_frames *f, size_t t)
{
    return (double)f->shares[t] + 1e-6;
}

static void set_lambda(smoother *s, const npg_time_frames *f, double lambda)
{
    size_t n = f->frame_count;
    memset(s->memory, 0, 3 * n * sizeof *s->memory);
    for (size_t t = 0; t < n; t++) s->band.main[t] = share_of(f, t);
    npg_band_add_bend(&s->band, lambda);
    npg_band_factor(&s->band);
}

static void set_leave(smoother *s, const npg_time_frames *f)
{
    size_t n = f->frame_count;
    for (size_t t = 0; t < n; t++) {
        memset(s->line, 0, n * sizeof *s->line);
        s->line[t] = share_of(f, t);
        npg_band_solve(&s->band, s->line, 1);
        bool is_judged = !f->is_known[t] && f->shares[t] > 0;
        s->leave[t] = is_judged ? sqrt((double)f->shares[t]) / fmax(1e-6, 1 - s->line[t]) : 0;
    }
}

static void smooth_vertex(const smoother *s, const npg_time_frames *f, size_t v)
{
    for (size_t t = 0; t < f->frame_count; t++)
        for (size_t k = 0; k < 3; k++)
            s->line[3 * t + k] = share_of(f, t) * (double)f->positions[3 * (t * f->vert_count + v) + k];
    for (size_t k = 0; k < 3; k++) npg_band_solve(&s->band, s->line + k, 3);
}

/* The sum of squares of the points' distances after a way d. */
static double quadric_at(const npg_time_quadric *q, const double d[3])
{
    const float *a = q->a, *b = q->b;
    double squares = (double)a[0] * d[0] * d[0] + (double)a[3] * d[1] * d[1] + (double)a[5] * d[2] * d[2];
    double mixed = (double)a[1] * d[0] * d[1] + (double)a[2] * d[0] * d[2] + (double)a[4] * d[1] * d[2];
    double along = (double)b[0] * d[0] + (double)b[1] * d[1] + (double)b[2] * d[2];
    return fmax(0, squares + 2 * mixed - 2 * along + (double)q->c);
}

/* *error: of the predictions of left-out frames; *far: of the points, smoothed. */
static void judge_vertex(double *error, double *far, const smoother *s, const npg_time_frames *f,
                         const npg_time_quadric *quadrics, size_t v)
{
    *error = *far = 0;
    smooth_vertex(s, f, v);
    for (size_t t = 0; t < f->frame_count; t++) {
        double way[3];
        for (size_t k = 0; k < 3; k++) {
            way[k] = s->line[3 * t + k] - (double)f->positions[3 * (t * f->vert_count + v) + k];
            *error += way[k] * way[k] * s->leave[t] * s->leave[t];
        }
        *far += quadric_at(&quadrics[t * f->vert_count + v], way);
    }
}

void npg_time_quadric_add(npg_time_quadric *q, float weight, const float n[3], float r)
{
    int at = 0;
    for (int i = 0; i < 3; i++) {
        for (int k = i; k < 3; k++) q->a[at++] += weight * n[i] * n[k];
        q->b[i] += weight * r * n[i];
    }
    q->c += weight * r * r;
}

/* ---- neighbourhoods ---- */

/* values (W): each becomes the mean of itself and its neighbours, a few times. */
static void pool(double *values, double *sums, const float *degree, size_t vert_count,
                 const uint32_t (*edges)[2], size_t edge_count)
{
    for (int round = 0; round < POOL_ROUNDS; round++) {
        memcpy(sums, values, vert_count * sizeof *sums);
        for (size_t e = 0; e < edge_count; e++) {
            sums[edges[e][0]] += values[edges[e][1]];
            sums[edges[e][1]] += values[edges[e][0]];
        }
        for (size_t v = 0; v < vert_count; v++) values[v] = sums[v] / (1 + (double)degree[v]);
    }
}

/* What the points around a vertex weigh: |n|^2 = 1. */
static double weight_of(const npg_time_quadric *q)
{
    return (double)q->a[0] + (double)q->a[3] + (double)q->a[5];
}

static void count_neighbours(float *degree, const uint32_t (*edges)[2], size_t edge_count)
{
    for (size_t e = 0; e < 2 * edge_count; e++) degree[edges[e / 2][e % 2]]++;
}

/* ---- holes ---- */

/* Of the points of each frame the share around each vertex, and then as a share of what is usual there. */
static void see(double *seen, double *line, double *sums, const npg_time_frames *f,
                const npg_time_quadric *quadrics, const float *degree, const uint32_t (*edges)[2],
                size_t edge_count)
{
    size_t w = f->vert_count;
    for (size_t t = 0; t < f->frame_count; t++) {
        double *row = seen + t * w, all = 0;
        for (size_t v = 0; v < w; v++) all += row[v] = weight_of(&quadrics[t * w + v]);
        for (size_t v = 0; v < w && all > 0; v++) row[v] /= all;
        pool(row, sums, degree, w, edges, edge_count);
    }
    for (size_t v = 0; v < w; v++) {
        size_t known = 0;
        for (size_t t = 0; t < f->frame_count; t++)
            if (f->shares[t] > 0) line[known++] = seen[t * w + v];
        qsort(line, known, sizeof *line, npg_order_double);
        double usual = known ? line[known / 2] : 0;
        for (size_t t = 0; t < f->frame_count; t++)
            if (f->shares[t] > 0) seen[t * w + v] = usual > 0 ? seen[t * w + v] / usual : 1;
    }
}

/* The curve through the frames that see vertex v, which bends as little as it can, in its others between them; returns how
 * many these are. */
static size_t bridge_vertex(smoother *s, const npg_time_frames *f, const double *seen, size_t v)
{
    size_t n = f->frame_count, w = f->vert_count, first = n, last = 0, knots = 0;
    memset(s->memory, 0, 3 * n * sizeof *s->memory);
    for (size_t t = 0; t < n; t++) {
        bool is_knot = seen[t * w + v] >= NPG_MAJORITY;
        if (is_knot) s->band.main[t] = (double)f->shares[t];
        if (is_knot && !knots++) first = t;
        if (is_knot) last = t;
        for (size_t k = 0; k < 3; k++)
            s->line[3 * t + k] = s->band.main[t] * (double)f->positions[3 * (t * w + v) + k];
    }
    if (knots == n || knots < 2) return 0;
    npg_band_add_bend(&s->band, ladder(0));
    npg_band_factor(&s->band);
    for (size_t k = 0; k < 3; k++) npg_band_solve(&s->band, s->line + k, 3);
    for (size_t t = first; t < last; t++) {
        double share = fmin(1, seen[t * w + v] / NPG_MAJORITY);
        for (size_t k = 0; k < 3; k++) {
            float *x = &f->positions[3 * (t * w + v) + k];
            *x += (float)((1 - share * share) * (s->line[3 * t + k] - (double)*x));
        }
    }
    return last - first + 1 - knots;
}

npg_status npg_time_bridge(const npg_time_frames *f, double *share, const npg_time_quadric *quadrics,
                           const uint32_t (*edges)[2], size_t edge_count)
{
    size_t w = f->vert_count;
    npg_arena scratch = {.purpose = NPG_FOR_FIT};
    smoother s = {0};
    *share = 0;
    if (f->frame_count < NPG_TIME_SMOOTH_LEAST) return NPG_OK;
    double *seen = npg_arena_take(&scratch, f->frame_count * w, sizeof *seen);
    double *line = npg_arena_take(&scratch, f->frame_count, sizeof *line);
    double *sums = npg_arena_take(&scratch, w, sizeof *sums);
    float *degree = npg_arena_take(&scratch, w, sizeof *degree);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = open_smoother(&s, f->frame_count);
    if (!status) {
        count_neighbours(degree, edges, edge_count);
        see(seen, line, sums, f, quadrics, degree, edges, edge_count);
        for (size_t v = 0; v < w; v++)
            *share += (double)bridge_vertex(&s, f, seen, v) / (double)(f->frame_count * w);
    }
    npg_release(&s.memory);
    npg_arena_release(&scratch);
    return status;
}

/* ---- choosing ---- */

typedef struct choice {
    const npg_time_frames *frames;
    const npg_time_quadric *quadrics;
    const uint32_t (*edges)[2];
    size_t edge_count, threads;
    float *degree;
    double *errors, *fars; /* LADDER x W */
    double *here;          /* W: the points' squares without smoothing, and what may not matter */
} choice;

static npg_status try_steps(void *user, size_t part)
{
    const choice *c = user;
    size_t w = c->frames->vert_count;
    smoother s = {0};
    double *sums = NULL;
    npg_status status = open_smoother(&s, c->frames->frame_count);
    if (!status) status = npg_alloc_array(&sums, NPG_FOR_FIT, w, sizeof *sums);
    for (size_t step = part; step < LADDER && !status; step += c->threads) {
        double *errors = c->errors + step * w, *fars = c->fars + step * w;
        set_lambda(&s, c->frames, ladder((int)step));
        set_leave(&s, c->frames);
        for (size_t v = 0; v < w; v++) judge_vertex(&errors[v], &fars[v], &s, c->frames, c->quadrics, v);
        pool(errors, sums, c->degree, w, c->edges, c->edge_count);
        pool(fars, sums, c->degree, w, c->edges, c->edge_count);
    }
    npg_release(&s.memory);
    npg_release(&sums);
    return status;
}

/* What the points' squares come to where nothing is smoothed. */
static void sum_here(const choice *c, double *sums)
{
    const npg_time_frames *f = c->frames;
    for (size_t i = 0; i < f->frame_count * f->vert_count; i++) {
        const npg_time_quadric *q = &c->quadrics[i];
        c->here[i % f->vert_count] += (double)q->c + weight_of(q) * FLOOR * FLOOR;
    }
    pool(c->here, sums, c->degree, f->vert_count, c->edges, c->edge_count);
}

/* The best step of each vertex, as logarithm, made smooth over the surface. */
static void choose(float *lambda, const choice *c)
{
    size_t w = c->frames->vert_count;
    double *log_of = c->errors, *sums = c->errors + w; /* once all of a vertex' errors are seen */
    double farther = FARTHER;
    if (c->frames->frame_count >= FRAMES_LEAST) farther *= fmin(FEWEST, 1 + pow(FEW / c->frames->points, 3));
    for (size_t v = 0; v < w; v++) {
        int best = 0;
        for (int step = 1; step < LADDER && c->fars[(size_t)step * w + v] <= farther * c->here[v]; step++)
            if (c->errors[(size_t)step * w + v] < c->errors[(size_t)best * w + v]) best = step;
        log_of[v] = LADDER_FIRST + LADDER_STEP * best;
    }
    pool(log_of, sums, c->degree, w, c->edges, c->edge_count);
    for (size_t v = 0; v < w; v++) lambda[v] = (float)pow(10, log_of[v]);
}

npg_status npg_time_smooth_choose(float *lambda, const npg_time_frames *frames,
                                  const npg_time_quadric *quadrics, const uint32_t (*edges)[2],
                                  size_t edge_count)
{
    size_t w = frames->vert_count;
    npg_arena scratch = {.purpose = NPG_FOR_FIT};
    choice c = {.frames = frames, .quadrics = quadrics, .edges = edges, .edge_count = edge_count};
    memset(lambda, 0, w * sizeof *lambda);
    if (frames->frame_count < NPG_TIME_SMOOTH_LEAST) return NPG_OK;
    c.threads = npg_parallel_parts(LADDER, 1, 0);
    c.errors = npg_arena_take(&scratch, LADDER * w, sizeof *c.errors);
    c.fars = npg_arena_take(&scratch, LADDER * w, sizeof *c.fars);
    c.here = npg_arena_take(&scratch, w, sizeof *c.here);
    c.degree = npg_arena_take(&scratch, w, sizeof *c.degree);
    npg_status status = npg_arena_status(&scratch);
    if (!status) count_neighbours(c.degree, edges, edge_count);
    if (!status) sum_here(&c, c.errors);
    if (!status) status = npg_parallel(try_steps, &c, c.threads);
    if (!status) choose(lambda, &c);
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_time_smooth_apply(const npg_time_frames *f, const float *lambda)
{
    smoother s;
    if (f->frame_count < NPG_TIME_SMOOTH_LEAST) return NPG_OK;
    NPG_TRY(open_smoother(&s, f->frame_count));
    for (size_t v = 0; v < f->vert_count; v++) {
        set_lambda(&s, f, (double)lambda[v]);
        smooth_vertex(&s, f, v);
        for (size_t t = 0; t < f->frame_count; t++) {
            for (size_t k = 0; k < 3; k++)
                f->positions[3 * (t * f->vert_count + v) + k] = (float)s.line[3 * t + k];
        }
    }
    npg_release(&s.memory);
    return NPG_OK;
}
