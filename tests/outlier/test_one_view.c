/* One view: found from all sides for a body that one sensor saw, and for nothing else. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "outlier/outlier_internal.h"
#include "pipeline/memory.h"
#include "tests/support/shapes.h"

#define N             4000
#define AWAY          3.0 /* of the sensor, from the body's middle */
#define SIDES         12
#define WITHIN_COSINE 0.95 /* 18 degrees */

static float points[3 * N], normals[3 * N];

/* Round the body, not above or below it, where one part hides another. */
static void sensor_at(double sensor[3], int side)
{
    double z = 0.3 - 0.6 * side / (SIDES - 1), turn = 2.4 * side, r = sqrt(1 - z * z);
    sensor[0] = AWAY * r * cos(turn);
    sensor[1] = AWAY * r * sin(turn);
    sensor[2] = AWAY * z - 0.5;
}

/* Of the body what faces the sensor.  Returns how many. */
static size_t see(const double sensor[3])
{
    uint8_t keep[N];
    for (size_t i = 0; i < N; i++) {
        double facing = 0;
        for (size_t a = 0; a < 3; a++)
            facing += (double)normals[3 * i + a] * (sensor[a] - (double)points[3 * i + a]);
        keep[i] = facing > 0;
    }
    return npg_points_keep(points, normals, N, keep);
}

static void a_sensor_is_found_from_all_sides(void **state)
{
    (void)state;
    shape_random r = {3};
    for (int side = 0; side < SIDES; side++) {
        double sensor[3], place[3], wanted[3], got[3];
        bool found, sure;
        shape_limbs(points, normals, N, &r);
        sensor_at(sensor, side);
        assert_int_equal(npg_one_view_find(&found, &sure, place, points, see(sensor)), NPG_OK);
        assert_true(found);
        for (int a = 0; a < 3; a++) {
            double middle = a == 2 ? -0.5 : 0;
            wanted[a] = sensor[a] - middle;
            got[a] = place[a] - middle;
        }
        npg_vec3_make_unit(wanted);
        npg_vec3_make_unit(got);
        assert_true(npg_vec3_dot(wanted, got) > WITHIN_COSINE);
    }
}

static void expect_none(size_t count, bool may_be)
{
    double place[3];
    bool found, sure;
    assert_int_equal(npg_one_view_find(&found, &sure, place, points, count), NPG_OK);
    assert_false(sure);
    assert_false(found && !may_be);
}

static void a_whole_body_has_none(void **state)
{
    (void)state;
    shape_random r = {5};
    shape_limbs(points, normals, N, &r);
    expect_none(N, false);
    for (size_t i = 0; i < 3 * N; i++) points[i] += (float)(0.01 * shape_gauss(&r)); /* nor with noise */
    expect_none(N, false);
}

static void a_flat_sheet_has_none_for_sure(void **state)
{
    (void)state;
    shape_random r = {7};
    for (size_t i = 0; i < N; i++)
        shape_put(points + 3 * i, shape_uniform(&r), shape_uniform(&r), 0.002 * shape_gauss(&r));
    expect_none(N, true);
}

static void few_points_have_none(void **state)
{
    (void)state;
    shape_random r = {9};
    shape_sphere(points, normals, 40, 1, &r);
    expect_none(40, false);
    expect_none(0, false);
    for (size_t i = 0; i < 3 * N; i++) points[i] = 1; /* nor those in one place */
    expect_none(N, false);
}

static void without_memory_it_says_so(void **state)
{
    (void)state;
    double sensor[3], place[3];
    bool found, sure;
    shape_random r = {11};
    shape_limbs(points, normals, N, &r);
    sensor_at(sensor, 4);
    size_t seen = see(sensor);
    for (uint64_t n = 1; n <= 2; n++) {
        npg_memory_fail_at(n, false);
        assert_int_equal(npg_one_view_find(&found, &sure, place, points, seen), NPG_MEMORY);
        assert_false(found);
    }
    npg_memory_fail_at(0, false);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sensor_is_found_from_all_sides), cmocka_unit_test(a_whole_body_has_none),
        cmocka_unit_test(a_flat_sheet_has_none_for_sure),   cmocka_unit_test(few_points_have_none),
        cmocka_unit_test(without_memory_it_says_so),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
