/* Winding: normals of a cloud, all together, from the field of its winding number.
 *
 * Each point is a dipole m_j, a normal times the area it stands for.  The dipoles' winding number
 *
 *     w(p) = 1/4pi sum_j m_j . (p_j - p) / (|p_j - p|^2 + s^2)^(3/2)
 *
 * is 1 inside a closed surface that faces out, 0 outside, and 1/2 on it; its gradient there points in.  Both
 * hold for one set of dipoles: a step towards 1/2 at all points, by the adjoint of the sum and as long as fits
 * best, and the turn of each dipole against the gradient, are repeated while the width s shrinks: what is far
 * settles first.  Nothing is asked of neighbours alone, so neither noise nor a gap leaves a patch that faces in.
 *
 * Based on: S. Lin, Z. Shi, Y. Liu, Fast and Globally Consistent Normal Orientation based on the Winding Number
 * Normal Consistency, 2024. */
#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "outlier/normals.h"
#include "pipeline/memory.h"
#include "pipeline/parallel.h"

/* By trial (tests/bed/decisions.md, "Normals from nothing"); widths in the cloud's spacing, or its noise. */
#define CORE_MAX    8000 /* points that are dipoles: each step takes all their pairs */
#define STEPS       16
#define WIDTH_FIRST 1.2
#define WIDTH_LAST  0.3
#define WIDTH_NOISE 4.0 /* and no less than this many standard deviations of the noise */
#define SHARE_LEAST 256 /* points that are worth a thread */

typedef struct vectors { /* each coordinate by itself, as wide processors add */
    float *x, *y, *z;
} vectors;

typedef struct field {
    npg_arena arena;
    size_t count;
    vectors at, dipoles, step, turned; /* count each; `at` in spacings from the middle */
    float *number, *off;               /* count: w, and what it lacks to 1/2           */
    double width;
} field;

/* ---- sums over all pairs ---- */

/* w of `dipoles` at one place, times 4 pi. */
NPG_WIDE static float sum_number(const vectors *at, const vectors *dipoles, size_t count, const float p[3],
                                 float soft)
{
    const float *restrict x = at->x, *restrict y = at->y, *restrict z = at->z;
    const float *restrict mx = dipoles->x, *restrict my = dipoles->y, *restrict mz = dipoles->z;
    float sum = 0;
    for (size_t j = 0; j < count; j++) {
        float dx = x[j] - p[0], dy = y[j] - p[1], dz = z[j] - p[2], q = dx * dx + dy * dy + dz * dz + soft;
        sum += (dx * mx[j] + dy * my[j] + dz * mz[j]) / (q * sqrtf(q));
    }
    return sum;
}

/* Of what is off at all points, by the adjoint of the sum, what point p answers for, times 4 pi. */
NPG_WIDE static void sum_adjoint(float out[3], const vectors *at, const float *restrict off, size_t count,
                                 const float p[3], float soft)
{
    const float *restrict x = at->x, *restrict y = at->y, *restrict z = at->z;
    float sx = 0, sy = 0, sz = 0;
    for (size_t i = 0; i < count; i++) {
        float dx = p[0] - x[i], dy = p[1] - y[i], dz = p[2] - z[i], q = dx * dx + dy * dy + dz * dz + soft;
        float by = off[i] / (q * sqrtf(q));
        sx += by * dx;
        sy += by * dy;
        sz += by * dz;
    }
    out[0] = sx;
    out[1] = sy;
    out[2] = sz;
}

/* Against the gradient of w at p, times 4 pi. */
NPG_WIDE static void sum_outward(float out[3], const vectors *at, const vectors *dipoles, size_t count,
                                 const float p[3], float soft)
{
    const float *restrict x = at->x, *restrict y = at->y, *restrict z = at->z;
    const float *restrict mx = dipoles->x, *restrict my = dipoles->y, *restrict mz = dipoles->z;
    float sx = 0, sy = 0, sz = 0;
    for (size_t j = 0; j < count; j++) {
        float dx = x[j] - p[0], dy = y[j] - p[1], dz = z[j] - p[2];
        float inverse = 1 / (dx * dx + dy * dy + dz * dz + soft), by = inverse * sqrtf(inverse);
        float along = 3 * inverse * (dx * mx[j] + dy * my[j] + dz * mz[j]);
        sx += by * (mx[j] - along * dx);
        sy += by * (my[j] - along * dy);
        sz += by * (mz[j] - along * dz);
    }
    out[0] = sx;
    out[1] = sy;
    out[2] = sz;
}

