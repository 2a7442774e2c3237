#include "outlier/winding_sums.h"

#include <math.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "pipeline/parallel.h"

#define MOMENT_TERMS 9 /* of Q, 3 x 3 */

/* Sources of a sum: points, or groups of them, whose moments are q[3 r + c] = sum m_r (p - middle)_c. */
typedef struct sources {
    size_t count;
    npg_vectors at, dipoles;
    float *moments[MOMENT_TERMS]; /* of groups */
} sources;

/* ---- at one place, of points ---- */

NPG_WIDE static float number(const sources *s, const float p[3], float soft)
{
    const float *restrict x = s->at.x, *restrict y = s->at.y, *restrict z = s->at.z;
    const float *restrict mx = s->dipoles.x, *restrict my = s->dipoles.y, *restrict mz = s->dipoles.z;
    float sum = 0;
    for (size_t j = 0; j < s->count; j++) {
        float dx = x[j] - p[0], dy = y[j] - p[1], dz = z[j] - p[2], q = dx * dx + dy * dy + dz * dz + soft;
        sum += (dx * mx[j] + dy * my[j] + dz * mz[j]) / (q * sqrtf(q));
    }
    return sum;
}

NPG_WIDE static void adjoint(float out[3], const sources *s, const float p[3], float soft)
{
    const float *restrict x = s->at.x, *restrict y = s->at.y, *restrict z = s->at.z;
    const float *restrict weight = s->dipoles.x;
    float sx = 0, sy = 0, sz = 0;
    for (size_t j = 0; j < s->count; j++) {
        float dx = p[0] - x[j], dy = p[1] - y[j], dz = p[2] - z[j], q = dx * dx + dy * dy + dz * dz + soft;
        float by = weight[j] / (q * sqrtf(q));
        sx += by * dx;
        sy += by * dy;
        sz += by * dz;
    }
    out[0] += sx;
    out[1] += sy;
    out[2] += sz;
}

NPG_WIDE static void outward(float out[3], const sources *s, const float p[3], float soft)
{
    const float *restrict x = s->at.x, *restrict y = s->at.y, *restrict z = s->at.z;
    const float *restrict mx = s->dipoles.x, *restrict my = s->dipoles.y, *restrict mz = s->dipoles.z;
    float sx = 0, sy = 0, sz = 0;
    for (size_t j = 0; j < s->count; j++) {
        float dx = x[j] - p[0], dy = y[j] - p[1], dz = z[j] - p[2];
        float inverse = 1 / (dx * dx + dy * dy + dz * dz + soft), by = inverse * sqrtf(inverse);
        float along = 3 * inverse * (dx * mx[j] + dy * my[j] + dz * mz[j]);
        sx += by * (mx[j] - along * dx);
        sy += by * (my[j] - along * dy);
        sz += by * (mz[j] - along * dz);
    }
    out[0] += sx;
    out[1] += sy;
    out[2] += sz;
}

/* ---- at one place, of groups that are far off ---- */

NPG_WIDE static float far_number(const sources *s, const float p[3], float soft)
{
    const float *restrict x = s->at.x, *restrict y = s->at.y, *restrict z = s->at.z;
    const float *restrict mx = s->dipoles.x, *restrict my = s->dipoles.y, *restrict mz = s->dipoles.z;
    float *const *m = s->moments;
    float sum = 0;
    for (size_t j = 0; j < s->count; j++) {
        float dx = x[j] - p[0], dy = y[j] - p[1], dz = z[j] - p[2], q = dx * dx + dy * dy + dz * dz + soft;
        float qx = m[0][j] * dx + m[1][j] * dy + m[2][j] * dz,
              qy = m[3][j] * dx + m[4][j] * dy + m[5][j] * dz,
              qz = m[6][j] * dx + m[7][j] * dy + m[8][j] * dz;
        float level = dx * mx[j] + dy * my[j] + dz * mz[j] + m[0][j] + m[4][j] + m[8][j];
        sum += (level - 3 * (dx * qx + dy * qy + dz * qz) / q) / (q * sqrtf(q));
    }
    return sum;
}

NPG_WIDE static void far_adjoint(float out[3], const sources *s, const float p[3], float soft)
{
    const float *restrict x = s->at.x, *restrict y = s->at.y, *restrict z = s->at.z;
    const float *restrict weight = s->dipoles.x, *restrict vx = s->moments[0], *restrict vy = s->moments[1],
                          *restrict vz = s->moments[2];
    float sx = 0, sy = 0, sz = 0;
    for (size_t j = 0; j < s->count; j++) {
        float dx = x[j] - p[0], dy = y[j] - p[1], dz = z[j] - p[2], q = dx * dx + dy * dy + dz * dz + soft;
        float by = 1 / (q * sqrtf(q)), along = 3 * (dx * vx[j] + dy * vy[j] + dz * vz[j]) / q - weight[j];
        sx += by * (along * dx - vx[j]);
        sy += by * (along * dy - vy[j]);
        sz += by * (along * dz - vz[j]);
    }
    out[0] += sx;
    out[1] += sy;
    out[2] += sz;
}

