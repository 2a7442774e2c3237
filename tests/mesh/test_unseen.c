/* Unseen: the mask of surface without points, what sensors could not see of it, its share and place. */
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_side_away_from_the_sensor_is_excused),
        cmocka_unit_test(surface_before_the_sensor_is_not_excused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
