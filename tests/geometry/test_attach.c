/* Attach: points carried by a surface that moves rigidly, bends, and has two sides near each other. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/memory.h"
#include "tests/support/shapes.h"

#define RINGS  24
#define AROUND 32
#define N      500

static const double pi = 3.14159265358979323846;
static npg_mesh *ball;
static float points[3 * N], normals[3 * N], moved_normals[3 * N];
static double moved[3 * N];

/* A closed ball of radius 1: rings between two poles. */
static int make_ball(void **state)
{
    (void)state;
    const size_t verts = (RINGS - 1) * AROUND + 2, faces = 2 * AROUND * (RINGS - 1);
    if (npg_mesh_open(&ball, verts, faces)) return -1;
    uint32_t *face = ball->faces, top = (uint32_t)verts - 2, bottom = top + 1;
    for (size_t r = 1; r < RINGS; r++)
        for (size_t i = 0; i < AROUND; i++) {
            double polar = pi * (double)r / RINGS, turn = 2 * pi * (double)i / AROUND;
            shape_put(ball->vert_pos + 3 * ((r - 1) * AROUND + i), sin(polar) * cos(turn),
                      sin(polar) * sin(turn), cos(polar));
        }
    shape_put(ball->vert_pos + 3 * top, 0, 0, 1);
    shape_put(ball->vert_pos + 3 * bottom, 0, 0, -1);
    for (uint32_t r = 0; r < RINGS; r++)
        for (uint32_t i = 0; i < AROUND; i++) {
            uint32_t j = (i + 1) % AROUND, up = (r - 1) * AROUND, down = r * AROUND;
            uint32_t upper[3] = {up + i, down + i, up + j}, lower[3] = {up + j, down + i, down + j};
            if (r == 0) memcpy(face, (uint32_t[]){top, i, j}, 12), face += 3;
            if (r == RINGS - 1) memcpy(face, (uint32_t[]){up + i, bottom, up + j}, 12), face += 3;
            if (r == 0 || r == RINGS - 1) continue;
            memcpy(face, upper, 12);
            memcpy(face + 3, lower, 12);
            face += 6;
        }
    return face == ball->faces + 3 * faces ? 0 : -1;
}

static int drop_ball(void **state)
{
    (void)state;
    npg_mesh_unref(&ball);
    return 0;
}

/* Points within 30 % of the surface, inside and outside, with normals of any direction. */
static void scatter(void)
{
    shape_random r = {5};
    shape_sphere(points, normals, N, 1, &r);
    for (size_t i = 0; i < N; i++) {
        double factor = 0.7 + 0.6 * shape_uniform(&r), n[3], length;
        for (size_t a = 0; a < 3; a++) points[3 * i + a] *= (float)factor;
        for (int a = 0; a < 3; a++) n[a] = shape_gauss(&r);
        length = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        shape_put(normals + 3 * i, n[0] / sqrt(length), n[1] / sqrt(length), n[2] / sqrt(length));
    }
}

static void turn(double out[3], const float *v)
{
    static const double rows[3][3] = {{0.36, 0.48, -0.8}, {-0.8, 0.6, 0}, {0.48, 0.64, 0.6}};
    for (int a = 0; a < 3; a++)
        out[a] = rows[a][0] * (double)v[0] + rows[a][1] * (double)v[1] + rows[a][2] * (double)v[2];
}

static void a_rigid_motion_is_followed_exactly(void **state)
{
    (void)state;
    static float pose[3 * ((RINGS - 1) * AROUND + 2)];
    const double shift[3] = {1.5, -2, 0.25};
    npg_attachment *t;
    scatter();
    for (size_t i = 0; i < ball->vert_count; i++) {
        double p[3];
        turn(p, ball->vert_pos + 3 * i);
        shape_put(pose + 3 * i, p[0] + shift[0], p[1] + shift[1], p[2] + shift[2]);
    }
    assert_int_equal(npg_attach_open(&t, ball, points, normals, N), NPG_OK);
    assert_int_equal(npg_attach_move(t, pose, moved, moved_normals), NPG_OK);
    for (size_t i = 0; i < N; i++) {
        double p[3], n[3];
        turn(p, points + 3 * i);
        turn(n, normals + 3 * i);
        for (size_t a = 0; a < 3; a++) {
            assert_true(fabs(moved[3 * i + a] - p[a] - shift[a]) < 1e-5);
            assert_true(fabs((double)moved_normals[3 * i + a] - n[a]) < 1e-5);
        }
    }
    npg_attach_close(&t);
}

