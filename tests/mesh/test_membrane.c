/* Membrane: what no point saw is drawn tight; what points saw stays where it is.  A shell gets a back. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "mesh/mesh_internal.h"
#include "tests/support/ball_mesh.h"

#define SIDE 31 /* vertices along a side of the sheet */
#define STEP (2.0 / (SIDE - 1))
#define HOLE 0.5 /* radius of what is not seen */

typedef struct seen {
    float points[2 * 3 * SIDE * SIDE];
    size_t count;
} seen;

static bool is_in_hole(double x, double y)
{
    return x * x + y * y < HOLE * HOLE;
}

static void put_square(npg_mesh *mesh, uint32_t i, uint32_t j)
{
    uint32_t a = i * SIDE + j, b = a + 1, c = a + SIDE, d = c + 1;
    const uint32_t faces[6] = {a, c, b, b, c, d};
    memcpy(mesh->faces + 6 * ((size_t)i * (SIDE - 1) + j), faces, sizeof faces);
}

/* A tilted sheet from -1 to 1 with a balloon over its middle; `spare` more vertices and faces at its end. */
static npg_mesh *bulged(seen *s, size_t spare_verts, size_t spare_faces)
{
    npg_mesh *mesh;
    size_t faces = 2 * (SIDE - 1) * (SIDE - 1);
    s->count = 0;
    assert_int_equal(npg_mesh_open(&mesh, SIDE * SIDE + spare_verts, faces + spare_faces), NPG_OK);
    for (uint32_t v = 0; v < SIDE * SIDE; v++) {
        double x = (double)(v / SIDE) * STEP - 1, y = (double)(v % SIDE) * STEP - 1, z = 0.1 * x;
        if (is_in_hole(x, y)) z += 0.6 - 2.4 * (x * x + y * y);
        const float at[3] = {(float)x, (float)y, (float)z};
        memcpy(mesh->vert_pos + 3 * (size_t)v, at, sizeof at);
        if (!is_in_hole(x, y)) memcpy(s->points + 3 * s->count++, at, sizeof at);
    }
    for (uint32_t i = 0; i < SIDE - 1; i++)
        for (uint32_t j = 0; j < SIDE - 1; j++) put_square(mesh, i, j);
    return mesh;
}

static void the_balloon_over_a_hole_becomes_flat(void **state)
{
    static seen s;
    npg_mesh *mesh = bulged(&s, 0, 0), *before;
    npg_faired done;
    (void)state;
    assert_int_equal(npg_mesh_copy(&before, mesh), NPG_OK);
    assert_int_equal(npg_mesh_fair(mesh, &done, s.points, s.count, 0.5 * STEP, NULL), NPG_OK);
    assert_int_equal(done.moved, SIDE * SIDE - s.count);
    for (size_t v = 0; v < mesh->vert_count; v++) {
        const float *now = mesh->vert_pos + 3 * v, *was = before->vert_pos + 3 * v;
        if (!is_in_hole((double)was[0], (double)was[1])) assert_memory_equal(now, was, 3 * sizeof(float));
        assert_true(fabs((double)now[2] - 0.1 * (double)now[0]) < 1e-3); /* in the sheet's plane */
        assert_true(is_in_hole((double)was[0], (double)was[1]) == is_in_hole((double)now[0], (double)now[1]));
    }
    npg_mesh_unref(&before);
    npg_mesh_unref(&mesh);
}

/* A balloon that hangs on what is farther than 3 STEP begins at half of that; a bump as high by itself stays. */
static void the_balloon_begins_where_points_end(void **state)
{
    static seen s;
    npg_mesh *mesh = bulged(&s, 0, 0), *before;
    npg_faired done;
    const size_t bump = (SIDE - 4) * SIDE + SIDE - 4;
    float dist[SIDE * SIDE];
    size_t doubtful = 0;
    (void)state;
    mesh->vert_pos[3 * bump + 2] += (float)(2 * STEP);
    assert_int_equal(npg_mesh_copy(&before, mesh), NPG_OK);
    assert_int_equal(npg_points_dist(dist, mesh->vert_pos, mesh->vert_count, s.points, s.count), NPG_OK);
    assert_int_equal(npg_mesh_fair(mesh, &done, s.points, s.count, 3 * STEP, NULL), NPG_OK);
    for (size_t v = 0; v < mesh->vert_count; v++) {
        const float *now = mesh->vert_pos + 3 * v, *was = before->vert_pos + 3 * v;
        bool moves = v != bump && (double)dist[v] > 1.5 * STEP;
        doubtful += moves && (double)dist[v] < 3 * STEP;
        assert_true(moves == (memcmp(now, was, 3 * sizeof(float)) != 0));
    }
    assert_true(doubtful > 10);
    npg_mesh_unref(&before);
    npg_mesh_unref(&mesh);
}

