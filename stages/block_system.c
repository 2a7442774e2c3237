/* Block system: 6 x 6 blocks, conjugate gradients preconditioned by the blocks on the diagonal. */
#include "block_system.h"

#include <math.h>
#include <string.h>

#include "parallel.h"

struct npg_block_system {
    size_t n, pair_count;
    uint32_t (*pairs)[2]; /* owned, sorted                        */
    uint32_t *first;      /* n + 1: pairs[first[a]] .. have a = a */
    double *diagonal;     /* n x 36                               */
    double *off;          /* pair_count x 36, block (a, b)        */
    double *right;        /* n x 6                                */
    double *factor;       /* n x 36: Cholesky of the diagonal     */
    double *work;         /* 4 x n x 6                            */
};

void npg_block_close(npg_block_system **slot)
{
    if (!slot || !*slot) return;
    npg_block_system *s = *slot;
    void *all[] = {&s->pairs, &s->first, &s->diagonal, &s->off, &s->right, &s->factor, &s->work};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) npg_release(all[i]);
    npg_release(slot);
}

npg_status npg_block_open(npg_block_system **out, size_t n, const uint32_t (*pairs)[2], size_t pair_count)
{
    npg_block_system *s;
    *out = NULL;
    NPG_TRY(npg_alloc(&s, NPG_FOR_FIT, sizeof *s));
    s->n = n;
    s->pair_count = pair_count;
    npg_status status = npg_alloc_array(&s->pairs, NPG_FOR_FIT, pair_count + 1, sizeof *s->pairs);
    if (!status) status = npg_alloc_array(&s->first, NPG_FOR_FIT, n + 2, sizeof *s->first);
    if (!status) status = npg_alloc_array(&s->diagonal, NPG_FOR_FIT, n, 36 * sizeof(double));
    if (!status) status = npg_alloc_array(&s->off, NPG_FOR_FIT, pair_count + 1, 36 * sizeof(double));
    if (!status) status = npg_alloc_array(&s->right, NPG_FOR_FIT, n, 6 * sizeof(double));
    if (!status) status = npg_alloc_array(&s->factor, NPG_FOR_FIT, n, 36 * sizeof(double));
    if (!status) status = npg_alloc_array(&s->work, NPG_FOR_FIT, 4 * n, 6 * sizeof(double));
    if (status) {
        npg_block_close(&s);
        return status;
    }
    memcpy(s->pairs, pairs, pair_count * sizeof *pairs);
    for (size_t e = 0; e < pair_count; e++) s->first[pairs[e][0] + 1]++;
    for (size_t a = 0; a < n; a++) s->first[a + 1] += s->first[a];
    *out = s;
    return NPG_OK;
}

void npg_block_clear(npg_block_system *s)
{
    memset(s->diagonal, 0, s->n * 36 * sizeof(double));
    memset(s->off, 0, s->pair_count * 36 * sizeof(double));
    memset(s->right, 0, s->n * 6 * sizeof(double));
}

/* The block of (a, b), a < b; NULL when the pair is not in the set. */
static double *block_of(npg_block_system *s, uint32_t a, uint32_t b)
{
    uint32_t lo = s->first[a], hi = s->first[a + 1];
    while (lo < hi) {
        uint32_t mid = (lo + hi) / 2;
        if (s->pairs[mid][1] < b)
            lo = mid + 1;
        else
            hi = mid;
    }
    return lo < s->first[a + 1] && s->pairs[lo][1] == b ? s->off + 36 * (size_t)lo : NULL;
}

/* block += a^T b for 3 x 6 matrices. */
NPG_WIDE static void add_product(double *restrict block, const double *restrict a, const double *restrict b)
{
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            block[6 * i + j] += a[i] * b[j] + a[6 + i] * b[6 + j] + a[12 + i] * b[12 + j];
}

void npg_block_add(npg_block_system *s, const uint32_t *nodes, const double (*jacobians)[18], size_t count,
                   const double w[9], const double r[3])
{
    for (size_t j = 0; j < count; j++) {
        double wj[18];
        for (int i = 0; i < 3; i++)
            for (int c = 0; c < 6; c++)
                wj[6 * i + c] = w[3 * i] * jacobians[j][c] + w[3 * i + 1] * jacobians[j][6 + c] +
                                w[3 * i + 2] * jacobians[j][12 + c];
        double *right = s->right + 6 * (size_t)nodes[j];
        for (int c = 0; c < 6; c++) right[c] += wj[c] * r[0] + wj[6 + c] * r[1] + wj[12 + c] * r[2];
        add_product(s->diagonal + 36 * (size_t)nodes[j], jacobians[j], wj);
        for (size_t i = 0; i < count; i++) {
            if (nodes[i] >= nodes[j]) continue;
            double *block = block_of(s, nodes[i], nodes[j]);
            if (block) add_product(block, jacobians[i], wj);
        }
    }
}