static void the_rest_pose_gives_the_points_back(void **state)
{
    (void)state;
    npg_attachment *t;
    scatter();
    assert_int_equal(npg_attach_open(&t, ball, points, NULL, N), NPG_OK);
    assert_int_equal(npg_attach_move(t, ball->vert_pos, moved, NULL), NPG_OK);
    for (size_t i = 0; i < 3 * N; i++) assert_true(fabs(moved[i] - (double)points[i]) < 1e-6);
    assert_int_equal(npg_attach_move(t, ball->vert_pos, moved, moved_normals), NPG_USAGE);
    npg_attach_close(&t);
}

static void far_points_are_counted(void **state)
{
    (void)state;
    npg_attachment *t;
    const float few[] = {0, 0, 1, 0, 0, 3, 0, 0, -1.5f};
    size_t count, worst;
    double dist;
    assert_int_equal(npg_attach_open(&t, ball, few, NULL, 3), NPG_OK);
    npg_attach_far(t, 0.1, &count, &worst, &dist);
    assert_int_equal(count, 2);
    assert_int_equal(worst, 1);
    assert_true(fabs(dist - 2) < 1e-5);
    npg_attach_close(&t);
}

#define ACROSS 5
#define ALONG  41

/* A strip in x = 0..4, y = -0.4..0.4 at a height, its normals up or, mirrored, down. */
static void add_strip(npg_mesh *mesh, size_t first, float height, bool is_up)
{
    uint32_t *face = mesh->faces + 6 * (ACROSS - 1) * (ALONG - 1) * (first > 0);
    for (size_t i = 0; i < ALONG; i++)
        for (size_t j = 0; j < ACROSS; j++)
            shape_put(mesh->vert_pos + 3 * (first + i * ACROSS + j), 0.1 * (double)i, 0.2 * (double)j - 0.4,
                      (double)height);
    for (uint32_t i = 0; i + 1 < ALONG; i++)
        for (uint32_t j = 0; j + 1 < ACROSS; j++) {
            uint32_t v = (uint32_t)first + i * ACROSS + j, w = v + ACROSS;
            uint32_t two[6] = {v, w, w + 1, v, w + 1, v + 1};
            if (!is_up) memcpy(two, (uint32_t[]){v, w + 1, w, v, v + 1, w + 1}, sizeof two);
            memcpy(face, two, sizeof two);
            face += 6;
        }
}

/* The strip rolled up around the line x = 0, z = 2: x becomes the arc, z the distance
 * from the arc inwards. */
static void roll(double out[3], double x, double y, double z)
{
    out[0] = (2 - z) * sin(x / 2);
    out[1] = y;
    out[2] = 2 - (2 - z) * cos(x / 2);
}