static void nothing_moves_where_all_is_seen_or_nothing(void **state)
{
    static seen s;
    const float far[3] = {9, 9, 9};
    npg_mesh *mesh = bulged(&s, 0, 0), *before;
    npg_faired done = {7, 7};
    (void)state;
    assert_int_equal(npg_mesh_copy(&before, mesh), NPG_OK);
    assert_int_equal(npg_mesh_fair(mesh, &done, before->vert_pos, before->vert_count, 1e-6, NULL), NPG_OK);
    assert_int_equal(done.moved, 0);
    assert_memory_equal(mesh->vert_pos, before->vert_pos, 3 * sizeof(float) * mesh->vert_count);
    done.moved = 7;
    assert_int_equal(npg_mesh_fair(mesh, &done, far, 1, 0.1, NULL), NPG_OK);
    assert_int_equal(done.moved, 0);
    assert_memory_equal(mesh->vert_pos, before->vert_pos, 3 * sizeof(float) * mesh->vert_count);
    npg_mesh_unref(&before);
    npg_mesh_unref(&mesh);
}

/* There is nothing to draw it tight between: it would become a point. */
static void a_piece_that_no_point_saw_keeps_its_shape(void **state)
{
    static seen s;
    static const float corners[12] = {0, 0, 3, 1, 0, 3, 0, 1, 3, 0, 0, 4};
    static const uint32_t sides[12] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
    const size_t verts = SIDE * SIDE;
    npg_mesh *mesh = bulged(&s, 4, 4);
    npg_faired done;
    (void)state;
    memcpy(mesh->vert_pos + 3 * verts, corners, sizeof corners);
    for (size_t i = 0; i < 12; i++) mesh->faces[6 * (SIDE - 1) * (SIDE - 1) + i] = (uint32_t)verts + sides[i];
    assert_int_equal(npg_mesh_fair(mesh, &done, s.points, s.count, 0.5 * STEP, NULL), NPG_OK);
    assert_int_equal(done.moved, verts - s.count);
    assert_memory_equal(mesh->vert_pos + 3 * verts, corners, sizeof corners);
    npg_mesh_unref(&mesh);
    assert_int_equal(npg_memory_used(), 0);
}

/* The sheet is drawn flat where its balloon was; a sensor saw more to be empty: a bowl below the sheet. */
static npg_cube_set *bowl(double side, double floor_z)
{
    static float middles[3 * 40000];
    npg_cube_set *set;
    size_t count = 0;
    for (int i = -20; i < 20; i++)
        for (int j = -20; j < 20; j++)
            for (int k = -16; k < 31; k++) {
                const double at[3] = {(i + 0.5) * side, (j + 0.5) * side, (k + 0.5) * side};
                if (at[0] * at[0] + at[1] * at[1] > 0.3 * 0.3 || at[2] < floor_z) continue;
                for (int a = 0; a < 3; a++) middles[3 * count + (size_t)a] = (float)at[a];
                count++;
            }
    assert_int_equal(npg_cube_set_open(&set, middles, count, side), NPG_OK);
    return set;
}

static void what_lies_in_empty_space_is_pushed_out_of_it(void **state)
{
    static seen s;
    npg_mesh *mesh = bulged(&s, 0, 0);
    npg_cube_set *empty = bowl(0.02, -0.12);
    npg_faired done;
    double lowest = 1;
    (void)state;
    double before = npg_mesh_share_in(mesh, empty);
    assert_int_equal(npg_mesh_fair(mesh, &done, s.points, s.count, 0.5 * STEP, empty), NPG_OK);
    assert_int_equal(done.moved, SIDE * SIDE - s.count);
    assert_true(done.pushed > 0 && done.pushed < done.moved);
    for (size_t v = 0; v < mesh->vert_count; v++) {
        const float *now = mesh->vert_pos + 3 * v;
        double from_middle = hypot((double)now[0], (double)now[1]);
        if (from_middle < 0.1) assert_true(fabs((double)now[2] + 0.12) < 0.04); /* the floor of the bowl */
        lowest = fmin(lowest, (double)now[2] - 0.1 * (double)now[0]);
    }
    assert_true(lowest > -0.2);
    double left = npg_mesh_share_in(mesh, empty);
    if (!(left > 0 && left < 0.5 * before)) fail_msg("%g of %g of the area is in empty space", left, before);
    npg_cube_set_close(&empty);
    npg_mesh_unref(&mesh);
    assert_int_equal(npg_memory_used(), 0);
}

