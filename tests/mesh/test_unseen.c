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

/* A ball with points but for `count` round caps of that cosine around directions of unit length; the share that goes. */
static double trimmed_of(const float (*caps)[3], int count, float cosine)
{
    static float points[3 * 4000];
    npg_mesh *mesh = ball_mesh(47, 80);
    size_t kept = 0, faces = mesh->face_count;
    double share;
    for (size_t i = 0; i < mesh->vert_count; i++) {
        const float *p = mesh->vert_pos + 3 * i;
        int is_in = 0;
        for (int c = 0; c < count; c++) is_in |= npg_vec3_dotf(p, caps[c]) > cosine * npg_vec3_lengthf(p);
        for (size_t a = 0; a < 3 && !is_in; a++) points[3 * kept + a] = p[a];
        kept += !is_in;
    }
    assert_int_equal(npg_mesh_trim_expected(&mesh, &share, points, kept, 0.05), NPG_OK);
    assert_true(share > 0 ? mesh->face_count < faces : mesh->face_count == faces);
    npg_mesh_unref(&mesh);
    return share;
}

static void surface_goes_where_all_that_faces_alike_was_seen(void **state)
{
    (void)state;
    const float one[][3] = {{0.3714f, 0, 0.9285f}};
    double share = trimmed_of(one, 1, 0.93f);
    assert_true(share > 0.005 && share < 0.05);
}

/* Two places that face nearly the same way: from there nobody looked. */
static void surface_stays_where_more_of_that_side_is_missing(void **state)
{
    (void)state;
    const float two[][3] = {{0.3714f, 0, 0.9285f}, {-0.3714f, 0, 0.9285f}};
    assert_true(trimmed_of(two, 2, 0.93f) == 0);
}

/* A side as large as that of one camera's back has nothing to be compared with. */
static void a_whole_side_stays(void **state)
{
    (void)state;
    const float half[][3] = {{0, 0, 1}};
    assert_true(trimmed_of(half, 1, 0) == 0);
}

static void all_seen_stays_all(void **state)
{
    (void)state;
    assert_true(trimmed_of(NULL, 0, 0) == 0);
}

static void refused_memory_is_survived(void **state)
{
    (void)state;
    npg_mesh *mesh = ball_mesh(9, 12);
    size_t before = npg_memory_used(), faces = mesh->face_count;
    uint64_t n = 1;
    npg_status status = NPG_MEMORY;
    for (double share; status; n++) {
        npg_memory_fail_at(n, true);
        status = npg_mesh_trim_expected(&mesh, &share, mesh->vert_pos, 1, 0.01);
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
        cmocka_unit_test(surface_goes_where_all_that_faces_alike_was_seen),
        cmocka_unit_test(surface_stays_where_more_of_that_side_is_missing),
        cmocka_unit_test(a_whole_side_stays),
        cmocka_unit_test(all_seen_stays_all),
        cmocka_unit_test(refused_memory_is_survived),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
