/* Densify: thin parts get points of their surface between those given, all else stays; what a thin part's
 * other side is away is no noise. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "mesh/mesh_internal.h"
#include "pipeline/memory.h"
#include "tests/support/shapes.h"

#define BODY   3000
#define ROD    60 /* points: as few as the ball has on the same area */
#define RADIUS 0.018
#define LENGTH 0.5
#define N      (BODY + ROD)

static float points[3 * N], normals[3 * N];

/* A ball of radius 0.4, and from its pole a rod as thin as its points are apart. */
static void put_body(shape_random *r)
{
    shape_sphere(points, normals, BODY, 0.4, r);
    for (size_t i = BODY; i < N; i++) {
        double turn = 6.283185307 * shape_uniform(r), along = LENGTH * shape_uniform(r);
        shape_put(normals + 3 * i, cos(turn), sin(turn), 0);
        shape_put(points + 3 * i, RADIUS * cos(turn), RADIUS * sin(turn), 0.4 + along);
    }
}

static void thin_parts_get_points_on_their_surface(void **state)
{
    (void)state;
    shape_random r = {5};
    double spacing, off = 0;
    float *dense, *dense_normals;
    size_t count;
    put_body(&r);
    assert_int_equal(npg_cloud_spacing(&spacing, points, N), NPG_OK);
    assert_int_equal(npg_cloud_densify(&dense, &dense_normals, &count, points, normals, N, spacing), NPG_OK);
    assert_memory_equal(dense, points, sizeof points);
    assert_memory_equal(dense_normals, normals, sizeof normals);
    size_t on_rod = 0;
    for (size_t i = N; i < count; i++) {
        const float *p = dense + 3 * i, *n = dense_normals + 3 * i;
        if (p[2] < 0.45F) continue; /* the ball, or where the rod leaves it */
        double ring = hypot((double)p[0], (double)p[1]);
        assert_true(((double)(p[0] * n[0]) + (double)(p[1] * n[1])) / ring > 0.9);
        off += fabs(ring - RADIUS);
        on_rod++;
    }
    assert_true(on_rod > ROD);
    assert_true(off / (double)on_rod < 0.1 * RADIUS);
    assert_true(count - N - on_rod < BODY / 20);
    npg_release(&dense);
    npg_release(&dense_normals);
}

static void what_is_not_thin_stays(void **state)
{
    (void)state;
    shape_random r = {6};
    double spacing;
    float *dense, *dense_normals;
    size_t count;
    shape_sphere(points, normals, N, 0.4, &r);
    assert_int_equal(npg_cloud_spacing(&spacing, points, N), NPG_OK);
    assert_int_equal(npg_cloud_densify(&dense, &dense_normals, &count, points, normals, N, spacing), NPG_OK);
    assert_int_equal(count, N);
    assert_memory_equal(dense, points, sizeof points);
    assert_memory_equal(dense_normals, normals, sizeof normals);
    npg_release(&dense);
    npg_release(&dense_normals);
}

static void a_thin_part_is_not_noisy(void **state)
{
    (void)state;
    shape_random r = {7};
    const double plate[3] = {0.5, 0.5, 0.004};
    double without, with, on_flat;
    shape_box(points, normals, 2 * N / 3, plate, &r);
    shape_sphere(points + 3 * (2 * N / 3), normals + 3 * (2 * N / 3), N - 2 * N / 3, 3, &r);
    assert_int_equal(npg_cloud_noise(&without, points, NULL, N), NPG_OK);
    assert_int_equal(npg_cloud_noise(&with, points, normals, N), NPG_OK);
    assert_true(without > 0.002);
    assert_true(with < 0.2 * without);
    /* nothing but thin parts: all are asked */
    shape_box(points, normals, N, plate, &r);
    assert_int_equal(npg_cloud_noise(&on_flat, points, normals, N), NPG_OK);
    assert_true(on_flat > 0.002);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(thin_parts_get_points_on_their_surface),
                                       cmocka_unit_test(what_is_not_thin_stays),
                                       cmocka_unit_test(a_thin_part_is_not_noisy)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