NPG_WIDE static void far_outward(float out[3], const sources *s, const float p[3], float soft)
{
    const float *restrict x = s->at.x, *restrict y = s->at.y, *restrict z = s->at.z;
    const float *restrict mx = s->dipoles.x, *restrict my = s->dipoles.y, *restrict mz = s->dipoles.z;
    float *const *m = s->moments;
    float sx = 0, sy = 0, sz = 0;
    for (size_t j = 0; j < s->count; j++) {
        float dx = x[j] - p[0], dy = y[j] - p[1], dz = z[j] - p[2];
        float inverse = 1 / (dx * dx + dy * dy + dz * dz + soft), by = inverse * sqrtf(inverse);
        float qx = m[0][j] * dx + m[1][j] * dy + m[2][j] * dz,
              qy = m[3][j] * dx + m[4][j] * dy + m[5][j] * dz,
              qz = m[6][j] * dx + m[7][j] * dy + m[8][j] * dz;
        float tx = m[0][j] * dx + m[3][j] * dy + m[6][j] * dz,
              ty = m[1][j] * dx + m[4][j] * dy + m[7][j] * dz,
              tz = m[2][j] * dx + m[5][j] * dy + m[8][j] * dz;
        float level = dx * mx[j] + dy * my[j] + dz * mz[j] + m[0][j] + m[4][j] + m[8][j];
        float along = 3 * inverse * (level - 5 * inverse * (dx * qx + dy * qy + dz * qz));
        sx += by * (mx[j] - 3 * inverse * (qx + tx) - along * dx);
        sy += by * (my[j] - 3 * inverse * (qy + ty) - along * dy);
        sz += by * (mz[j] - 3 * inverse * (qz + tz) - along * dz);
    }
    out[0] += sx;
    out[1] += sy;
    out[2] += sz;
}

/* ---- places ---- */

void npg_vectors_take(npg_vectors *v, npg_arena *arena, size_t count)
{
    v->x = npg_arena_take(arena, count, sizeof *v->x);
    v->y = npg_arena_take(arena, count, sizeof *v->y);
    v->z = npg_arena_take(arena, count, sizeof *v->z);
}

static void set(const npg_vectors *to, size_t i, const npg_vectors *from, size_t j)
{
    to->x[i] = from->x[j];
    to->y[i] = from->y[j];
    to->z[i] = from->z[j];
}

static void measure(npg_places *g)
{
    for (size_t k = 0; k < g->group_count; k++) {
        uint32_t first = g->first[k], end = g->first[k + 1];
        float x = 0, y = 0, z = 0, n = (float)(end - first), radius_sq = 0;
        for (uint32_t i = first; i < end; i++) {
            x += g->at.x[i];
            y += g->at.y[i];
            z += g->at.z[i];
        }
        g->middle.x[k] = x /= n;
        g->middle.y[k] = y /= n;
        g->middle.z[k] = z /= n;
        for (uint32_t i = first; i < end; i++) {
            float dx = g->at.x[i] - x, dy = g->at.y[i] - y, dz = g->at.z[i] - z;
            radius_sq = fmaxf(radius_sq, dx * dx + dy * dy + dz * dz);
        }
        g->radius[k] = sqrtf(radius_sq);
    }
}

npg_status npg_places_open(npg_places *g, npg_arena *arena, const float *points, size_t count,
                           const npg_winding_frame *frame)
{
    size_t most = count / (NPG_KDTREE_GROUP / 2) + 1;
    npg_kdtree *tree;
    *g = (npg_places){.count = count};
    npg_vectors_take(&g->at, arena, count);
    g->order = npg_arena_take(arena, count, sizeof *g->order);
    g->first = npg_arena_take(arena, most + 1, sizeof *g->first);
    npg_vectors_take(&g->middle, arena, most);
    g->radius = npg_arena_take(arena, most, sizeof *g->radius);
    NPG_TRY(npg_arena_status(arena));
    NPG_TRY(npg_kdtree_open(&tree, points, count));
    g->group_count = npg_kdtree_groups(tree, g->order, g->first);
    npg_kdtree_close(&tree);
    float *at[3] = {g->at.x, g->at.y, g->at.z};
    for (size_t i = 0; i < count; i++)
        for (size_t a = 0; a < 3; a++) {
            double x = (double)points[3 * (size_t)g->order[i] + a];
            at[a][i] = (float)((x - frame->middle[a]) / frame->unit);
        }
    measure(g);
    return NPG_OK;
}

void npg_places_sort(npg_vectors *out, const npg_places *places, const float *rows)
{
    for (size_t i = 0; i < places->count; i++) {
        const float *row = rows + 3 * (size_t)places->order[i];
        out->x[i] = row[0];
        out->y[i] = row[1];
        out->z[i] = row[2];
    }
}

/* ---- at all places, in threads ---- */

