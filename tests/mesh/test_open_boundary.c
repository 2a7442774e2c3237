/* Fringe: a strip that hangs on a sheet goes, the sheet stays, and so does what has no border. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

#include "mesh/mesh_internal.h"
#include "pipeline/memory.h"
#include "tests/support/ball_mesh.h"

#define SIDE  40 /* cells along the sheet's side                */
#define STRIP 20 /* of the strip's length, two cells wide       */
#define CELL  0.01
#define WIDTH 0.04 /* twice it is what a strip must be wider than */

/* Cells of a sheet, and of a strip that goes on from the middle of its right side. */
static bool is_cell(size_t x, size_t y)
{
    return x < SIDE || (y >= SIDE / 2 && y < SIDE / 2 + 2);
}

static npg_mesh *sheet_with_strip(void)
{
    const size_t wide = SIDE + STRIP + 1, high = SIDE + 1;
    size_t faces = 0;
    npg_mesh *mesh;
    uint8_t keep[2 * (SIDE + STRIP) * SIDE];
    assert_int_equal(npg_mesh_open(&mesh, wide * high, 2 * (wide - 1) * (high - 1)), NPG_OK);
    for (size_t v = 0; v < wide * high; v++) {
        mesh->vert_pos[3 * v] = (float)(CELL * (double)(v % wide));
        mesh->vert_pos[3 * v + 1] = (float)(CELL * (double)(v / wide));
    }
    for (size_t y = 0; y + 1 < high; y++)
        for (size_t x = 0; x + 1 < wide; x++) {
            uint32_t a = (uint32_t)(y * wide + x), b = a + 1, c = a + (uint32_t)wide, d = c + 1;
            const uint32_t two[6] = {a, b, d, a, d, c};
            for (int k = 0; k < 6; k++) mesh->faces[3 * faces + (size_t)k] = two[k];
            keep[faces++] = is_cell(x, y);
            keep[faces++] = is_cell(x, y);
        }
    assert_int_equal(npg_mesh_keep_faces(&mesh, keep), NPG_OK);
    return mesh;
}

static void a_strip_goes_and_the_sheet_stays(void **state)
{
    (void)state;
    npg_mesh *mesh = sheet_with_strip();
    double share, least = INFINITY, most = -INFINITY;
    const double all = SIDE * SIDE + 2 * STRIP;
    assert_int_equal(npg_mesh_trim_shreds(&mesh, &share, WIDTH), NPG_OK);
    for (size_t v = 0; v < mesh->vert_count; v++) {
        least = fmin(least, (double)mesh->vert_pos[3 * v]);
        most = fmax(most, (double)mesh->vert_pos[3 * v]);
    }
    assert_true(least < 1e-6);
    assert_true(most < CELL * SIDE + WIDTH); /* its root may stay */
    /* the strip, and the sheet's corners, which are narrow, too */
    assert_true(share > (2 * STRIP - 2 * WIDTH / CELL) / all && share < 2 * STRIP / all + 0.01);
    npg_mesh_unref(&mesh);
}

static void expect_unchanged(npg_mesh *mesh)
{
    double share;
    size_t faces = mesh->face_count;
    assert_int_equal(npg_mesh_trim_shreds(&mesh, &share, 10), NPG_OK);
    assert_int_equal(mesh->face_count, faces);
    assert_true(share == 0);
    npg_mesh_unref(&mesh);
}

static void what_has_no_border_stays(void **state)
{
    (void)state;
    expect_unchanged(ball_mesh(12, 24));
}

static void what_is_border_alone_stays(void **state)
{
    (void)state;
    expect_unchanged(sheet_with_strip());
}

static void without_memory_the_mesh_stays(void **state)
{
    (void)state;
    npg_mesh *mesh = sheet_with_strip();
    double share;
    size_t faces = mesh->face_count;
    for (uint64_t n = 1; n < 6; n++) {
        npg_memory_fail_at(n, false);
        assert_int_equal(npg_mesh_trim_shreds(&mesh, &share, WIDTH), NPG_MEMORY);
        assert_int_equal(mesh->face_count, faces);
    }
    npg_memory_fail_at(0, false);
    npg_mesh_unref(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_strip_goes_and_the_sheet_stays),
        cmocka_unit_test(what_has_no_border_stays),
        cmocka_unit_test(what_is_border_alone_stays),
        cmocka_unit_test(without_memory_the_mesh_stays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