/* ---- the same at all points, in threads ---- */

typedef struct task {
    const field *f;
    const vectors *dipoles; /* number */
    enum { NUMBER, ADJOINT, OUTWARD } what;
    const vectors *places; /* `count` of them */
    size_t count, parts;
    vectors out; /* number: x alone */
} task;

static npg_status do_share(void *user, size_t part)
{
    const task *t = user;
    const field *f = t->f;
    float soft = (float)(f->width * f->width), out[3] = {0};
    for (size_t i = part * t->count / t->parts; i < (part + 1) * t->count / t->parts; i++) {
        const float p[3] = {t->places->x[i], t->places->y[i], t->places->z[i]};
        if (t->what == NUMBER) {
            t->out.x[i] = sum_number(&f->at, t->dipoles, f->count, p, soft) / (4 * (float)M_PI);
            continue;
        }
        if (t->what == ADJOINT)
            sum_adjoint(out, &f->at, f->off, f->count, p, soft);
        else
            sum_outward(out, &f->at, &f->dipoles, f->count, p, soft);
        t->out.x[i] = out[0];
        t->out.y[i] = out[1];
        t->out.z[i] = out[2];
    }
    return NPG_OK;
}

static npg_status do_all(task t)
{
    t.parts = npg_parallel_parts(t.count, SHARE_LEAST, 0);
    return npg_parallel(do_share, &t, t.parts);
}

static npg_status find_number(field *f, const vectors *dipoles)
{
    return do_all((task){f, dipoles, NUMBER, &f->at, f->count, 0, {f->number, NULL, NULL}});
}

/* ---- steps ---- */

/* Go along f->step as far as brings w nearest to what it lacks. */
static npg_status advance(field *f)
{
    double fits = 0, squares = 0;
    NPG_TRY(find_number(f, &f->step));
    for (size_t i = 0; i < f->count; i++) {
        fits += (double)f->off[i] * (double)f->number[i];
        squares += (double)f->number[i] * (double)f->number[i];
    }
    float by = squares > 0 ? (float)(fits / squares) : 0;
    for (size_t i = 0; i < f->count; i++) {
        f->dipoles.x[i] += by * f->step.x[i];
        f->dipoles.y[i] += by * f->step.y[i];
        f->dipoles.z[i] += by * f->step.z[i];
    }
    return NPG_OK;
}

static npg_status step_to_half(field *f)
{
    NPG_TRY(find_number(f, &f->dipoles));
    for (size_t i = 0; i < f->count; i++) f->off[i] = 0.5f - f->number[i];
    NPG_TRY(do_all((task){f, NULL, ADJOINT, &f->at, f->count, 0, f->step}));
    return advance(f);
}

static float length_of(const vectors *v, size_t i)
{
    return sqrtf(v->x[i] * v->x[i] + v->y[i] * v->y[i] + v->z[i] * v->z[i]);
}

/* Each dipole against the gradient, as strong as it is. */
static npg_status turn(field *f)
{
    NPG_TRY(do_all((task){f, NULL, OUTWARD, &f->at, f->count, 0, f->turned}));
    for (size_t i = 0; i < f->count; i++) {
        float length = length_of(&f->turned, i), by = length > 0 ? length_of(&f->dipoles, i) / length : 0;
        f->dipoles.x[i] = by * f->turned.x[i];
        f->dipoles.y[i] = by * f->turned.y[i];
        f->dipoles.z[i] = by * f->turned.z[i];
    }
    return NPG_OK;
}

/* ---- a field ---- */

static void take_vectors(vectors *v, npg_arena *arena, size_t count)
{
    v->x = npg_arena_take(arena, count, sizeof *v->x);
    v->y = npg_arena_take(arena, count, sizeof *v->y);
    v->z = npg_arena_take(arena, count, sizeof *v->z);
}

static void split(vectors *v, const float *rows, size_t count, const double middle[3], double unit)
{
    float *out[3] = {v->x, v->y, v->z};
    for (size_t i = 0; i < 3 * count; i++)
        out[i % 3][i / 3] = (float)(((double)rows[i] - middle[i % 3]) / unit);
}

