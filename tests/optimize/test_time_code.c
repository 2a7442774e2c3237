/* Time code: its formula. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "optimize/grids/fit.h"

enum { M = 3, T = 9 };

static void it_is_that_of_the_paper(void **state)
{
    float codes[T * 2 * M];
    double times[T];
    (void)state;
    for (int i = 0; i < T; i++) times[i] = (double)i / (T - 1);
    npg_time_code(codes, times, T, M);
    for (int i = 0; i < T; i++)
        for (int j = 0; j < M; j++) {
            double at = M_PI * pow(2, j) * times[i];
            assert_true(fabs((double)codes[2 * M * i + j] - sin(at)) < 1e-6);
            assert_true(fabs((double)codes[2 * M * i + M + j] - cos(at)) < 1e-6);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(it_is_that_of_the_paper)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