/* Two sheets, back to back, that no point saw in their middle, where all is empty: as between two fingers. */
static npg_mesh *web(seen *s)
{
    npg_mesh *mesh;
    const size_t verts = SIDE * SIDE, faces = 2 * (SIDE - 1) * (SIDE - 1);
    npg_mesh *sheet = bulged(s, 0, 0);
    assert_int_equal(npg_mesh_open(&mesh, 2 * verts, 2 * faces), NPG_OK);
    s->count = 0;
    for (size_t v = 0; v < 2 * verts; v++) {
        float *at = mesh->vert_pos + 3 * v;
        memcpy(at, sheet->vert_pos + 3 * (v % verts), 2 * sizeof *at);
        at[2] = v < verts ? 0.1F : -0.1F;
        if (!is_in_hole((double)at[0], (double)at[1])) memcpy(s->points + 3 * s->count++, at, 3 * sizeof *at);
    }
    for (size_t i = 0; i < 3 * faces; i++) {
        mesh->faces[i] = sheet->faces[i];
        mesh->faces[3 * faces + i] = (uint32_t)verts + sheet->faces[i - i % 3 + 2 - i % 3];
    }
    npg_mesh_unref(&sheet);
    return mesh;
}

static void two_sides_that_are_pushed_meet_in_the_middle(void **state)
{
    static seen s;
    npg_mesh *mesh = web(&s);
    npg_cube_set *empty = bowl(0.02, -0.5);
    npg_faired done;
    (void)state;
    assert_int_equal(npg_mesh_fair(mesh, &done, s.points, s.count, 0.5 * STEP, empty), NPG_OK);
    assert_true(done.pushed > 0);
    for (size_t v = 0; v < mesh->vert_count; v++) {
        const float *at = mesh->vert_pos + 3 * v;
        float height = v < mesh->vert_count / 2 ? at[2] : -at[2];
        if (hypot((double)at[0], (double)at[1]) < 0.1) assert_true(height < 0.05F);
        assert_true(height > -0.001F);
    }
    npg_cube_set_close(&empty);
    npg_mesh_unref(&mesh);
    assert_int_equal(npg_memory_used(), 0);
}

/* The upper half of a ball, and a whole one above it. */
static npg_mesh *shell_and_ball(size_t *shell_verts)
{
    npg_mesh *mesh = ball_mesh(15, 24), *ball = ball_mesh(5, 8), *both;
    uint8_t keep[2 * 24 * 15];
    for (size_t f = 0; f < mesh->face_count; f++) {
        keep[f] = 1;
        for (size_t k = 0; k < 3; k++)
            keep[f] &= mesh->vert_pos[3 * (size_t)mesh->faces[3 * f + k] + 2] > -1e-6f;
    }
    assert_int_equal(npg_mesh_keep_faces(&mesh, keep), NPG_OK);
    size_t v = *shell_verts = mesh->vert_count, f = mesh->face_count;
    assert_int_equal(npg_mesh_open(&both, v + ball->vert_count, f + ball->face_count), NPG_OK);
    memcpy(both->vert_pos, mesh->vert_pos, 3 * v * sizeof(float));
    memcpy(both->faces, mesh->faces, 3 * f * sizeof(uint32_t));
    for (size_t i = 0; i < 3 * ball->vert_count; i++)
        both->vert_pos[3 * v + i] = ball->vert_pos[i] + (i % 3 == 2 ? 2 : 0);
    for (size_t i = 0; i < 3 * ball->face_count; i++) both->faces[3 * f + i] = (uint32_t)v + ball->faces[i];
    npg_mesh_unref(&mesh);
    npg_mesh_unref(&ball);
    return both;
}

