/* The equations of the coarse alignment against the same terms written out in full. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "track/track_internal.h"

enum { NODES = 40, SIZE = 6 * NODES, PAIRS_MAX = NODES * (NODES - 1) / 2, TERMS = 600 };

static double random_unit(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(*seed >> 11) / 9007199254740992.0;
}

/* Neighbours within `reach` in the order of the nodes, so that some couplings of terms are not in the set. */
static size_t list_pairs(uint32_t (*pairs)[2], uint32_t reach)
{
    size_t count = 0;
    for (uint32_t a = 0; a < NODES; a++)
        for (uint32_t b = a + 1; b < NODES && b <= a + reach; b++, count++) {
            pairs[count][0] = a;
            pairs[count][1] = b;
        }
    return count;
}

static void random_term(npg_block_term *t, uint64_t *seed, uint32_t spread)
{
    uint32_t first = (uint32_t)(random_unit(seed) * (NODES - spread));
    double size = 0;
    *t = (npg_block_term){.count = 1 + (size_t)(random_unit(seed) * NPG_BLOCK_NODES)};
    for (size_t k = 0; k < t->count; k++) {
        t->nodes[k] = first + (uint32_t)((t->count - 1 - k) * spread / NPG_BLOCK_NODES);
        t->shares[k] = random_unit(seed) - 0.3;
        for (int c = 0; c < 3; c++) t->arms[k][c] = random_unit(seed) - 0.5;
    }
    for (int c = 0; c < 3; c++) {
        t->normal[c] = random_unit(seed) - 0.5;
        t->right[c] = random_unit(seed) - 0.5;
        size += t->normal[c] * t->normal[c];
    }
    for (int c = 0; c < 3; c++) t->normal[c] /= sqrt(size);
    t->across = random_unit(seed);
    t->along = 0.2 * random_unit(seed);
}

/* Row `axis` of the term's Jacobian for node k: of turn x arm + move, times the share. */
static void jacobian(double row[6], const npg_block_term *t, size_t k, int axis)
{
    for (int unknown = 0; unknown < 6; unknown++) {
        double turn[3] = {0}, move[3] = {0};
        (unknown < 3 ? turn : move)[unknown % 3] = 1;
        int i = (axis + 1) % 3, j = (axis + 2) % 3;
        row[unknown] = t->shares[k] * (turn[i] * t->arms[k][j] - turn[j] * t->arms[k][i] + move[axis]);
    }
}

static void add_in_full(double *matrix, double *right, const npg_block_term *t)
{
    double w[3][3], rows[NPG_BLOCK_NODES][3][6];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            w[i][j] = t->across * t->normal[i] * t->normal[j] + (i == j ? t->along : 0);
    for (size_t k = 0; k < t->count; k++)
        for (int axis = 0; axis < 3; axis++) jacobian(rows[k][axis], t, k, axis);
    for (size_t a = 0; a < t->count; a++)
        for (int u = 0; u < 6; u++)
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++) {
                    right[6 * t->nodes[a] + u] += rows[a][i][u] * w[i][j] * t->right[j];
                    for (size_t b = 0; b < t->count; b++)
                        for (int v = 0; v < 6; v++)
                            matrix[SIZE * (6 * t->nodes[a] + u) + 6 * t->nodes[b] + v] +=
                                rows[a][i][u] * w[i][j] * rows[b][j][v];
                }
}

static double residual_of(const double *matrix, const double *right, const double *x)
{
    double off = 0, all = 0;
    for (int i = 0; i < SIZE; i++) {
        double sum = right[i];
        for (int j = 0; j < SIZE; j++) sum -= matrix[SIZE * i + j] * x[j];
        off += sum * sum;
        all += right[i] * right[i];
    }
    return sqrt(off / all);
}

/* The terms solve what is written out in full. */
static void solves_the_terms(void **state)
{
    static double matrix[SIZE * SIZE], right[SIZE], x[SIZE];
    static uint32_t pairs[PAIRS_MAX][2];
    static npg_block_term terms[TERMS];
    npg_block_system *system;
    uint64_t seed = 1;
    (void)state;
    size_t pair_count = list_pairs(pairs, NODES);
    assert_int_equal(npg_block_open(&system, NODES, (const uint32_t(*)[2])pairs, pair_count, TERMS), NPG_OK);
    for (int round = 0; round < 2; round++) { /* the second one finds what the first one left */
        memset(matrix, 0, sizeof matrix);
        memset(right, 0, sizeof right);
        for (int i = 0; i < TERMS; i++) {
            random_term(&terms[i], &seed, 9);
            add_in_full(matrix, right, &terms[i]);
        }
        assert_int_equal(npg_block_gather(system, terms, TERMS), NPG_OK);
        for (int i = 0; i < SIZE; i++) matrix[(SIZE + 1) * i] += 0.01;
        int steps = npg_block_solve(system, x, 0.01, 1e-5, 1000);
        assert_in_range(steps, 2, 400);
        assert_true(residual_of(matrix, right, x) < 3e-5);
    }
    npg_block_close(&system);
}

/* A term over nodes that are no pair: each for itself, as if the coupling were zero. */
static void leaves_out_what_is_no_pair(void **state)
{
    static const uint32_t pairs[1][2] = {{0, 1}};
    npg_block_system *system;
    const npg_block_term term = {
        .count = 2, .nodes = {0, 5}, .shares = {0.5, 0.5}, .along = 1, .right = {1, 0, 0}};
    double x[6 * 6];
    (void)state;
    assert_int_equal(npg_block_open(&system, 6, pairs, 1, 1), NPG_OK);
    assert_int_equal(npg_block_gather(system, &term, 1), NPG_OK);
    npg_block_solve(system, x, 1e-9, 1e-6, 50);
    for (int node = 0; node < 6; node++)
        for (int i = 0; i < 6; i++) {
            bool is_moved = (node == 0 || node == 5) && i == 3;
            assert_true(fabs(x[6 * node + i] - (is_moved ? 2 : 0)) < 1e-4);
        }
    npg_block_close(&system);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(solves_the_terms),
                                       cmocka_unit_test(leaves_out_what_is_no_pair)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
