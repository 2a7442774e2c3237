/* Holding apart what nearly touches, and the handles of a mesh, which say whether that was joined. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "geometry/geometry.h"
#include "mesh/mesh_internal.h"
#include "tests/support/legs.h"

/* ---- a torus of n x n quads, with `holes` faces left out at its end ---- */

static npg_mesh *torus(uint32_t n, size_t holes)
{
    npg_mesh *mesh;
    assert_int_equal(npg_mesh_open(&mesh, (size_t)n * n, 2 * (size_t)n * n - holes), NPG_OK);
    size_t face_count = 0;
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t j = 0; j < n; j++) {
            double u = 6.283185307 * i / n, v = 6.283185307 * j / n;
            float *p = mesh->vert_pos + 3 * ((size_t)i * n + j);
            p[0] = (float)((1 + 0.3 * cos(v)) * cos(u));
            p[1] = (float)((1 + 0.3 * cos(v)) * sin(u));
            p[2] = (float)(0.3 * sin(v));
            uint32_t a = i * n + j, b = (i + 1) % n * n + j, c = (i + 1) % n * n + (j + 1) % n,
                     d = i * n + (j + 1) % n;
            const uint32_t faces[2][3] = {{a, b, c}, {a, c, d}};
            for (int k = 0; k < 2 && face_count < mesh->face_count; k++)
                memcpy(mesh->faces + 3 * face_count++, faces[k], sizeof faces[k]);
        }
    return mesh;
}

static void handles_are_counted_with_and_without_a_border(void **state)
{
    (void)state;
    for (size_t holes = 0; holes < 3; holes++) {
        int64_t handles;
        npg_mesh *mesh = torus(8, holes);
        assert_int_equal(npg_mesh_handles(&handles, mesh), NPG_OK);
        assert_int_equal(handles, 1);
        npg_mesh_unref(&mesh);
    }
}

static void twins_lie_across_their_edge(void **state)
{
    (void)state;
    npg_mesh *mesh = torus(8, 1);
    uint32_t twin[3 * 2 * 64];
    size_t borders = 0;
    assert_int_equal(npg_mesh_twins(twin, mesh->faces, mesh->face_count), NPG_OK);
    for (size_t i = 0; i < 3 * mesh->face_count; i++) {
        if (twin[i] == UINT32_MAX) {
            borders++;
            continue;
        }
        size_t t = twin[i];
        assert_int_equal(twin[t], i);
        assert_int_equal(mesh->faces[i], mesh->faces[t - t % 3 + (t + 1) % 3]);
    }
    assert_int_equal(borders, 3);
    npg_mesh_unref(&mesh);
}

/* ---- gaps ---- */

/* Mean distance to the surface of the points that were moved. */
static double gap_to(const npg_mesh *mesh, const npg_gap_widening *apart)
{
    static npg_surface_hit hits[LEGS_POINTS];
    npg_surface *surface;
    double sum = 0;
    assert_int_equal(
        npg_surface_open(&surface, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count), NPG_OK);
    assert_int_equal(npg_surface_closest(surface, hits, apart->points, apart->count), NPG_OK);
    npg_surface_close(&surface);
    for (size_t i = 0; i < apart->count; i++) {
        const float *s = apart->shift + 3 * i;
        if (s[0] != 0 || s[1] != 0 || s[2] != 0) sum += sqrt((double)hits[i].dist_sq);
    }
    return sum / (double)apart->moved;
}

