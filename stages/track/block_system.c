/* Block system: 6 x 6 blocks, conjugate gradients preconditioned by the blocks on the diagonal.
 *
 * Gathered in double, one triangle.  Solved in single: what a step needs is a direction, and half the bytes
 * are half the time.  For that both triangles are laid out row by row, each block by columns of eight lanes
 * (two of them zero), and so are the vectors. */
#include "track/track_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/parallel.h"

#define LANES 8           /* of a column */
#define CELL  (6 * LANES) /* floats of a block */

/* What one thread gathers. */
typedef struct part {
    double *diagonal; /* n x 36 */
    double *off;      /* pair_count x 36, block (a, b) */
    double *right;    /* n x 6 */
} part;

struct npg_block_system {
    npg_arena arena; /* of all arrays */
    size_t n, pair_count;
    uint32_t (*pairs)[2]; /* sorted                               */
    uint32_t *first;      /* n + 1: pairs[first[a]] .. have a = a */
    part parts[NPG_BLOCK_PARTS];
    /* of the solution */
    uint32_t *row_first;       /* n + 1: entries[row_first[a]] .. are row a's, without the diagonal */
    uint32_t *other;           /* per entry: the column's node                                      */
    uint32_t *place;           /* per pair: its two entries                                         */
    float *diagonal, *inverse; /* n x CELL                                                          */
    float *cells;              /* 2 pair_count x CELL                                               */
    float *work;               /* 5 x n x LANES                                                     */
};

void npg_block_close(npg_block_system **slot)
{
    npg_object_close(slot);
}

static npg_status open_arrays(npg_block_system *s)
{
    npg_arena *arena = &s->arena;
    size_t n = s->n, pairs = s->pair_count;
    for (size_t i = 0; i < NPG_BLOCK_PARTS; i++) {
        s->parts[i].diagonal = npg_arena_take(arena, n, 36 * sizeof(double));
        s->parts[i].off = npg_arena_take(arena, pairs, 36 * sizeof(double));
        s->parts[i].right = npg_arena_take(arena, n, 6 * sizeof(double));
    }
    s->pairs = npg_arena_take(arena, pairs, sizeof *s->pairs);
    s->first = npg_arena_take(arena, n + 2, sizeof *s->first);
    s->row_first = npg_arena_take(arena, n + 2, sizeof *s->row_first);
    s->other = npg_arena_take(arena, 2 * pairs, sizeof *s->other);
    s->place = npg_arena_take(arena, 2 * pairs, sizeof *s->place);
    s->cells = npg_arena_take(arena, 2 * pairs, CELL * sizeof(float));
    s->diagonal = npg_arena_take(arena, n, CELL * sizeof(float));
    s->inverse = npg_arena_take(arena, n, CELL * sizeof(float));
    s->work = npg_arena_take(arena, 5 * n, LANES * sizeof(float));
    return npg_arena_status(arena);
}

/* Where each pair's two blocks lie among the rows. */
static void lay_out_rows(npg_block_system *s)
{
    uint32_t *end = s->row_first + 1; /* row a's end while it is filled, its begin being row_first[a] */
    for (size_t e = 0; e < s->pair_count; e++)
        for (int side = 0; side < 2; side++) end[s->pairs[e][side] + 1]++;
    for (size_t a = 0; a < s->n; a++) end[a + 1] += end[a];
    for (size_t e = 0; e < s->pair_count; e++)
        for (int side = 0; side < 2; side++) {
            uint32_t at = end[s->pairs[e][side]]++;
            s->other[at] = s->pairs[e][1 - side];
            s->place[2 * e + (size_t)side] = at;
        }
}

static void fill_rows(npg_block_system *s, const uint32_t (*pairs)[2])
{
    memcpy(s->pairs, pairs, s->pair_count * sizeof *pairs);
    for (size_t e = 0; e < s->pair_count; e++) s->first[pairs[e][0] + 1]++;
    for (size_t a = 0; a < s->n; a++) s->first[a + 1] += s->first[a];
    lay_out_rows(s);
}

npg_status npg_block_open(npg_block_system **out, size_t n, const uint32_t (*pairs)[2], size_t pair_count)
{
    *out = NULL;
    NPG_TRY(npg_object_open(out, NPG_FOR_FIT, sizeof **out));
    npg_block_system *s = *out;
    s->n = n;
    s->pair_count = pair_count;
    npg_status status = open_arrays(s);
    if (!status) fill_rows(s, pairs);
    if (status) npg_block_close(out);
    return status;
}

/* ---- gathering ---- */

void npg_block_clear(npg_block_system *s, size_t which)
{
    part *p = &s->parts[which];
    memset(p->diagonal, 0, s->n * 36 * sizeof(double));
    memset(p->off, 0, s->pair_count * 36 * sizeof(double));
    memset(p->right, 0, s->n * 6 * sizeof(double));
}