static void a_bend_keeps_distance_and_turns_normals(void **state)
{
    (void)state;
    npg_mesh *strip;
    npg_attachment *t;
    static float pose[3 * ACROSS * ALONG];
    shape_random r = {11};
    assert_int_equal(npg_mesh_open(&strip, ACROSS * ALONG, 2 * (ACROSS - 1) * (ALONG - 1)), NPG_OK);
    add_strip(strip, 0, 0, true);
    for (size_t i = 0; i < ACROSS * ALONG; i++) {
        const float *p = strip->vert_pos + 3 * i;
        double q[3];
        roll(q, (double)p[0], (double)p[1], (double)p[2]);
        shape_put(pose + 3 * i, q[0], q[1], q[2]);
    }
    for (size_t i = 0; i < N; i++) {
        shape_put(points + 3 * i, 0.2 + 3.6 * shape_uniform(&r), 0.7 * shape_uniform(&r) - 0.35,
                  0.3 * shape_uniform(&r) - 0.15);
        shape_put(normals + 3 * i, 0, 0, 1);
    }
    assert_int_equal(npg_attach_open(&t, strip, points, normals, N), NPG_OK);
    assert_int_equal(npg_attach_move(t, pose, moved, moved_normals), NPG_OK);
    for (size_t i = 0; i < N; i++) {
        double q[3], x = (double)points[3 * i];
        roll(q, x, (double)points[3 * i + 1], (double)points[3 * i + 2]);
        /* rotations are averaged over two rings, on a border not around the vertex: off by 0.02 where an edge
         * turns by 0.05 */
        for (size_t a = 0; a < 3; a++) assert_true(fabs(moved[3 * i + a] - q[a]) < 4e-3);
        assert_true(fabs((double)moved_normals[3 * i] + sin(x / 2)) < 0.03);
        assert_true(fabs((double)moved_normals[3 * i + 2] - cos(x / 2)) < 0.03);
    }
    npg_attach_close(&t);
    npg_mesh_unref(&strip);
}

/* Two sheets 0.02 apart; points a little nearer to the wrong one follow the one their normal looks along. */
static void normals_choose_the_side_of_a_thin_part(void **state)
{
    (void)state;
    npg_mesh *plate;
    npg_attachment *t;
    const size_t half = ACROSS * ALONG;
    static float pose[6 * ACROSS * ALONG];
    const float on[] = {1.03f, 0.11f, 0.008f, 2.02f, 0.13f, 0.012f}, look[] = {0, 0, 1, 0, 0, -1};
    assert_int_equal(npg_mesh_open(&plate, 2 * half, 4 * (ACROSS - 1) * (ALONG - 1)), NPG_OK);
    add_strip(plate, 0, 0, false);
    add_strip(plate, half, 0.02f, true);
    memcpy(pose, plate->vert_pos, sizeof pose);
    for (size_t i = half; i < 2 * half; i++) pose[3 * i + 2] += 1; /* the upper sheet rises */
    assert_int_equal(npg_attach_open(&t, plate, on, look, 2), NPG_OK);
    assert_int_equal(npg_attach_move(t, pose, moved, NULL), NPG_OK);
    assert_true(fabs(moved[2] - 1.008) < 1e-5);
    assert_true(fabs(moved[5] - 0.012) < 1e-5);
    npg_attach_close(&t);
    npg_mesh_unref(&plate);
}

static void bad_points_are_named(void **state)
{
    (void)state;
    npg_attachment *t;
    const float bad[] = {0, 0, 1, 0, NAN, 1};
    assert_int_equal(npg_attach_open(&t, ball, bad, NULL, 2), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "point 1"));
    assert_null(t);
}

static void every_failed_allocation_is_said_and_leaves_nothing(void **state)
{
    (void)state;
    scatter();
    size_t before = npg_memory_used();
    npg_status status = NPG_MEMORY;
    uint64_t n = 0;
    while (status == NPG_MEMORY && n < 100) {
        npg_attachment *t;
        npg_memory_fail_at(++n, true);
        status = npg_attach_open(&t, ball, points, normals, N);
        npg_memory_fail_at(0, false);
        npg_attach_close(&t);
        assert_int_equal(npg_memory_used(), before);
    }
    assert_int_equal(status, NPG_OK);
    assert_true(n > 5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_rigid_motion_is_followed_exactly),
                                       cmocka_unit_test(the_rest_pose_gives_the_points_back),
                                       cmocka_unit_test(far_points_are_counted),
                                       cmocka_unit_test(a_bend_keeps_distance_and_turns_normals),
                                       cmocka_unit_test(normals_choose_the_side_of_a_thin_part),
                                       cmocka_unit_test(bad_points_are_named),
                                       cmocka_unit_test(every_failed_allocation_is_said_and_leaves_nothing)};
    return cmocka_run_group_tests(tests, make_ball, drop_ball);
}