static void a_shell_gets_a_back_and_a_ball_stays(void **state)
{
    size_t shell, added;
    npg_mesh *mesh = shell_and_ball(&shell), *before;
    npg_manifold manifold;
    int64_t handles;
    (void)state;
    assert_int_equal(npg_mesh_copy(&before, mesh), NPG_OK);
    assert_int_equal(npg_mesh_close(&mesh, &added), NPG_OK);
    assert_int_equal(added, shell);
    assert_int_equal(mesh->vert_count, before->vert_count + shell);
    assert_memory_equal(mesh->vert_pos, before->vert_pos, 3 * sizeof(float) * before->vert_count);
    assert_memory_equal(mesh->faces, before->faces, 3 * sizeof(uint32_t) * before->face_count);
    for (size_t v = before->vert_count; v < mesh->vert_count; v++)
        assert_true(fabsf(mesh->vert_pos[3 * v + 2]) < 2e-3f); /* flat, in the plane of the border */
    assert_int_equal(npg_mesh_manifold(&manifold, mesh), NPG_OK);
    assert_int_equal(manifold.border_edges + manifold.crowded_edges + manifold.misoriented_edges, 0);
    assert_int_equal(npg_mesh_handles(&handles, mesh), NPG_OK);
    assert_int_equal(handles, 0);
    /* the back looks outward: through the plane of the border, where the origin is, it adds nothing */
    assert_true(fabs(npg_mesh_volume(mesh) / npg_mesh_volume(before) - 1) < 1e-2);
    assert_int_equal(npg_mesh_close(&mesh, &added), NPG_OK);
    assert_int_equal(added, 0); /* nothing is open any more */
    npg_mesh_unref(&before);
    npg_mesh_unref(&mesh);
    assert_int_equal(npg_memory_used(), 0);
}

static npg_status close_with_failure(uint64_t n)
{
    size_t shell, added;
    npg_mesh *mesh = shell_and_ball(&shell);
    npg_memory_fail_at(n, false);
    npg_status status = npg_mesh_close(&mesh, &added);
    npg_memory_fail_at(0, false);
    npg_mesh_unref(&mesh);
    return status;
}

static void a_back_without_memory_is_reported(void **state)
{
    uint64_t n = 1;
    (void)state;
    for (; close_with_failure(n) == NPG_MEMORY; n++) assert_int_equal(npg_memory_used(), 0);
    assert_true(n > 5);
    assert_int_equal(close_with_failure(n), NPG_OK);
    assert_int_equal(npg_memory_used(), 0);
}

static npg_status flatten_with_failure(const npg_mesh *bulge, const seen *s, const npg_cube_set *empty,
                                       uint64_t n)
{
    npg_mesh *mesh;
    npg_faired done;
    assert_int_equal(npg_mesh_copy(&mesh, bulge), NPG_OK);
    npg_memory_fail_at(n, false);
    npg_status status = npg_mesh_fair(mesh, &done, s->points, s->count, 0.5 * STEP, empty);
    npg_memory_fail_at(0, false);
    npg_mesh_unref(&mesh);
    return status;
}

static void memory_that_fails_is_reported(void **state)
{
    static seen s;
    npg_mesh *mesh = bulged(&s, 0, 0);
    npg_cube_set *empty = bowl(0.02, -0.12);
    size_t used = npg_memory_used();
    uint64_t n = 1;
    (void)state;
    for (; flatten_with_failure(mesh, &s, empty, n) == NPG_MEMORY; n++)
        assert_int_equal(npg_memory_used(), used);
    assert_true(n > 3);
    assert_int_equal(flatten_with_failure(mesh, &s, empty, n), NPG_OK);
    npg_cube_set_close(&empty);
    npg_mesh_unref(&mesh);
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_balloon_over_a_hole_becomes_flat),
        cmocka_unit_test(the_balloon_begins_where_points_end),
        cmocka_unit_test(nothing_moves_where_all_is_seen_or_nothing),
        cmocka_unit_test(a_piece_that_no_point_saw_keeps_its_shape),
        cmocka_unit_test(what_lies_in_empty_space_is_pushed_out_of_it),
        cmocka_unit_test(two_sides_that_are_pushed_meet_in_the_middle),
        cmocka_unit_test(a_shell_gets_a_back_and_a_ball_stays),
        cmocka_unit_test(a_back_without_memory_is_reported),
        cmocka_unit_test(memory_that_fails_is_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
