/* Weights: the confidence of frames (paper, eq. confidence) against the formulas written out. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "optimize/grids/fit.h"

enum { FRAMES = 5, KEY = 10 };

/* Outward from the key, as the fit asks: 10, 9, 11, 8, 12. */
static const int64_t indices[FRAMES] = {10, 9, 11, 8, 12};
static const double cds[FRAMES] = {2, 3, 2.5, 6, 1};

static void fill(double weights[FRAMES], npg_confidence confidence, double progress)
{
    npg_weights state;
    npg_weights_begin(&state, confidence, progress, KEY, FRAMES);
    for (int i = 0; i < FRAMES; i++) weights[i] = npg_weights_next(&state, indices[i], cds[i], true);
}

static void expect(const double weights[FRAMES], const double omega[FRAMES], double delta)
{
    for (int i = 0; i < FRAMES; i++) assert_float_equal(weights[i], pow(omega[i], delta) / FRAMES, 1e-12);
}

/* Of 1 / (1 + what is lost against the key); a frame that fits better than the key counts as the key. */
static void test_cumulative_is_a_product_on_either_side(void **state)
{
    const double product[FRAMES] = {1, 1 / 2.0, 1 / 1.5, 1 / 2.0 * 1 / 5.0, 1 / 1.5};
    double weights[FRAMES];
    (void)state;
    fill(weights, NPG_CONFIDENCE_CUMULATIVE, 0);
    expect(weights, product, 1);
    fill(weights, NPG_CONFIDENCE_CUMULATIVE, 0.25);
    expect(weights, product, 0.5);
    fill(weights, NPG_CONFIDENCE_CUMULATIVE, 0.36);
    expect(weights, product, 1 - 0.6);
}

static void test_at_the_end_all_frames_count_alike(void **state)
{
    double weights[FRAMES];
    (void)state;
    fill(weights, NPG_CONFIDENCE_CUMULATIVE, 1);
    for (int i = 0; i < FRAMES; i++) assert_float_equal(weights[i], 1.0 / FRAMES, 1e-12);
    fill(weights, NPG_CONFIDENCE_CONSTANT, 0);
    for (int i = 0; i < FRAMES; i++) assert_float_equal(weights[i], 1.0 / FRAMES, 1e-12);
}

/* The first frame with points stands for the key; frames without count nothing and break no product. */
static void test_frames_without_points(void **state)
{
    npg_weights weights;
    (void)state;
    npg_weights_begin(&weights, NPG_CONFIDENCE_CUMULATIVE, 0, KEY, 4);
    assert_float_equal(npg_weights_next(&weights, 10, 7, false), 0, 0);
    assert_float_equal(npg_weights_next(&weights, 11, 2, true), 0.25, 1e-12);
    assert_float_equal(npg_weights_next(&weights, 12, 9, false), 0, 0);
    assert_float_equal(npg_weights_next(&weights, 13, 3, true), 0.25 / 2, 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_cumulative_is_a_product_on_either_side),
                                       cmocka_unit_test(test_at_the_end_all_frames_count_alike),
                                       cmocka_unit_test(test_frames_without_points)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
