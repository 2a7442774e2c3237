/* Block system: 6 x 6 blocks, conjugate gradients preconditioned by the blocks on the diagonal.
 *
 * Gathered in double, one triangle.  Solved in single: what a step needs is a direction, and half the bytes
 * are half the time.  For that both triangles are laid out row by row, each block by columns of eight lanes
 * (two of them zero), and so are the vectors. */
#include "track/track_internal.h"

#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/parallel.h"

#define LANES       8           /* of a column */
#define CELL        (6 * LANES) /* floats of a block */
#define GRAIN       64          /* nodes whose rows are gathered, or multiplied, at a time */
#define TERMS_AHEAD 4           /* what a term takes to come from memory, in terms */

/* What terms say of a pair of nodes (a, b), or of a node with itself.  With m(arm) = (arm x normal, normal) the part
 * across is a sum of outer products of six numbers.  That along, of K(arm) = (-[arm]x, I), is linear in the products
 * of (arm, 1): sixteen sums are all of it. */
typedef struct block {
    double across[36];  /* sum across share_a share_b m(arm_a) m(arm_b)^T        */
    double along[4][4]; /* sum along share_a share_b (arm_a, 1) (arm_b, 1)^T */
} block;

struct npg_block_system {
    npg_arena arena; /* of all arrays */
    size_t n, pair_count;
    uint32_t (*pairs)[2]; /* sorted                               */
    uint32_t *first;      /* n + 1: pairs[first[a]] .. have a = a */
    size_t term_most;
    block *sum;           /* n: those on the diagonal       */
    block *off;           /* pair_count                     */
    double *right;        /* n x 6                          */
    uint32_t *pair_of;    /* of each grain, n: the number of the pair of the row at work with a node */
    uint32_t *term_first; /* n + 2: uses[term_first[a]] .. are node a's */
    uint32_t *uses;       /* NPG_BLOCK_NODES a term: its number times NPG_BLOCK_NODES + which of its nodes */
    const npg_block_term *terms; /* that are gathered; a loan */
    /* of the solution */
    double damping;
    uint32_t *row_first;       /* n + 1: entries[row_first[a]] .. are row a's, without the diagonal */
    uint32_t *other;           /* per entry: the column's node                                      */
    uint32_t *place;           /* per pair: its two entries                                         */
    float *diagonal, *inverse; /* n x CELL                                                          */
    float *cells;              /* 2 pair_count x CELL                                               */
    float *work;               /* 5 x n x LANES                                                     */
};

static size_t grains(const npg_block_system *s)
{
    return (s->n + GRAIN - 1) / GRAIN;
}

static size_t grain_end(const npg_block_system *s, size_t part)
{
    return (part + 1) * GRAIN < s->n ? (part + 1) * GRAIN : s->n;
}

void npg_block_close(npg_block_system **slot)
{
    npg_object_close(slot);
}