static npg_status take_sources(sources *s, npg_arena *arena, size_t count, size_t moments)
{
    s->count = 0;
    npg_vectors_take(&s->at, arena, count);
    npg_vectors_take(&s->dipoles, arena, count);
    for (size_t m = 0; m < moments; m++) s->moments[m] = npg_arena_take(arena, count, sizeof *s->moments[m]);
    return npg_arena_status(arena);
}

typedef struct task {
    npg_vectors *out;
    npg_winding_what what;
    const npg_places *to, *from;
    const npg_vectors *dipoles;
    float width;
    sources groups; /* all of `from` */
    size_t parts;
} task;

static void sum_groups(sources *s, const npg_places *g, const npg_vectors *dipoles)
{
    s->count = g->group_count;
    for (size_t k = 0; k < s->count; k++) {
        float sum[3] = {0}, moments[MOMENT_TERMS] = {0};
        for (uint32_t i = g->first[k]; i < g->first[k + 1]; i++) {
            const float m[3] = {dipoles->x[i], dipoles->y[i], dipoles->z[i]},
                        at[3] = {g->at.x[i] - g->middle.x[k], g->at.y[i] - g->middle.y[k],
                                 g->at.z[i] - g->middle.z[k]};
            for (size_t a = 0; a < 3; a++) sum[a] += m[a];
            for (size_t a = 0; a < MOMENT_TERMS; a++) moments[a] += m[a / 3] * at[a % 3];
        }
        set(&s->at, k, &g->middle, k);
        set(&s->dipoles, k, &(npg_vectors){sum, sum + 1, sum + 2}, 0);
        for (size_t a = 0; a < MOMENT_TERMS; a++) s->moments[a][k] = moments[a];
    }
}

/* What a group of places sees: points that are near, and groups that are far. */
static void look(sources *near, sources *far, const task *t, size_t group)
{
    const npg_places *g = t->from;
    const npg_vectors *c = &t->to->middle;
    near->count = far->count = 0;
    for (size_t k = 0; k < g->group_count; k++) {
        float x = g->middle.x[k] - c->x[group], y = g->middle.y[k] - c->y[group],
              z = g->middle.z[k] - c->z[group], away = sqrtf(x * x + y * y + z * z) - t->to->radius[group];
        if (away > (float)NPG_CLEARLY * fmaxf(g->radius[k], t->width)) {
            set(&far->at, far->count, &t->groups.at, k);
            set(&far->dipoles, far->count, &t->groups.dipoles, k);
            for (size_t a = 0; a < MOMENT_TERMS; a++) far->moments[a][far->count] = t->groups.moments[a][k];
            far->count++;
            continue;
        }
        for (uint32_t i = g->first[k]; i < g->first[k + 1]; i++, near->count++) {
            set(&near->at, near->count, &g->at, i);
            set(&near->dipoles, near->count, t->dipoles, i);
        }
    }
}

static void sum_at(const task *t, const sources *near, const sources *far, size_t i)
{
    float out[3] = {0}, soft = t->width * t->width;
    const float p[3] = {t->to->at.x[i], t->to->at.y[i], t->to->at.z[i]};
    if (t->what == NPG_WINDING_NUMBER) {
        t->out->x[i] = number(near, p, soft) + far_number(far, p, soft);
        return;
    }
    if (t->what == NPG_WINDING_ADJOINT) {
        adjoint(out, near, p, soft);
        far_adjoint(out, far, p, soft);
    } else {
        outward(out, near, p, soft);
        far_outward(out, far, p, soft);
    }
    set(t->out, i, &(npg_vectors){out, out + 1, out + 2}, 0);
}

static npg_status do_share(void *user, size_t part)
{
    const task *t = user;
    const npg_places *to = t->to;
    npg_arena arena = {.purpose = NPG_FOR_FRAMES};
    sources near, far;
    npg_status status = take_sources(&near, &arena, t->from->count, 0);
    if (!status) status = take_sources(&far, &arena, t->from->group_count, MOMENT_TERMS);
    size_t first = part * to->group_count / t->parts, end = (part + 1) * to->group_count / t->parts;
    for (size_t k = first; k < end && !status; k++) {
        look(&near, &far, t, k);
        for (uint32_t i = to->first[k]; i < to->first[k + 1]; i++) sum_at(t, &near, &far, i);
    }
    npg_arena_release(&arena);
    return status;
}

npg_status npg_winding_sum(npg_vectors *out, npg_winding_what what, const npg_places *to,
                           const npg_places *from, const npg_vectors *dipoles, double width)
{
    npg_arena arena = {.purpose = NPG_FOR_FRAMES};
    task t = {.out = out, .what = what, .to = to, .from = from, .dipoles = dipoles, .width = (float)width};
    npg_status status = take_sources(&t.groups, &arena, from->group_count, MOMENT_TERMS);
    if (!status) {
        sum_groups(&t.groups, from, dipoles);
        t.parts = npg_parallel_parts(to->group_count, 1, 0);
        status = npg_parallel(do_share, &t, t.parts);
    }
    npg_arena_release(&arena);
    return status;
}