/* The number of the pair (a, b), a < b; pair_count when it is not in the set.  Of the dozen that have this a
 * all are counted: a branch that goes either way costs more. */
static size_t pair_of(const npg_block_system *s, uint32_t a, uint32_t b)
{
    uint32_t at = s->first[a], end = s->first[a + 1];
    for (uint32_t e = s->first[a]; e < end; e++) at += s->pairs[e][1] < b;
    return at < end && s->pairs[at][1] == b ? at : s->pair_count;
}

/* A coupling of two of a term's nodes. */
typedef struct coupling {
    double *block, share;
    size_t a, b;
} coupling;

typedef double four __attribute__((vector_size(4 * sizeof(double)), aligned(sizeof(double))));

/* Each block += scale share u_a u_b^T; two of its rows are three vectors. */
NPG_WIDE static void add_outers(coupling *list, size_t count, double scale, double (*u)[6])
{
    for (size_t n = 0; n < count; n++) {
        const double *v = u[list[n].b], factor = scale * list[n].share;
        const four begin = {v[0], v[1], v[2], v[3]}, middle = {v[4], v[5], v[0], v[1]},
                   end = {v[2], v[3], v[4], v[5]};
        for (int i = 0; i < 6; i += 2) {
            double x = factor * u[list[n].a][i], y = factor * u[list[n].a][i + 1];
            four *rows = (four *)(list[n].block + 6 * i);
            rows[0] += (four){x, x, x, x} * begin;
            rows[1] += (four){x, x, y, y} * middle;
            rows[2] += (four){y, y, y, y} * end;
        }
    }
}

/* block += scale K(a)^T K(b), K(y) = (-[y]x, I): a turn moves by turn x arm.  In blocks of 3 x 3:
 *
 *     a.b I - b a^T    [a]x
 *     -[b]x            I
 */
static void add_arms(double *block, double scale, const double a[3], const double b[3])
{
    double along = npg_vec3_dot(a, b);
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        for (int c = 0; c < 3; c++) block[6 * i + c] -= scale * b[i] * a[c];
        block[6 * i + i] += scale * along;
        block[6 * i + 3 + j] -= scale * a[k];
        block[6 * i + 3 + k] += scale * a[j];
        block[6 * (3 + i) + j] += scale * b[k];
        block[6 * (3 + i) + k] -= scale * b[j];
        block[6 * (3 + i) + 3 + i] += scale;
    }
}

/* Of each block once; pairs that are not in the set are left out. */
static size_t list_couplings(coupling *list, const npg_block_system *s, const part *p,
                             const npg_block_term *t)
{
    size_t count = 0;
    for (size_t a = 0; a < t->count; a++)
        for (size_t b = 0; b < t->count; b++) {
            if (t->nodes[a] > t->nodes[b]) continue;
            size_t pair = a == b ? 0 : pair_of(s, t->nodes[a], t->nodes[b]);
            if (pair == s->pair_count && a != b) continue;
            double *block = a == b ? p->diagonal + 36 * (size_t)t->nodes[a] : p->off + 36 * pair;
            list[count++] = (coupling){block, t->shares[a] * t->shares[b], a, b};
        }
    return count;
}

void npg_block_add(npg_block_system *s, size_t which, const npg_block_term *t)
{
    part *p = &s->parts[which];
    double lever[NPG_BLOCK_NODES][6], pull[3], level = 0;
    for (int c = 0; c < 3; c++) level += t->normal[c] * t->right[c];
    for (int c = 0; c < 3; c++) pull[c] = t->across * level * t->normal[c] + t->along * t->right[c];
    for (size_t k = 0; k < t->count; k++) {
        double turned[3], *right = p->right + 6 * (size_t)t->nodes[k];
        npg_vec3_cross(turned, t->arms[k], pull);
        npg_vec3_cross(lever[k], t->arms[k], t->normal);
        memcpy(lever[k] + 3, t->normal, sizeof t->normal);
        for (int c = 0; c < 3; c++) {
            right[c] += t->shares[k] * turned[c];
            right[3 + c] += t->shares[k] * pull[c];
        }
    }
    coupling list[NPG_BLOCK_NODES * NPG_BLOCK_NODES];
    size_t count = list_couplings(list, s, p, t);
    if (t->across != 0) add_outers(list, count, t->across, lever);
    for (size_t n = 0; n < count && t->along != 0; n++)
        add_arms(list[n].block, t->along * list[n].share, t->arms[list[n].a], t->arms[list[n].b]);
}

/* ---- solving ---- */

static void set_cell(float *cell, const double *block, bool transposed)
{
    for (int j = 0; j < 6; j++)
        for (int i = 0; i < 6; i++) cell[LANES * j + i] = (float)block[transposed ? 6 * j + i : 6 * i + j];
}

