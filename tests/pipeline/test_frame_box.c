/* Frame box: world, local and unit coordinates, also far from the origin; boxes that can not be. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "pipeline/frame_box.h"

static void coordinates_go_there_and_back(void **state)
{
    (void)state;
    const double offsets[] = {0, 1e3, -1e6, 5e6};
    for (size_t o = 0; o < 4; o++) {
        npg_origin origin = {0};
        npg_bounds bounds = npg_bounds_empty();
        double world[300];
        float local[300], unit[300];
        for (size_t i = 0; i < 100; i++) { /* 2 m x 1 m x 0.5 m with millimetre detail */
            world[3 * i] = offsets[o] + 0.02 * (double)i;
            world[3 * i + 1] = offsets[o] * 2 + 0.001 * (double)(i * 37 % 1000);
            world[3 * i + 2] = -offsets[o] + 0.5 * sin((double)i);
        }
        npg_origin_offer(&origin, world);
        npg_origin_offer(&origin, world + 3); /* too late */
        assert_true(origin.known && origin.world[0] == world[0]);
        for (size_t i = 0; i < 300; i++) local[i] = (float)(world[i] - origin.world[i % 3]);
        npg_bounds_add_points(&bounds, local, 100);
        npg_frame_box box;
        assert_int_equal(npg_frame_box_set(&box, &origin, &bounds), NPG_OK);
        npg_box_local_to_unit(&box, unit, local, 100);
        double back[300], most = 0;
        npg_box_unit_to_world(&box, back, unit, 100);
        for (size_t i = 0; i < 300; i++) {
            assert_true(fabs(back[i] - world[i]) < 1e-6);
            most = fmax(most, fabs((double)unit[i]));
        }
        assert_true(fabs(most - NPG_UNIT_EXTENT) < 1e-6);
        npg_box_local_to_unit(&box, local, local, 100); /* in place */
        for (size_t i = 0; i < 300; i++) assert_true(local[i] == unit[i]);
    }
}

static void the_longest_side_fills_the_unit_box(void **state)
{
    (void)state;
    npg_origin origin = {.known = true, .world = {100, 200, 300}};
    npg_bounds bounds = {{-1, 2, 5}, {3, 3, 5}}; /* flat in z */
    npg_frame_box box;
    float unit[3];
    double world[3];
    assert_int_equal(npg_frame_box_set(&box, &origin, &bounds), NPG_OK);
    npg_box_local_to_unit(&box, unit, (const float[]){3, 3, 5}, 1);
    assert_true(fabsf(unit[0] - 0.95f) < 1e-6f);
    assert_true(fabsf(unit[1] - 0.2375f) < 1e-6f);
    assert_true(unit[2] == 0);
    npg_box_unit_to_world(&box, world, unit, 1);
    assert_true(fabs(world[0] - 103) < 1e-6 && fabs(world[1] - 203) < 1e-6 && fabs(world[2] - 305) < 1e-6);
    assert_true(fabs(box.diagonal - sqrt(17.0)) < 1e-12);
}

static void boxes_that_can_not_be_are_refused(void **state)
{
    (void)state;
    npg_origin origin = {.known = true};
    npg_frame_box box;
    npg_bounds empty = npg_bounds_empty(), point = {{1, 1, 1}, {1, 1, 1}},
               infinite = {{0, 0, 0}, {1, 1, (double)INFINITY}}, tiny = {{0, 0, 0}, {0, NPG_SIDE_MIN / 2, 0}},
               huge = {{0, 0, 0}, {0, 0, NPG_SIDE_MAX * 2}};
    assert_int_equal(npg_frame_box_set(&box, &origin, &empty), NPG_BAD_INPUT);
    assert_int_equal(npg_frame_box_set(&box, &origin, &point), NPG_BAD_INPUT);
    assert_int_equal(npg_frame_box_set(&box, &origin, &infinite), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "no frame has a usable point"));
    assert_int_equal(npg_frame_box_set(&box, &origin, &tiny), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "another unit"));
    assert_int_equal(npg_frame_box_set(&box, &origin, &huge), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "another unit"));
    assert_true(npg_bounds_diagonal(&empty) == 0);
}

static void bounds_add_up(void **state)
{
    (void)state;
    npg_bounds a = npg_bounds_empty(), b = npg_bounds_empty();
    npg_bounds_add_points(&a, (const float[]){1, 2, 3, -1, 5, 0}, 2);
    npg_bounds_add_points(&b, (const float[]){0, 9, (float)NAN}, 1);
    npg_bounds_add(&a, &b);
    assert_true(a.lo[0] == -1 && a.hi[0] == 1 && a.lo[1] == 2 && a.hi[1] == 9 && a.lo[2] == 0 &&
                a.hi[2] == 3);
    npg_bounds nothing = npg_bounds_empty(), before = a;
    npg_bounds_add(&a, &nothing);
    assert_memory_equal(&a, &before, sizeof a);
}

static void an_origin_must_be_finite(void **state)
{
    (void)state;
    npg_origin origin = {0};
    npg_origin_offer(&origin, (const double[]){1, (double)NAN, 2});
    npg_origin_offer(&origin, (const double[]){(double)INFINITY, 0, -(double)INFINITY});
    assert_false(origin.known);
    npg_origin_offer(&origin, (const double[]){1, 2, 3});
    assert_true(origin.known && origin.world[2] == 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(coordinates_go_there_and_back),
        cmocka_unit_test(the_longest_side_fills_the_unit_box),
        cmocka_unit_test(boxes_that_can_not_be_are_refused),
        cmocka_unit_test(bounds_add_up),
        cmocka_unit_test(an_origin_must_be_finite),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
