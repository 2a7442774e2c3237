/* Latent features: what the solve gives back inverts the grids' matrix; the first component is the widest. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>

#include "export/exporters/vdb.h"
#include "tests/kernels/twins/twins.h"

/* What the solve gives back must be what the matrix takes to the unknowns. */
static void features_invert_the_grid_matrix(void **state)
{
    (void)state;
    npg_levels levels = {0};
    npg_levels_add(&levels,
                   (npg_level){.kind = NPG_LEVEL_POSITION, .nodes = 5, .channel_end = 32, .lambda = 3});
    size_t count = levels.row_count * NPG_LATENT_CHANNELS;
    double *unknowns = calloc(count, sizeof *unknowns), *x = calloc(count, sizeof *x),
           *again = calloc(count, sizeof *again);
    for (size_t i = 0; i < count; i++) x[i] = unknowns[i] = sin(1.7 * (double)i) + (double)(i % 7);
    assert_int_equal(npg_features_solve(x, 5, NPG_LATENT_CHANNELS, 3), NPG_OK);
    npg_sobolev_apply_ref(again, x, &levels);
    for (size_t i = 0; i < count; i++) assert_true(fabs(again[i] - unknowns[i]) < 1e-10);
    free(unknowns);
    free(x);
    free(again);
}

static void the_first_component_is_the_widest(void **state)
{
    enum { N = 500 };
    static double rows[3 * N], out[N];
    double direction[3], share;
    (void)state;
    for (int i = 0; i < N; i++) { /* wide along (0.6, -0.8, 0), narrow along z */
        double wide = sin(0.7 * i) * 5, narrow = cos(1.1 * i) * 0.5;
        rows[3 * i] = 2 + 0.6 * wide;
        rows[3 * i + 1] = -0.8 * wide;
        rows[3 * i + 2] = 1 + narrow;
    }
    assert_int_equal(npg_features_component(out, direction, &share, rows, N, 3), NPG_OK);
    assert_true(fabs(direction[0] + 0.6) < 1e-2 && fabs(direction[1] - 0.8) < 1e-2);
    assert_true(share > 0.98 && share < 1);
    for (int i = 0; i < N; i++) assert_true(fabs(out[i] + 5 * sin(0.7 * i)) < 0.1);
    for (int i = 0; i < 3 * N; i++) rows[i] = 1;
    assert_int_equal(npg_features_component(out, direction, &share, rows, N, 3), NPG_OK);
    assert_true(share == 0 && out[7] == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(features_invert_the_grid_matrix),
                                       cmocka_unit_test(the_first_component_is_the_widest)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