typedef struct frame_of { /* where lengths of a field begin, and their unit */
    double middle[3], unit;
} frame_of;

static npg_status open_field(field *f, const frame_of *frame, const float *points, const float *given,
                             size_t n)
{
    static const double from_zero[3] = {0};
    npg_arena *arena = &f->arena;
    f->count = n;
    take_vectors(&f->at, arena, n);
    take_vectors(&f->dipoles, arena, n);
    take_vectors(&f->step, arena, n);
    take_vectors(&f->turned, arena, n);
    f->number = npg_arena_take(arena, n, sizeof *f->number);
    f->off = npg_arena_take(arena, n, sizeof *f->off);
    NPG_TRY(npg_arena_status(arena));
    split(&f->at, points, n, frame->middle, frame->unit);
    if (!given) return NPG_OK;
    f->width = WIDTH_FIRST;
    split(&f->step, given, n, from_zero, 1);
    for (size_t i = 0; i < n; i++) f->off[i] = 0.5f;
    return advance(f);
}

static npg_status settle(field *f, double noise, int steps)
{
    double last = fmax(WIDTH_LAST, WIDTH_NOISE * noise), first = fmax(WIDTH_FIRST, 2 * last);
    for (int k = 0; k < steps; k++) {
        f->width = first + (last - first) * k / (steps - 1);
        NPG_TRY(step_to_half(f));
        NPG_TRY(turn(f));
    }
    return NPG_OK;
}

/* Where a place has no direction of its own it is left alone. */
static void join(float *normals, const vectors *v, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        float length = length_of(v, i);
        if (!(length > 0)) continue;
        normals[3 * i] = v->x[i] / length;
        normals[3 * i + 1] = v->y[i] / length;
        normals[3 * i + 2] = v->z[i] / length;
    }
}

/* At all points, of the field of some of them. */
static npg_status read_field(float *normals, field *f, const frame_of *frame, const float *points, size_t n)
{
    enum { BATCH = 8192 };
    vectors places, out;
    take_vectors(&places, &f->arena, BATCH);
    take_vectors(&out, &f->arena, BATCH);
    NPG_TRY(npg_arena_status(&f->arena));
    for (size_t first = 0; first < n; first += BATCH) {
        size_t count = n - first < BATCH ? n - first : BATCH;
        split(&places, points + 3 * first, count, frame->middle, frame->unit);
        NPG_TRY(do_all((task){f, NULL, OUTWARD, &places, count, 0, out}));
        join(normals + 3 * first, &out, count);
    }
    return NPG_OK;
}

static npg_status open_frame(frame_of *frame, double *noise, const float *points, size_t n)
{
    for (size_t i = 0; i < 3 * n; i++) frame->middle[i % 3] += (double)points[i] / (double)n;
    NPG_TRY(npg_cloud_spacing(&frame->unit, points, n));
    if (!(frame->unit > 0)) frame->unit = 1; /* most points at one place */
    NPG_TRY(npg_cloud_noise(noise, points, NULL, n));
    *noise /= frame->unit;
    return NPG_OK;
}

bool npg_winding_is_whole(size_t n)
{
    return n <= CORE_MAX;
}

npg_status npg_winding_normals(float *normals, const float *points, const float *given, size_t n)
{
    field f = {.arena.purpose = NPG_FOR_FRAMES};
    frame_of frame = {.middle = {0}};
    double noise;
    size_t count = n < CORE_MAX ? n : CORE_MAX;
    float *core = npg_arena_take(&f.arena, count, 3 * sizeof *core);
    float *core_given = given ? npg_arena_take(&f.arena, count, 3 * sizeof *core_given) : NULL;
    npg_status status = npg_arena_status(&f.arena);
    if (!status) npg_points_spread(core, core_given, count, points, given, n);
    if (!status) status = open_frame(&frame, &noise, core, count);
    if (!status) status = open_field(&f, &frame, core, core_given, count);
    if (!status) status = settle(&f, noise, STEPS);
    if (!status && count == n) join(normals, &f.dipoles, n);
    if (!status && count < n) status = read_field(normals, &f, &frame, points, n);
    npg_arena_release(&f.arena);
    return status;
}