static void points_go_apart_and_the_surface_comes_back(void **state)
{
    (void)state;
    const npg_poisson_settings settings = {.depth = 7, .point_weight = 4, .time_limit_s = 60};
    npg_frame frame = {0};
    npg_gap_widening apart;
    npg_mesh *mesh;
    size_t n = LEGS_POINTS;
    int64_t handles;
    assert_int_equal(legs_frame(&frame, 0.16, 5), NPG_OK); /* a gap of 0.02 at the feet */
    assert_int_equal(npg_gaps_widen(&apart, frame.pos_local, frame.normals, n, 0.05), NPG_OK);
    assert_in_range(apart.moved, 20, n / 3);
    for (size_t i = 0; i < n; i++) { /* nobody crosses over, and the feet go outward */
        bool is_inner = frame.normals[3 * i] * frame.pos_local[3 * i] < 0;
        if (frame.pos_local[3 * i + 1] > -0.5f || apart.shift[3 * i] == 0 || !is_inner) continue;
        assert_true((apart.shift[3 * i] > 0) == (frame.pos_local[3 * i] > 0));
    }
    assert_int_equal(npg_poisson(&mesh, apart.shifted, frame.normals, n, &settings), NPG_OK);
    double before = gap_to(mesh, &apart);
    assert_int_equal(npg_gaps_bring_back(&apart, mesh), NPG_OK);
    double after = gap_to(mesh, &apart);
    print_message("%zu points moved; the surface is %.4f from them, then %.4f\n", apart.moved, before, after);
    assert_true(before > 0.002 && after < 0.1 * before);
    assert_int_equal(npg_mesh_handles(&handles, mesh), NPG_OK);
    assert_int_equal(handles, 0);
    npg_mesh_unref(&mesh);
    npg_gaps_close(&apart);
    npg_frame_clear(&frame);
}

/* Handles of the legs' surface; the feet, welded, make one. */
static int64_t handles_of_legs(double feet, bool holds_apart, size_t *moved)
{
    const npg_poisson_settings settings = {
        .depth = 7, .point_weight = 4, .time_limit_s = 60, .holds_apart = holds_apart};
    npg_frame frame = {0};
    npg_mesh *mesh;
    int64_t handles;
    assert_int_equal(legs_frame(&frame, feet, 5), NPG_OK);
    assert_int_equal(
        npg_poisson_apart(&mesh, moved, frame.pos_local, frame.normals, LEGS_POINTS, 0.05, &settings),
        NPG_OK);
    assert_int_equal(npg_mesh_handles(&handles, mesh), NPG_OK);
    npg_mesh_unref(&mesh);
    npg_frame_clear(&frame);
    return handles;
}

static void feet_that_nearly_touch_are_joined_unless_held_apart(void **state)
{
    (void)state;
    size_t moved;
    for (double feet = 0.155; feet < 0.177; feet += 0.005) { /* gaps of a fifth of the spacing to all of it */
        assert_int_equal(handles_of_legs(feet, true, &moved), 0);
        assert_true(moved > 0);
        print_message("gap %.2f of the spacing: %zu points moved\n", 2 * (feet - 0.15) / 0.05, moved);
    }
    assert_true(handles_of_legs(0.155, false, &moved) > 0);
    assert_int_equal(moved, 0);
}

static void coming_back_needs_memory(void **state)
{
    (void)state;
    npg_frame frame = {0};
    npg_gap_widening apart;
    npg_mesh *mesh = torus(8, 0);
    npg_status status = NPG_MEMORY;
    assert_int_equal(legs_frame(&frame, 0.16, 5), NPG_OK);
    for (uint64_t i = 1; status && i < 60; i++) {
        npg_memory_fail_at(i, false);
        status = npg_gaps_widen(&apart, frame.pos_local, frame.normals, LEGS_POINTS, 0.05);
        if (!status) status = npg_gaps_bring_back(&apart, mesh);
        npg_memory_fail_at(0, false);
        assert_true(status == NPG_OK || status == NPG_MEMORY);
        npg_gaps_close(&apart);
    }
    assert_int_equal(status, NPG_OK);
    npg_mesh_unref(&mesh);
    npg_frame_clear(&frame);
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(handles_are_counted_with_and_without_a_border),
        cmocka_unit_test(twins_lie_across_their_edge),
        cmocka_unit_test(points_go_apart_and_the_surface_comes_back),
        cmocka_unit_test(feet_that_nearly_touch_are_joined_unless_held_apart),
        cmocka_unit_test(coming_back_needs_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
