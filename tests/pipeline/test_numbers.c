/* Numbers: texts to doubles, against the C library's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/source.h"

static double next_number(uint64_t *seed)
{
    double value;
    do {
        *seed = *seed * 6364136223846793005u + 1442695040888963407u;
        uint64_t bits = *seed ^ *seed >> 29;
        memcpy(&value, &bits, sizeof value);
    } while (!isfinite(value));
    return value;
}

static void check_number(const char *text, double truth)
{
    double value = 0;
    const char *end = text + strlen(text), *after = npg_number_parse(text, end, &value);
    assert_ptr_equal(after, end);
    double next = nextafter(truth, value);
    assert_true(value == truth || value == next);
}

static void numbers_are_what_the_library_says(void **state)
{
    (void)state;
    static const char *const formats[] = {"%.17g", "%.9g", "%.6f", "%.3e", "%+.15g", "%.25e", "%g"};
    uint64_t seed = 7;
    char text[512];
    for (int i = 0; i < 20000; i++) {
        double value = next_number(&seed);
        if (i % 2) value = fmod(value, 1e7);
        for (size_t f = 0; f < sizeof formats / sizeof *formats; f++) {
            snprintf(text, sizeof text, formats[f], value);
            check_number(text, strtod(text, NULL));
        }
    }
    static const char *const good[] = {"0",   "-0",    ".5",     "5.",    "+1",
                                       "1e5", "1E+05", "1e-320", "1e400", "00012"};
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) check_number(good[i], strtod(good[i], NULL));
    static const char *const bad[] = {"",      "-",    ".",  "e5",  "1e",   "1e+",
                                      "1.2.3", "0x10", "1f", "--1", "nano", "1_0"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        double value;
        assert_null(npg_number_parse(bad[i], bad[i] + strlen(bad[i]), &value));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(numbers_are_what_the_library_says)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
