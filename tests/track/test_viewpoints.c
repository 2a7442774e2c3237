/* Viewpoints: of a ball, by the points on it: those that sensors around it saw are seen from around it, those all over
 * it from all sides; one side from one; and what is inside is seen from nowhere. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "pipeline/memory.h"
#include "tests/support/ball_mesh.h"
#include "track/track.h"

#define OFFSET 0.02

/* The points with a height between the two, of a ball whose height is 2, drawn in by `scale`.  bare: of the rest the half
 * on that side along y is marked as unseen; 0: nothing is. */
static npg_viewpoints of_half(float low, float high, float scale, float bare)
{
    static float points[3 * 4000], normals[3 * 4000];
    npg_mesh *ball = ball_mesh(39, 80);
    npg_viewpoints found;
    size_t count = 0;
    assert_int_equal(npg_alloc(&ball->vert_unseen, NPG_FOR_MESH, ball->vert_count), NPG_OK);
    for (size_t i = 0; i < ball->vert_count; i++) {
        const float *p = ball->vert_pos + 3 * i;
        float length = sqrtf(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
        if (p[2] / length < low || p[2] / length > high) {
            ball->vert_unseen[i] = p[1] * bare > 0;
            continue;
        }
        for (size_t a = 0; a < 3; a++) {
            points[3 * count + a] = scale * p[a];
            normals[3 * count + a] = p[a] / length;
        }
        count++;
    }
    assert_int_equal(npg_viewpoints_find(&found, ball, points, normals, count, OFFSET), NPG_OK);
    npg_mesh_unref(&ball);
    return found;
}

static npg_viewpoints of_ball(float low, float high, float scale)
{
    return of_half(low, high, scale, 0);
}

static double height_most(const npg_viewpoints *v)
{
    double most = 0;
    for (size_t k = 0; k < v->count; k++) most = fmax(most, fabs(v->directions[3 * k + 2]));
    return most;
}

static void points_around_are_seen_from_around(void **state)
{
    (void)state;
    npg_viewpoints belt = of_ball(-0.5f, 0.5f, 1);
    assert_true(belt.count >= 3 && belt.count <= 6);
    assert_true(height_most(&belt) < 0.6);
    assert_false(belt.sees_hidden);
}

/* A cap is seen from many sides: from where the least of what has no points is seen with it. */
static void bare_surface_is_looked_past(void **state)
{
    (void)state;
    for (int side = -1; side <= 1; side += 2) {
        npg_viewpoints cap = of_half(0.8f, 1, 1, (float)side);
        assert_int_equal(cap.count, 1);
        assert_true(side * cap.directions[1] < -0.2 && cap.directions[2] > 0.5);
    }
}

static void points_of_one_side_are_seen_from_there(void **state)
{
    (void)state;
    npg_viewpoints side = of_ball(0.4f, 1, 1);
    assert_int_equal(side.count, 1);
    assert_true(side.directions[2] > 0.9);
    assert_false(side.sees_hidden);
}

static void points_all_over_are_seen_from_all_sides(void **state)
{
    (void)state;
    npg_viewpoints all = of_ball(-1, 1, 1);
    double low = 1, high = -1;
    for (size_t k = 0; k < all.count; k++) {
        low = fmin(low, all.directions[3 * k + 2]);
        high = fmax(high, all.directions[3 * k + 2]);
    }
    assert_true(all.count >= 4 && low < -0.2 && high > 0.2);
    assert_false(all.sees_hidden);
}

static void points_inside_are_seen_from_nowhere(void **state)
{
    (void)state;
    npg_viewpoints none = of_ball(-1, 1, 0.7f);
    assert_true(none.sees_hidden);
    assert_int_equal(none.count, 0);
}

/* 1.5 diagonals, here of length 1, from the middle of the points. */
static void places_are_around_the_points(void **state)
{
    (void)state;
    const float points[] = {1, 2, 3, 1, 2, 4};
    const npg_viewpoints one = {.count = 1, .directions = {0, 1, 0}};
    float sensor[3];
    npg_viewpoints_place(sensor, &one, points, 2);
    assert_true(sensor[0] == 1 && sensor[1] == 3.5f && sensor[2] == 3.5f);
}

static void refused_memory_is_survived(void **state)
{
    (void)state;
    npg_mesh *ball = ball_mesh(9, 12);
    npg_viewpoints found;
    size_t before = npg_memory_used();
    uint64_t n = 1;
    for (npg_status status = NPG_MEMORY; status; n++) {
        npg_memory_fail_at(n, true);
        status = npg_viewpoints_find(&found, ball, ball->vert_pos, ball->vert_pos, ball->vert_count, OFFSET);
        npg_memory_fail_at(0, false);
        assert_true(!status || status == NPG_MEMORY);
        assert_int_equal(npg_memory_used(), before);
    }
    assert_true(n > 4);
    npg_mesh_unref(&ball);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_around_are_seen_from_around),
        cmocka_unit_test(bare_surface_is_looked_past),
        cmocka_unit_test(points_of_one_side_are_seen_from_there),
        cmocka_unit_test(points_all_over_are_seen_from_all_sides),
        cmocka_unit_test(points_inside_are_seen_from_nowhere),
        cmocka_unit_test(places_are_around_the_points),
        cmocka_unit_test(refused_memory_is_survived),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