static npg_status open_arrays(npg_block_system *s)
{
    npg_arena *arena = &s->arena;
    size_t n = s->n, pairs = s->pair_count;
    s->sum = npg_arena_take(arena, n, sizeof *s->sum);
    s->off = npg_arena_take(arena, pairs, sizeof *s->off);
    s->pair_of = npg_arena_take(arena, grains(s) * n, sizeof *s->pair_of);
    s->right = npg_arena_take(arena, n, 6 * sizeof(double));
    s->term_first = npg_arena_take(arena, n + 2, sizeof *s->term_first);
    s->uses = npg_arena_take(arena, s->term_most + TERMS_AHEAD, NPG_BLOCK_NODES * sizeof *s->uses);
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

npg_status npg_block_open(npg_block_system **out, size_t n, const uint32_t (*pairs)[2], size_t pair_count,
                          size_t term_most)
{
    *out = NULL;
    NPG_TRY(npg_object_open(out, NPG_FOR_FIT, sizeof **out));
    npg_block_system *s = *out;
    s->n = n;
    s->pair_count = pair_count;
    s->term_most = term_most;
    npg_status status = open_arrays(s);
    if (!status) fill_rows(s, pairs);
    if (status) npg_block_close(out);
    return status;
}

/* ---- gathering ---- */

/* Inlined into what is built for several widths of processor. */
#define INSIDE static inline __attribute__((always_inline))

/* Which terms each node has, in their order. */
static void list_uses(npg_block_system *s, const npg_block_term *terms, size_t count)
{
    uint32_t *end = s->term_first + 1; /* node a's end while it is filled, its begin being term_first[a] */
    memset(s->term_first, 0, (s->n + 2) * sizeof *s->term_first);
    for (size_t t = 0; t < count; t++)
        for (size_t k = 0; k < terms[t].count; k++) end[terms[t].nodes[k] + 1]++;
    for (size_t a = 0; a < s->n; a++) end[a + 1] += end[a];
    for (size_t t = 0; t < count; t++)
        for (size_t k = 0; k < terms[t].count; k++)
            s->uses[end[terms[t].nodes[k]]++] = (uint32_t)(t * NPG_BLOCK_NODES + k);
}

typedef double four __attribute__((vector_size(4 * sizeof(double)), aligned(sizeof(double))));

/* m(arm), times what it counts. */
INSIDE void set_lever(double lever[6], const npg_block_term *t, size_t k, double weight)
{
    npg_vec3_cross(lever, t->arms[k], t->normal);
    for (int c = 0; c < 3; c++) {
        lever[c] *= weight;
        lever[3 + c] = weight * t->normal[c];
    }
}

/* += x y^T; two rows are three vectors. */
INSIDE void add_across(double to[36], const double x[6], const double y[6])
{
    four *rows = (four *)to;
    const four begin = {y[0], y[1], y[2], y[3]}, middle = {y[4], y[5], y[0], y[1]},
               end = {y[2], y[3], y[4], y[5]};
    for (int i = 0; i < 3; i++) {
        double p = x[2 * i], q = x[2 * i + 1];
        rows[3 * i] += (four){p, p, p, p} * begin;
        rows[3 * i + 1] += (four){p, p, q, q} * middle;
        rows[3 * i + 2] += (four){q, q, q, q} * end;
    }
}

/* += weight (x, 1) (y, 1)^T */
INSIDE void add_along(double to[4][4], const double x[3], const double y[3], double weight)
{
    four *rows = (four *)to;
    const four row = {weight * y[0], weight * y[1], weight * y[2], weight};
    for (int i = 0; i < 3; i++) rows[i] += (four){x[i], x[i], x[i], x[i]} * row;
    rows[3] += row;
}

/* What a term says of its node k: its right side, and its blocks with itself and nodes behind it; couplings of
 * pairs that are not in the set are left out. */
INSIDE void add_use(npg_block_system *s, const npg_block_term *t, size_t k, const uint32_t *pair_of)
{
    uint32_t a = t->nodes[k];
    double lever[6], other[6], pull[3], turned[3], *right = s->right + 6 * (size_t)a;
    double level = npg_vec3_dot(t->normal, t->right);
    for (int c = 0; c < 3; c++) pull[c] = t->across * level * t->normal[c] + t->along * t->right[c];
    npg_vec3_cross(turned, t->arms[k], pull);
    for (int c = 0; c < 3; c++) {
        right[c] += t->shares[k] * turned[c];
        right[3 + c] += t->shares[k] * pull[c];
    }
    set_lever(lever, t, k, t->across * t->shares[k]);
    for (size_t b = 0; b < t->count; b++) {
        uint32_t node = t->nodes[b], pair = pair_of[node];
        if (node < a) continue;
        bool is_known = pair >= s->first[a] && pair < s->first[a + 1] && s->pairs[pair][1] == node;
        if (b != k && !is_known) continue;
        block *to = b == k ? s->sum + a : s->off + pair;
        add_along(to->along, t->arms[k], t->arms[b], t->along * t->shares[k] * t->shares[b]);
        if (t->across == 0) continue;
        set_lever(other, t, b, t->shares[b]);
        add_across(to->across, lever, other);
    }
}

/* A node's terms lie anywhere among the others. */
INSIDE void fetch(const npg_block_term *t)
{
    for (size_t i = 0; i < sizeof *t; i += 64) __builtin_prefetch((const char *)t + i);
}

/* Rows [first, last); pair_of: n, scratch. */
NPG_WIDE static void gather_rows(npg_block_system *s, size_t first, size_t last, uint32_t *pair_of)
{
    size_t pairs = s->first[last] - s->first[first];
    memset(s->sum + first, 0, (last - first) * sizeof *s->sum);
    memset(s->off + s->first[first], 0, pairs * sizeof *s->off);
    memset(s->right + 6 * first, 0, (last - first) * 6 * sizeof(double));
    for (size_t a = first; a < last; a++) {
        for (uint32_t e = s->first[a]; e < s->first[a + 1]; e++) pair_of[s->pairs[e][1]] = e;
        for (uint32_t u = s->term_first[a]; u < s->term_first[a + 1]; u++) {
            fetch(&s->terms[s->uses[u + TERMS_AHEAD] / NPG_BLOCK_NODES]);
            add_use(s, &s->terms[s->uses[u] / NPG_BLOCK_NODES], s->uses[u] % NPG_BLOCK_NODES, pair_of);
        }
    }
}

static npg_status gather_part(void *user, size_t part)
{
    npg_block_system *s = user;
    gather_rows(s, part * GRAIN, grain_end(s, part), s->pair_of + part * s->n);
    return NPG_OK;
}

npg_status npg_block_gather(npg_block_system *s, const npg_block_term *terms, size_t count)
{
    NPG_REQUIRE(count <= s->term_most);
    list_uses(s, terms, count);
    s->terms = terms;
    return npg_parallel(gather_part, s, grains(s));
}

/* ---- solving ---- */

/* K^T K' of the part along: with M = sum a b^T it is (tr M) I - M^T, [sum a]x; -[sum b]x, sum 1. */
static void set_whole(double whole[36], const block *b)
{
    const double(*m)[4] = b->along;
    const double trace = m[0][0] + m[1][1] + m[2][2];
    memcpy(whole, b->across, sizeof b->across);
    for (size_t i = 0; i < 3; i++) {
        size_t j = (i + 1) % 3, k = (i + 2) % 3;
        for (size_t c = 0; c < 3; c++) whole[6 * i + c] -= m[c][i];
        whole[7 * i] += trace;
        whole[7 * i + 21] += m[3][3];
        whole[6 * i + 3 + j] -= m[k][3];
        whole[6 * i + 3 + k] += m[j][3];
        whole[18 + 6 * i + j] += m[3][k];
        whole[18 + 6 * i + k] -= m[3][j];
    }
}

static void set_cell(float *cell, const double *whole, bool transposed)
{
    for (int j = 0; j < 6; j++)
        for (int i = 0; i < 6; i++) cell[LANES * j + i] = (float)whole[transposed ? 6 * j + i : 6 * i + j];
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

static npg_status lay_out_part(void *user, size_t part)
{
    const npg_block_system *s = user;
    double whole[36], inverse[36];
    size_t first = part * GRAIN, last = grain_end(s, part);
    for (size_t k = first; k < last; k++) {
        set_whole(whole, s->sum + k);
        for (int i = 0; i < 6; i++) whole[7 * i] += s->damping;
        invert(inverse, whole);
        set_cell(s->diagonal + CELL * k, whole, false);
        set_cell(s->inverse + CELL * k, inverse, false);
    }
    for (size_t e = s->first[first]; e < s->first[last]; e++) {
        set_whole(whole, s->off + e);
        set_cell(s->cells + CELL * (size_t)s->place[2 * e], whole, false);
        set_cell(s->cells + CELL * (size_t)s->place[2 * e + 1], whole, true);
    }
    return NPG_OK;
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

/* Rows [first, last) of y = the whole matrix x. */
NPG_WIDE static void multiply_rows(const npg_block_system *s, float *restrict y, const float *restrict x,
                                   size_t first, size_t last)
{
    for (size_t a = first; a < last; a++) {
        lanes sum[2] = {{0}, {0}};
        add_cell(sum, s->diagonal + CELL * a, x + LANES * a);
        for (uint32_t e = s->row_first[a]; e < s->row_first[a + 1]; e++)
            add_cell(sum, s->cells + CELL * (size_t)e, x + LANES * (size_t)s->other[e]);
        *(lanes *)(y + LANES * a) = sum[0] + sum[1];
    }
}

typedef struct product {
    const npg_block_system *system;
    float *y;
    const float *x;
} product;

static npg_status multiply_part(void *user, size_t part)
{
    const product *p = user;
    multiply_rows(p->system, p->y, p->x, part * GRAIN, grain_end(p->system, part));
    return NPG_OK;
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
    for (size_t k = 0; k < s->n; k++)
        for (size_t i = 0; i < 6; i++) r[LANES * k + i] = (float)s->right[6 * k + i];
}

int npg_block_solve(npg_block_system *s, double *out, double damping, double tolerance, int iterations)
{
    size_t n = LANES * s->n;
    float *x = s->work, *r = x + n, *z = r + n, *p = z + n, *q = p + n;
    s->damping = damping;
    npg_parallel(lay_out_part, s, grains(s));
    memset(s->work, 0, 5 * n * sizeof *x);
    set_right(s, r);
    double stop = tolerance * tolerance * dot(r, r, n);
    precondition(s, z, r);
    memcpy(p, z, n * sizeof *p);
    double rz = dot(r, z, n);
    int step = 0;
    for (; step < iterations && dot(r, r, n) > stop; step++) {
        npg_parallel(multiply_part, &(product){s, q, p}, grains(s));
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