static void invert(double *inverse, const double *a)
{
    double l[36];
    memcpy(l, a, sizeof l);
    npg_cholesky_factor(l, 6, 1e-12);
    for (int row = 0; row < 6; row++) {
        double *x = inverse + 6 * row; /* symmetric: a row is a column */
        for (int i = 0; i < 6; i++) x[i] = i == row;
        npg_cholesky_solve(l, 6, x);
    }
}

/* The sum of the parts' blocks at the same place. */
static void add_parts(double sum[36], const double *a, const double *b)
{
    for (int i = 0; i < 36; i++) sum[i] = a[i] + b[i];
}

static void lay_out(npg_block_system *s, double damping)
{
    const part *p = s->parts;
    double sum[36], inverse[36];
    for (size_t k = 0; k < s->n; k++) {
        add_parts(sum, p[0].diagonal + 36 * k, p[1].diagonal + 36 * k);
        for (int i = 0; i < 6; i++) sum[7 * i] += damping;
        invert(inverse, sum);
        set_cell(s->diagonal + CELL * k, sum, false);
        set_cell(s->inverse + CELL * k, inverse, false);
    }
    for (size_t e = 0; e < s->pair_count; e++) {
        add_parts(sum, p[0].off + 36 * e, p[1].off + 36 * e);
        set_cell(s->cells + CELL * (size_t)s->place[2 * e], sum, false);
        set_cell(s->cells + CELL * (size_t)s->place[2 * e + 1], sum, true);
    }
}

typedef float lanes __attribute__((vector_size(LANES * sizeof(float))));

/* Two sums, so that an addition need not wait for the one before. */
static inline void add_cell(lanes sum[2], const float *cell, const float *x)
{
    const lanes *column = (const lanes *)cell;
    for (int j = 0; j < 6; j += 2) {
        sum[0] += column[j] * x[j];
        sum[1] += column[j + 1] * x[j + 1];
    }
}

/* y = the whole matrix x. */
NPG_WIDE static void multiply(const npg_block_system *s, float *restrict y, const float *restrict x)
{
    for (size_t a = 0; a < s->n; a++) {
        lanes sum[2] = {{0}, {0}};
        add_cell(sum, s->diagonal + CELL * a, x + LANES * a);
        for (uint32_t e = s->row_first[a]; e < s->row_first[a + 1]; e++)
            add_cell(sum, s->cells + CELL * (size_t)e, x + LANES * (size_t)s->other[e]);
        *(lanes *)(y + LANES * a) = sum[0] + sum[1];
    }
}

/* z = the inverted diagonal r. */
NPG_WIDE static void precondition(const npg_block_system *s, float *restrict z, const float *restrict r)
{
    for (size_t a = 0; a < s->n; a++) {
        lanes sum[2] = {{0}, {0}};
        add_cell(sum, s->inverse + CELL * a, r + LANES * a);
        *(lanes *)(z + LANES * a) = sum[0] + sum[1];
    }
}

static double dot(const float *a, const float *b, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i += LANES) {
        float some = 0;
        for (size_t k = 0; k < LANES; k++) some += a[i + k] * b[i + k];
        sum += (double)some;
    }
    return sum;
}

static void set_right(const npg_block_system *s, float *r)
{
    const part *p = s->parts;
    for (size_t k = 0; k < s->n; k++)
        for (size_t i = 0; i < 6; i++)
            r[LANES * k + i] = (float)(p[0].right[6 * k + i] + p[1].right[6 * k + i]);
}

int npg_block_solve(npg_block_system *s, double *out, double damping, double tolerance, int iterations)
{
    size_t n = LANES * s->n;
    float *x = s->work, *r = x + n, *z = r + n, *p = z + n, *q = p + n;
    lay_out(s, damping);
    memset(s->work, 0, 5 * n * sizeof *x);
    set_right(s, r);
    double stop = tolerance * tolerance * dot(r, r, n);
    precondition(s, z, r);
    memcpy(p, z, n * sizeof *p);
    double rz = dot(r, z, n);
    int step = 0;
    for (; step < iterations && dot(r, r, n) > stop; step++) {
        multiply(s, q, p);
        double curvature = dot(p, q, n);
        if (!(curvature > 0)) break; /* nothing more to gain in single precision */
        float alpha = (float)(rz / curvature);
        for (size_t i = 0; i < n; i++) {
            x[i] += alpha * p[i];
            r[i] -= alpha * q[i];
        }
        precondition(s, z, r);
        double next = dot(r, z, n);
        float beta = (float)(next / rz);
        for (size_t i = 0; i < n; i++) p[i] = z[i] + beta * p[i];
        rz = next;
    }
    for (size_t i = 0; i < 6 * s->n; i++) out[i] = (double)x[i / 6 * LANES + i % 6];
    return step;
}
