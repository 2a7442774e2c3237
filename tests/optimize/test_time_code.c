/* Time codes: their formulas, and a learned one that learns and goes on from what was saved of it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "optimize/fit.h"
#include "pipeline/memory.h"

enum { M = 3, N = 2 * M, T = 9 };

static double times[T];

static int set_times(void **state)
{
    (void)state;
    for (int i = 0; i < T; i++) times[i] = (double)i / (T - 1);
    return 0;
}

static int nothing_is_left(void **state)
{
    (void)state;
    return npg_memory_used() ? -1 : 0;
}

static npg_time_code *open_code(npg_time_kind kind, uint64_t seed)
{
    npg_time_code *code;
    assert_int_equal(npg_time_code_open(&code, kind, M, seed), NPG_OK);
    return code;
}

static void fourier_and_powers_are_those_of_the_paper(void **state)
{
    float codes[T * N];
    (void)state;
    npg_time_code *code = open_code(NPG_TIME_FOURIER, 1);
    npg_time_code_fill(code, codes, times, T);
    for (int i = 0; i < T; i++)
        for (int j = 0; j < M; j++) {
            assert_true(fabs((double)codes[N * i + j] - sin(M_PI * (1 << j) * times[i])) < 1e-6);
            assert_true(fabs((double)codes[N * i + M + j] - cos(M_PI * (1 << j) * times[i])) < 1e-6);
        }
    assert_false(npg_time_code_learns(code));
    npg_time_code_close(&code);
    code = open_code(NPG_TIME_POLYNOMIAL, 1);
    npg_time_code_fill(code, codes, times, T);
    for (int i = 0; i < T; i++)
        for (int j = 0; j < N; j++) assert_true(fabs((double)codes[N * i + j] - pow(times[i], j + 1)) < 1e-6);
    npg_time_code_close(&code);
    npg_time_code_close(&code);
}

/* sin and cos of one angle in each pair, and angles that grow with time. */
static void random_frequencies_come_from_the_seed(void **state)
{
    float codes[3][T * N];
    const uint64_t seeds[] = {7, 7, 8};
    (void)state;
    for (int k = 0; k < 3; k++) {
        npg_time_code *code = open_code(NPG_TIME_GAUSSIAN, seeds[k]);
        npg_time_code_fill(code, codes[k], times, T);
        npg_time_code_close(&code);
    }
    assert_memory_equal(codes[0], codes[1], sizeof codes[0]);
    assert_memory_not_equal(codes[0], codes[2], sizeof codes[0]);
    for (int i = 0; i < T; i++)
        for (int j = 0; j < M; j++)
            assert_true(fabsf(hypotf(codes[0][N * i + j], codes[0][N * i + M + j]) - 1) < 1e-6f);
}

static double wanted(int i, int j)
{
    return sin((j + 1) * times[i]);
}

/* One step down sum of (code - wanted)^2; what the sum was. */
static double train(npg_time_code *code)
{
    float codes[T * N], dcodes[T * N];
    double sum = 0;
    npg_time_code_fill(code, codes, times, T);
    for (int i = 0; i < T * N; i++) {
        double off = (double)codes[i] - wanted(i / N, i % N);
        sum += off * off;
        dcodes[i] = (float)(2 * off);
    }
    assert_int_equal(npg_time_code_step(code, dcodes, times, T, 0.01), NPG_OK);
    return sum;
}

static void a_learned_code_learns_and_goes_on_from_what_was_saved(void **state)
{
    double first, last = 0, saved[4096];
    size_t count;
    int64_t *step, saved_step;
    (void)state;
    npg_time_code *code = open_code(NPG_TIME_LEARNED, 3), *other = open_code(NPG_TIME_LEARNED, 4);
    assert_true(npg_time_code_learns(code));
    first = train(code);
    for (int i = 0; i < 200; i++) last = train(code);
    assert_true(last < 0.05 * first);

    double *parts = npg_time_code_parts(code, &count, &step);
    assert_true(count > 0 && count <= sizeof saved / sizeof *saved);
    memcpy(saved, parts, count * sizeof *saved);
    saved_step = *step;
    assert_int_equal(saved_step, 201);
    parts = npg_time_code_parts(other, &count, &step);
    memcpy(parts, saved, count * sizeof *saved);
    *step = saved_step;
    for (int i = 0; i < 5; i++) assert_true(train(code) == train(other));

    npg_time_code *plain = open_code(NPG_TIME_FOURIER, 3);
    npg_time_code_parts(plain, &count, &step);
    assert_int_equal(count, 0);
    npg_time_code_close(&plain);
    npg_time_code_close(&code);
    npg_time_code_close(&other);
}

static void no_memory_is_said(void **state)
{
    npg_time_code *code = NULL;
    (void)state;
    for (uint64_t n = 1; n <= 3; n++) {
        npg_memory_fail_at(n, false);
        assert_int_equal(npg_time_code_open(&code, NPG_TIME_LEARNED, M, 1), NPG_MEMORY);
        npg_memory_fail_at(0, false);
        assert_null(code);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fourier_and_powers_are_those_of_the_paper),
        cmocka_unit_test(random_frequencies_come_from_the_seed),
        cmocka_unit_test(a_learned_code_learns_and_goes_on_from_what_was_saved),
        cmocka_unit_test(no_memory_is_said)};
    return cmocka_run_group_tests(tests, set_times, nothing_is_left);
}
