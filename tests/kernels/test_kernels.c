/* Every op against its plain twin on random and extreme sizes, and equal bytes from equal input. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "kernels/kernels.h"
#include "kernels/latent.h"
#include "kernels/mlp.h"
#include "tests/kernels/twins/check.h"
#include "tests/support/group_device.h"

static void check_all(npg_device *on, const int *sizes, size_t size_count)
{
    for (const npg_kernel_case *c = npg_kernel_cases; c->op; c++)
        for (size_t i = 0; i < size_count; i++) {
            double error = 1;
            if (npg_kernel_case_run(c, on, sizes[i], 100 + i, &error))
                fail_msg("%s: %s", c->op, npg_error_text());
            print_message("%-24s size %d: error %.2g, allowed %.2g\n", c->op, sizes[i], error, c->tolerance);
            if (!(error <= c->tolerance)) fail_msg("%s of size %d is off by %g", c->op, sizes[i], error);
        }
}

static void ops_agree_with_their_twins(void **state)
{
    const int sizes[] = {1, 2, 3, 5, 8};
    (void)state;
    check_all(device, sizes, 5);
}

/* The parameters of other devices compute right on this one: work-groups of many items,
 * other vectors and tiles. */
static void ops_agree_with_the_parameters_of_other_devices(void **state)
{
    const npg_tuning *const sets[] = {&npg_tuning_wide, &npg_tuning_narrow, &npg_tuning_gpu};
    const int sizes[] = {1, 3, 8};
    (void)state;
    for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
        npg_device *other;
        if (npg_device_open(&other, "auto", sets[i])) fail_msg("%s: %s", sets[i]->name, npg_error_text());
        assert_ptr_equal(npg_device_tuning(other), sets[i]);
        print_message("%s:\n", sets[i]->name);
        check_all(other, sizes, 3);
        if (npg_kernels_self_test(other)) fail_msg("%s", npg_error_text());
        npg_device_close(&other);
    }
}

/* Sample and pass back 2000 points twice; compare all bytes. */
static void sampling_gives_equal_bytes(void **state)
{
    enum { POINTS = 2000, ROWS = 2112 };
    npg_levels levels = {0};
    npg_samples samples;
    npg_latent latent;
    npg_check check = {.random = npg_random_stream(5, 0, 0), .arena.purpose = NPG_FOR_RUN};
    float *first = NULL;
    (void)state;
    for (int l = 0; l < 8; l++)
        npg_levels_add(&levels, (npg_level){NPG_LEVEL_POSITION, 2 + 3 * l, 0, 0, 0, 30, 0.125, 0.4, 1});
    size_t size = levels.row_count * NPG_LATENT_CHANNELS;
    const float *points = npg_check_values(&check, NULL, POINTS * 3, 1);
    const float *nodes = npg_check_values(&check, NULL, size, 1);
    const float *dz = npg_check_values(&check, NULL, ROWS * NPG_LATENT_CHANNELS, 1);
    assert_int_equal(npg_arena_status(&check.arena), 0);
    assert_int_equal(npg_samples_open(&samples, &levels, points, points, POINTS, ROWS), 0);
    assert_int_equal(npg_latent_open(&latent, device, &samples), 0);
    for (int run = 0; run < 2; run++) {
        npg_buffer z, grid, back, slope;
        float *bytes;
        assert_int_equal(npg_buffer_open(&z, device, ROWS * NPG_LATENT_CHANNELS * sizeof(float)), 0);
        assert_int_equal(npg_buffer_from(&grid, device, nodes, size * sizeof(float)), 0);
        assert_int_equal(npg_buffer_open(&back, device, size * sizeof(float)), 0);
        assert_int_equal(npg_buffer_from(&slope, device, dz, ROWS * NPG_LATENT_CHANNELS * sizeof(float)), 0);
        assert_int_equal(npg_latent_sample(&latent, &z, &grid), 0);
        assert_int_equal(npg_latent_back(&latent, &back, &slope, &z), 0);
        assert_int_equal(npg_alloc_array(&bytes, NPG_FOR_RUN, size, sizeof *bytes), 0);
        assert_int_equal(npg_buffer_read(&back, 0, bytes, size * sizeof *bytes), 0);
        if (first) assert_memory_equal(first, bytes, size * sizeof *bytes);
        npg_release(&first);
        first = bytes;
        npg_buffer_close(&z);
        npg_buffer_close(&grid);
        npg_buffer_close(&back);
        npg_buffer_close(&slope);
    }
    npg_release(&first);
    npg_arena_release(&check.arena);
    npg_samples_close(&samples);
    npg_latent_close(&latent);
}

static void unknown_device_is_named(void **state)
{
    npg_device *none;
    (void)state;
    assert_int_equal(npg_device_open(&none, "no such device", NULL), NPG_DEVICE);
    assert_non_null(strstr(npg_error_text(), "no such device"));
    assert_null(none);
}

static void self_test_passes(void **state)
{
    (void)state;
    if (npg_kernels_self_test(device)) fail_msg("%s", npg_error_text());
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(self_test_passes),
        cmocka_unit_test(ops_agree_with_their_twins),
        cmocka_unit_test(ops_agree_with_the_parameters_of_other_devices),
        cmocka_unit_test(sampling_gives_equal_bytes),
        cmocka_unit_test(unknown_device_is_named),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
