/* Patch: the largest part of what is marked on a sphere; the mask of unseen vertices goes with its mesh. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/geometry.h"
#include "job/job_internal.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/group_folder.h"

enum { RINGS = 89, SPOKES = 120 };

/* Of radius 0.5. */
static npg_mesh *sphere(uint32_t rings, uint32_t spokes)
{
    npg_mesh *mesh = ball_mesh(rings, spokes);
    for (size_t v = 0; v < mesh->vert_count; v++) mesh->vert_pos[3 * v + 1] *= 1.25f;
    return mesh;
}

static void find(npg_patch *patch, const uint8_t *marks, const npg_mesh *mesh)
{
    double *areas;
    assert_int_equal(npg_alloc_array(&areas, NPG_FOR_MESH, mesh->vert_count, sizeof *areas), NPG_OK);
    npg_vertex_areas(areas, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count);
    assert_int_equal(npg_patch_largest(patch, marks, mesh->vert_pos, areas, mesh), NPG_OK);
    npg_release(&areas);
}

static bool is_near(double value, double expected, double tolerance)
{
    return fabs(value - expected) <= tolerance;
}

static void the_larger_of_two_caps_is_found(void **state)
{
    static uint8_t marks[RINGS * SPOKES + 2];
    npg_mesh *mesh = sphere(RINGS, SPOKES);
    npg_patch patch;
    (void)state;
    for (size_t v = 0; v < mesh->vert_count; v++) { /* caps of 40 degrees above and 25 below */
        double z = 2 * (double)mesh->vert_pos[3 * v + 2];
        marks[v] = z > cos(40 * M_PI / 180) || z < -cos(25 * M_PI / 180);
    }
    double rim = cos(40 * M_PI / 180), middle = (1 + rim) / 2;
    find(&patch, marks, mesh);
    assert_true(is_near(patch.share, (1 - rim) / 2, 0.006));
    assert_true(is_near((double)patch.at[0], 0, 1e-4) && is_near((double)patch.at[1], 0, 1e-4));
    assert_true(is_near((double)patch.at[2], 0.5 * middle, 0.005));
    assert_true(is_near(patch.radius, 0.5 * hypot(sin(40 * M_PI / 180), middle - rim), 0.015));
    npg_mesh_unref(&mesh);
}

static void nothing_marked_is_no_patch(void **state)
{
    static uint8_t marks[RINGS * SPOKES + 2];
    npg_mesh *mesh = sphere(RINGS, SPOKES);
    npg_patch patch;
    (void)state;
    memset(marks, 0, sizeof marks);
    find(&patch, marks, mesh);
    assert_true(patch.share == 0 && patch.radius == 0 && isnan(patch.at[0]));
    marks[17] = 1; /* a single vertex is one */
    find(&patch, marks, mesh);
    assert_true(patch.share > 0 && patch.share < 1e-3 && patch.radius < 1e-6);
    npg_mesh_unref(&mesh);
}

static void mark_upper_half(npg_mesh *mesh)
{
    assert_int_equal(npg_alloc(&mesh->vert_unseen, NPG_FOR_MESH, mesh->vert_count), NPG_OK);
    for (size_t v = 0; v < mesh->vert_count; v++) mesh->vert_unseen[v] = mesh->vert_pos[3 * v + 2] > 0;
}

static void check_upper_half(const npg_mesh *mesh)
{
    assert_non_null(mesh->vert_unseen);
    for (size_t v = 0; v < mesh->vert_count; v++)
        assert_int_equal(mesh->vert_unseen[v], mesh->vert_pos[3 * v + 2] > 0);
}

static void the_mask_goes_with_its_mesh(void **state)
{
    npg_mesh *mesh = sphere(RINGS, SPOKES), *copy;
    npg_proxy *thin;
    uint8_t *keep;
    (void)state;
    mark_upper_half(mesh);
    assert_int_equal(npg_mesh_copy(&copy, mesh), NPG_OK);
    check_upper_half(copy);
    assert_int_equal(npg_proxy_open(&thin, mesh, 1000), NPG_OK);
    assert_true(thin->mesh->vert_count < 1300);
    check_upper_half(thin->mesh);
    npg_proxy_close(&thin);
    assert_int_equal(npg_alloc(&keep, NPG_FOR_MESH, copy->face_count), NPG_OK);
    for (size_t f = 0; f < copy->face_count; f++) keep[f] = f % 3 == 0;
    assert_int_equal(npg_mesh_keep_faces(&copy, keep), NPG_OK);
    check_upper_half(copy);
    npg_release(&keep);
    npg_mesh_unref(&copy);
    npg_mesh_unref(&mesh);
}

static npg_mesh *through_a_state(const npg_mesh *mesh)
{
    npg_store *store;
    npg_record *record;
    npg_mesh *out;
    assert_int_equal(npg_store_open_nameless(&store, NULL), NPG_OK);
    npg_store_begin(store, NPG_RECORD_STATE, 0, 0);
    assert_int_equal(npg_store_end(store, npg_state_put_mesh(store, mesh), false), NPG_OK);
    assert_int_equal(npg_store_read(store, &record, NPG_RECORD_STATE, 0, 0), NPG_OK);
    assert_int_equal(npg_state_get_mesh(&out, record), NPG_OK);
    npg_record_close(&record);
    npg_store_close(&store);
    return out;
}

static void a_state_has_the_mask_or_has_none(void **state)
{
    npg_mesh *mesh = sphere(7, 12), *restored;
    (void)state;
    restored = through_a_state(mesh); /* as states were before there was a mask */
    assert_null(restored->vert_unseen);
    npg_mesh_unref(&restored);
    mark_upper_half(mesh);
    restored = through_a_state(mesh);
    check_upper_half(restored);
    npg_mesh_unref(&restored);
    npg_mesh_unref(&mesh);
}

static void no_memory_is_said(void **state)
{
    npg_mesh *mesh = sphere(7, 12);
    const uint8_t marks[7 * 12 + 2] = {1};
    const double areas[7 * 12 + 2] = {1};
    npg_patch patch;
    (void)state;
    for (uint64_t n = 1; n <= 2; n++) {
        size_t before = npg_memory_used();
        npg_memory_fail_at(n, true);
        assert_int_equal(npg_patch_largest(&patch, marks, mesh->vert_pos, areas, mesh), NPG_MEMORY);
        npg_memory_fail_at(0, false);
        assert_int_equal(npg_memory_used(), before);
    }
    npg_mesh_unref(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_larger_of_two_caps_is_found),
        cmocka_unit_test(nothing_marked_is_no_patch),
        cmocka_unit_test(the_mask_goes_with_its_mesh),
        cmocka_unit_test(a_state_has_the_mask_or_has_none),
        cmocka_unit_test(no_memory_is_said),
    };
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
