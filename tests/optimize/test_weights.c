/* Weights: the confidence of frames (paper, eq. confidence) against the formulas written out. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "optimize/fit.h"

enum { FRAMES = 5, KEY = 10 };

/* Outward from the key, as the fit asks: 10, 9, 11, 8, 12. */
static const int64_t indices[FRAMES] = {10, 9, 11, 8, 12};
static const double cds[FRAMES] = {2, 3, 2.5, 6, 1};

static void fill(double weights[FRAMES], npg_confidence confidence, npg_catch_up catch_up, double progress)
{
    const npg_fit_settings settings = {.confidence = confidence, .catch_up = catch_up};
    npg_weights state;
    npg_weights_begin(&state, &settings, progress, KEY, FRAMES);
    for (int i = 0; i < FRAMES; i++) weights[i] = npg_weights_next(&state, indices[i], cds[i], true);
}

static void expect(const double weights[FRAMES], const double omega[FRAMES], double delta)
{
    for (int i = 0; i < FRAMES; i++) assert_float_equal(weights[i], pow(omega[i], delta) / FRAMES, 1e-12);
}

/* 1 / (1 + what is lost against the key); a frame that fits better than the key counts as the key. */
static const double single[FRAMES] = {1, 1 / 2.0, 1 / 1.5, 1 / 5.0, 1};

static void test_cumulative_is_a_product_on_either_side(void **state)
{
    const double product[FRAMES] = {1, 1 / 2.0, 1 / 1.5, 1 / 2.0 * 1 / 5.0, 1 / 1.5};
    double weights[FRAMES];
    (void)state;
    fill(weights, NPG_CONFIDENCE_CUMULATIVE, NPG_CATCH_UP_CONSTANT, 0.5);
    expect(weights, product, 1);
    fill(weights, NPG_CONFIDENCE_CUMULATIVE, NPG_CATCH_UP_ROOT, 0.25);
    expect(weights, product, 0.5);
}

static void test_the_simpler_confidences(void **state)
{
    const double half[FRAMES] = {0.5, 0.5, 0.5, 0.5, 0.5}, one[FRAMES] = {1, 1, 1, 1, 1};
    double weights[FRAMES];
    (void)state;
    fill(weights, NPG_CONFIDENCE_SINGLE, NPG_CATCH_UP_CONSTANT, 0);
    expect(weights, single, 1);
    fill(weights, NPG_CONFIDENCE_DELTA, NPG_CATCH_UP_CONSTANT, 0);
    expect(weights, half, 1);
    fill(weights, NPG_CONFIDENCE_CONSTANT, NPG_CATCH_UP_ROOT, 0);
    expect(weights, one, 1);
}

static void test_catch_up_opens_with_the_epochs(void **state)
{
    double weights[FRAMES];
    (void)state;
    fill(weights, NPG_CONFIDENCE_SINGLE, NPG_CATCH_UP_ROOT, 0.36);
    expect(weights, single, 1 - 0.6);
    fill(weights, NPG_CONFIDENCE_SINGLE, NPG_CATCH_UP_LINEAR, 0.36);
    expect(weights, single, 1 - 0.36);
    fill(weights, NPG_CONFIDENCE_SINGLE, NPG_CATCH_UP_EXPONENTIAL, 0.36);
    expect(weights, single, exp(-5 * 0.36));
    fill(weights, NPG_CONFIDENCE_SINGLE, NPG_CATCH_UP_INTERPOLATED, 0.36);
    for (int i = 0; i < FRAMES; i++)
        assert_float_equal(weights[i], (0.64 * single[i] + 0.36) / FRAMES, 1e-12);
}

static void test_at_the_end_all_frames_count_alike(void **state)
{
    double weights[FRAMES];
    (void)state;
    for (int c = NPG_CATCH_UP_ROOT; c <= NPG_CATCH_UP_INTERPOLATED; c++) {
        if (c == NPG_CATCH_UP_CONSTANT || c == NPG_CATCH_UP_EXPONENTIAL) continue;
        fill(weights, NPG_CONFIDENCE_CUMULATIVE, (npg_catch_up)c, 1);
        for (int i = 0; i < FRAMES; i++) assert_float_equal(weights[i], 1.0 / FRAMES, 1e-12);
    }
}

/* The first frame with points stands for the key; frames without count nothing and break no product. */
static void test_frames_without_points(void **state)
{
    const npg_fit_settings settings = {.confidence = NPG_CONFIDENCE_CUMULATIVE,
                                       .catch_up = NPG_CATCH_UP_CONSTANT};
    npg_weights weights;
    (void)state;
    npg_weights_begin(&weights, &settings, 0, KEY, 4);
    assert_float_equal(npg_weights_next(&weights, 10, 7, false), 0, 0);
    assert_float_equal(npg_weights_next(&weights, 11, 2, true), 0.25, 1e-12);
    assert_float_equal(npg_weights_next(&weights, 12, 9, false), 0, 0);
    assert_float_equal(npg_weights_next(&weights, 13, 3, true), 0.25 / 2, 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_cumulative_is_a_product_on_either_side),
                                       cmocka_unit_test(test_the_simpler_confidences),
                                       cmocka_unit_test(test_catch_up_opens_with_the_epochs),
                                       cmocka_unit_test(test_at_the_end_all_frames_count_alike),
                                       cmocka_unit_test(test_frames_without_points)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
