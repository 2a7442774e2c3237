/* Follow normals: bumps of a mesh go where the points' normals say so, and its size and thin parts stay. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/geometry.h"
#include "mesh/mesh_internal.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/shapes.h"

#define BUMPS 0.004 /* standard deviation; an edge is 0.05 long */

/* A ball that is `flat` as high as wide, with its true normals. */
static npg_mesh *flat_ball(uint32_t rings, double flat)
{
    npg_mesh *mesh = ball_mesh(rings, 2 * rings);
    for (size_t v = 0; v < mesh->vert_count; v++) {
        float *at = mesh->vert_pos + 3 * v, *n = mesh->vert_normals + 3 * v;
        shape_put(n, (double)at[0] / 0.25, (double)at[1] / 0.16, (double)at[2] / 0.25 / flat);
        npg_vec3_make_unitf(n);
        at[2] *= (float)flat;
    }
    return mesh;
}

static void add_bumps(npg_mesh *mesh)
{
    shape_random r = {3};
    for (size_t v = 0; v < mesh->vert_count; v++) {
        double by = BUMPS * shape_gauss(&r);
        for (size_t a = 0; a < 3; a++) mesh->vert_pos[3 * v + a] += (float)by * mesh->vert_normals[3 * v + a];
    }
}

/* Mean 1 - cos between the faces' normals and those of the smooth ball. */
static double slope_error(const npg_mesh *mesh, const npg_mesh *smooth)
{
    double sum = 0;
    for (size_t f = 0; f < mesh->face_count; f++) {
        double now[3], true_normal[3];
        npg_face_normal(now, mesh->vert_pos, mesh->faces + 3 * f);
        npg_face_normal(true_normal, smooth->vert_pos, mesh->faces + 3 * f);
        sum += 1 - npg_vec3_dot(now, true_normal);
    }
    return sum / (double)mesh->face_count;
}

/* Of the vertices across the smooth ball: root mean square, and mean (what shrinks is below 0). */
static double offset(const npg_mesh *mesh, const npg_mesh *smooth, double *mean)
{
    double sum_sq = 0;
    *mean = 0;
    for (size_t v = 0; v < mesh->vert_count; v++) {
        double way[3], off = 0;
        npg_vec3_between(way, smooth->vert_pos + 3 * v, mesh->vert_pos + 3 * v);
        for (size_t a = 0; a < 3; a++) off += way[a] * (double)smooth->vert_normals[3 * v + a];
        sum_sq += off * off;
        *mean += off / (double)mesh->vert_count;
    }
    return sqrt(sum_sq / (double)mesh->vert_count);
}

static void check_ball(double flat)
{
    npg_mesh *smooth = flat_ball(30, flat), *points = flat_ball(60, flat), *mesh;
    double mean_before, mean;
    assert_int_equal(npg_mesh_copy(&mesh, smooth), NPG_OK);
    add_bumps(mesh);
    double slope_before = slope_error(mesh, smooth), off_before = offset(mesh, smooth, &mean_before);
    assert_int_equal(npg_mesh_denoise(mesh, points->vert_pos, points->vert_normals, points->vert_count),
                     NPG_OK);
    double slope = slope_error(mesh, smooth), off = offset(mesh, smooth, &mean);
    print_message("flat %g: slope %.5f -> %.5f, offset %.5f -> %.5f, mean %.6f -> %.6f\n", flat, slope_before,
                  slope, off_before, off, mean_before, mean);
    assert_true(slope < 0.3 * slope_before);
    assert_true(off < 0.7 * off_before);
    assert_true(fabs(mean - mean_before) < 0.05 * BUMPS);
    npg_mesh_unref(&mesh);
    npg_mesh_unref(&points);
    npg_mesh_unref(&smooth);
}

static void bumps_go_and_the_size_stays(void **state)
{
    (void)state;
    check_ball(1);
    check_ball(0.25);
    assert_int_equal(npg_memory_used(), 0);
}

/* Points of the other side of a sheet, or far off, have no say. */
static void points_that_face_away_or_lie_far_say_nothing(void **state)
{
    npg_mesh *smooth = flat_ball(30, 1), *away = flat_ball(60, 1), *mesh[2];
    (void)state;
    for (size_t i = 0; i < 3 * away->vert_count; i++) away->vert_normals[i] *= -1;
    for (int far = 0; far < 2; far++) {
        for (size_t i = 0; i < 3 * away->vert_count && far; i++) away->vert_pos[i] += 5;
        assert_int_equal(npg_mesh_copy(&mesh[far], smooth), NPG_OK);
        add_bumps(mesh[far]);
        assert_int_equal(npg_mesh_denoise(mesh[far], away->vert_pos, away->vert_normals, away->vert_count),
                         NPG_OK);
        double kept;
        assert_true(offset(mesh[far], smooth, &kept) > 0.95 * BUMPS);
    }
    assert_memory_equal(mesh[0]->vert_pos, mesh[1]->vert_pos, 3 * sizeof(float) * mesh[0]->vert_count);
    for (int far = 0; far < 2; far++) npg_mesh_unref(&mesh[far]);
    npg_mesh_unref(&away);
    npg_mesh_unref(&smooth);
}

static npg_status follow_with_failure(const npg_mesh *from, uint64_t n)
{
    npg_mesh *mesh;
    assert_int_equal(npg_mesh_copy(&mesh, from), NPG_OK);
    npg_memory_fail_at(n, false);
    npg_status status = npg_mesh_denoise(mesh, from->vert_pos, from->vert_normals, from->vert_count);
    npg_memory_fail_at(0, false);
    npg_mesh_unref(&mesh);
    return status;
}

static void memory_that_fails_is_reported(void **state)
{
    npg_mesh *ball = flat_ball(10, 1);
    size_t used = npg_memory_used();
    uint64_t n = 1;
    (void)state;
    for (; follow_with_failure(ball, n) == NPG_MEMORY; n++) assert_int_equal(npg_memory_used(), used);
    assert_true(n > 8);
    assert_int_equal(follow_with_failure(ball, n), NPG_OK);
    npg_mesh_unref(&ball);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bumps_go_and_the_size_stays),
        cmocka_unit_test(points_that_face_away_or_lie_far_say_nothing),
        cmocka_unit_test(memory_that_fails_is_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