static void add_all(double *to, const double *from, size_t count)
{
    for (size_t i = 0; i < count; i++) to[i] += from[i];
}

void npg_block_merge(npg_block_system *s, const npg_block_system *other)
{
    add_all(s->diagonal, other->diagonal, s->n * 36);
    add_all(s->off, other->off, s->pair_count * 36);
    add_all(s->right, other->right, s->n * 6);
}

void npg_block_damp(npg_block_system *s, double damping)
{
    for (size_t k = 0; k < s->n; k++)
        for (int i = 0; i < 6; i++) s->diagonal[36 * k + 7 * (size_t)i] += damping;
}

/* ---- solving ---- */

static void factorise(double *l, const double *a)
{
    memset(l, 0, 36 * sizeof *l);
    for (int j = 0; j < 6; j++)
        for (int i = j; i < 6; i++) {
            double sum = a[6 * i + j];
            for (int k = 0; k < j; k++) sum -= l[6 * i + k] * l[6 * j + k];
            l[6 * i + j] = i == j ? sqrt(fmax(sum, 1e-12)) : sum / l[6 * j + j];
        }
}

static void apply_factor(double *x, const double *l, const double *b)
{
    for (int i = 0; i < 6; i++) {
        double sum = b[i];
        for (int k = 0; k < i; k++) sum -= l[6 * i + k] * x[k];
        x[i] = sum / l[6 * i + i];
    }
    for (int i = 5; i >= 0; i--) {
        double sum = x[i];
        for (int k = i + 1; k < 6; k++) sum -= l[6 * k + i] * x[k];
        x[i] = sum / l[6 * i + i];
    }
}

NPG_WIDE static void multiply(const npg_block_system *s, double *restrict y, const double *restrict x)
{
    for (size_t k = 0; k < s->n; k++)
        for (size_t i = 0; i < 6; i++) {
            double sum = 0;
            for (size_t j = 0; j < 6; j++) sum += s->diagonal[36 * k + 6 * i + j] * x[6 * k + j];
            y[6 * k + i] = sum;
        }
    for (size_t e = 0; e < s->pair_count; e++) {
        const double *m = s->off + 36 * e, *xa = x + 6 * (size_t)s->pairs[e][0],
                     *xb = x + 6 * (size_t)s->pairs[e][1];
        double *ya = y + 6 * (size_t)s->pairs[e][0], *yb = y + 6 * (size_t)s->pairs[e][1];
        for (int i = 0; i < 6; i++) {
            double sum = 0;
            for (int j = 0; j < 6; j++) {
                sum += m[6 * i + j] * xb[j];
                yb[j] += m[6 * i + j] * xa[i];
            }
            ya[i] += sum;
        }
    }
}

static double dot(const double *a, const double *b, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

static void precondition(const npg_block_system *s, double *z, const double *r)
{
    for (size_t k = 0; k < s->n; k++) apply_factor(z + 6 * k, s->factor + 36 * k, r + 6 * k);
}

int npg_block_solve(npg_block_system *s, double *x, double tolerance, int iterations)
{
    size_t n = 6 * s->n;
    double *r = s->work, *z = r + n, *p = z + n, *q = p + n;
    for (size_t k = 0; k < s->n; k++) factorise(s->factor + 36 * k, s->diagonal + 36 * k);
    memset(x, 0, n * sizeof *x);
    memcpy(r, s->right, n * sizeof *r);
    double stop = tolerance * tolerance * dot(r, r, n);
    precondition(s, z, r);
    memcpy(p, z, n * sizeof *p);
    double rz = dot(r, z, n);
    int step = 0;
    for (; step < iterations && dot(r, r, n) > stop; step++) {
        multiply(s, q, p);
        double curvature = dot(p, q, n);
        if (!(curvature > 0)) break; /* nothing more to gain in double */
        double alpha = rz / curvature;
        for (size_t i = 0; i < n; i++) {
            x[i] += alpha * p[i];
            r[i] -= alpha * q[i];
        }
        precondition(s, z, r);
        double next = dot(r, z, n), beta = next / rz;
        for (size_t i = 0; i < n; i++) p[i] = z[i] + beta * p[i];
        rz = next;
    }
    return step;
}
