/* Unseen: the mask of surface without points, what sensors could not see of it, its share and place; and which of it
 * would have been seen. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "geometry/geometry.h"
#include "mesh/mesh_internal.h"
#include "pipeline/memory.h"
#include "tests/support/ball_mesh.h"

static const float sensor[3] = {0, 0, 50};

/* Points on the upper half of the ball's vertices, but for a cap of the sensor's side. */
static npg_status mark(npg_mesh *mesh, float cap)
{
    static float points[3 * 2000];
    size_t count = 0;
    for (size_t i = 0; i < mesh->vert_count; i++) {
        const float *p = mesh->vert_pos + 3 * i;
        if (p[2] < 0 || p[2] > cap) continue;
        for (size_t a = 0; a < 3; a++) points[3 * count + a] = p[a];
        count++;
    }
    return npg_mesh_mark_unseen(mesh, points, count, 0.01);
}

static void the_side_away_from_the_sensor_is_excused(void **state)
{
    (void)state;
    npg_mesh *mesh = ball_mesh(29, 60);
    npg_patch largest;
    double share;
    assert_int_equal(mark(mesh, 1), NPG_OK);
    assert_int_equal(npg_unseen_measure(&share, &largest, mesh), NPG_OK);
    assert_true(share > 0.4 && share < 0.55 && largest.at[2] < -0.2f);
    assert_int_equal(npg_unseen_excuse(mesh, sensor, 1, 0.01), NPG_OK);
    assert_int_equal(npg_unseen_measure(&share, &largest, mesh), NPG_OK);
    assert_true(share == 0 && largest.share == 0);
    npg_mesh_unref(&mesh);
}

/* Without points where the sensor looks, it is not. */
static void surface_before_the_sensor_is_not_excused(void **state)
{
    (void)state;
    npg_mesh *mesh = ball_mesh(29, 60);
    npg_patch largest;
    double share;
    assert_int_equal(mark(mesh, 0.4f), NPG_OK);
    assert_int_equal(npg_unseen_excuse(mesh, sensor, 1, 0.01), NPG_OK);
    assert_int_equal(npg_unseen_measure(&share, &largest, mesh), NPG_OK);
    assert_true(share > 0.05 && share < 0.15); /* a cap of a fifth of the height of a ball: about a tenth */
    assert_true(largest.share == share && largest.at[2] > 0.4f);
    npg_mesh_unref(&mesh);
}

/* ---- what would have been seen ---- */

/* Of the vertices of a ball those that are points of the keyframe and of all frames. */
typedef bool is_point(const float *unit);

/* The share that goes; and `inside` points of a smaller ball. */
static double trimmed_of(is_point *of_all, size_t inside)
{
    static float points[3 * 5000], normals[3 * 5000];
    npg_mesh *mesh = ball_mesh(47, 80);
    npg_point_set set = {.points = points,
                         .key_points = points,
                         .key_normals = normals,
                         .diagonal = 1,
                         .seen_dist = 0.05,
                         .key_spacing = 0.025};
    size_t faces = mesh->face_count;
    double share;
    for (size_t i = 0; i < mesh->vert_count + inside; i++) {
        const float *p = mesh->vert_pos + 3 * (i < inside ? i * mesh->vert_count / inside : i - inside);
        float length = (float)npg_vec3_lengthf(p);
        const float unit[3] = {p[0] / length, p[1] / length, p[2] / length};
        if (!of_all(unit)) continue;
        for (size_t a = 0; a < 3; a++) {
            points[3 * set.count + a] = i < inside ? p[a] / 2 : p[a];
            normals[3 * set.count + a] = unit[a];
        }
        set.count++;
    }
    set.key_count = set.count;
    assert_int_equal(npg_mesh_trim_expected(&mesh, &share, &set), NPG_OK);
    assert_true(share > 0 ? mesh->face_count < faces : mesh->face_count == faces);
    npg_mesh_unref(&mesh);
    return share;
}

static bool is_anywhere(const float *unit)
{
    (void)unit;
    return true;
}

static bool is_beside_a_hole(const float *unit)
{
    return unit[0] < 0.93f;
}

/* As sensors see it that stand around it. */
static bool is_seen_from_around(const float *unit)
{
    return fabsf(unit[2]) < 0.8f;
}

static bool is_seen_beside_a_hole(const float *unit)
{
    return is_seen_from_around(unit) && is_beside_a_hole(unit);
}

/* A hole in what is looked at is none of the sensors'. */
static void surface_goes_where_sensors_looked(void **state)
{
    (void)state;
    double share = trimmed_of(is_beside_a_hole, 0), around = trimmed_of(is_seen_beside_a_hole, 0);
    assert_true(share > 0.005 && share < 0.05);
    assert_true(around == share); /* and its ends stay */
}

static void surface_stays_where_nobody_looked(void **state)
{
    (void)state;
    assert_true(trimmed_of(is_seen_from_around, 0) == 0);
}

/* Points that no sensor can have seen are all over the surface: what has none is no surface. */
static void what_sees_the_hidden_sees_all(void **state)
{
    (void)state;
    double share = trimmed_of(is_seen_from_around, 800);
    assert_true(share > 0.1 && share < 0.2);
}

static void all_seen_stays_all(void **state)
{
    (void)state;
    assert_true(trimmed_of(is_anywhere, 0) == 0);
}

static void refused_memory_is_survived(void **state)
{
    (void)state;
    npg_mesh *mesh = ball_mesh(9, 12);
    size_t before = npg_memory_used(), faces = mesh->face_count;
    uint64_t n = 1;
    npg_status status = NPG_MEMORY;
    npg_point_set set = {.points = mesh->vert_pos,
                         .count = 1,
                         .key_points = mesh->vert_pos,
                         .key_normals = mesh->vert_pos,
                         .key_count = 1,
                         .diagonal = 1,
                         .seen_dist = 0.01};
    for (double share; status; n++) {
        npg_memory_fail_at(n, true);
        status = npg_mesh_trim_expected(&mesh, &share, &set);
        npg_memory_fail_at(0, false);
        assert_true(!status || status == NPG_MEMORY);
        assert_true(mesh->face_count == faces);
        assert_int_equal(npg_memory_used(), before);
    }
    assert_true(n > 8);
    npg_mesh_unref(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_side_away_from_the_sensor_is_excused),
        cmocka_unit_test(surface_before_the_sensor_is_not_excused),
        cmocka_unit_test(surface_goes_where_sensors_looked),
        cmocka_unit_test(surface_stays_where_nobody_looked),
        cmocka_unit_test(what_sees_the_hidden_sees_all),
        cmocka_unit_test(all_seen_stays_all),
        cmocka_unit_test(refused_memory_is_survived),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
