/* Colours: robust means, and from points to vertices. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "fuse/fuse_internal.h"
#include "geometry/geometry.h"
#include "tests/support/shapes.h"

static void a_mean_is_exact(void **state)
{
    (void)state;
    for (int level = 0; level < 256; level += 5) {
        npg_colour_sums sums = {{{0}}};
        const uint8_t rgb[3] = {(uint8_t)level, (uint8_t)(255 - level), 3};
        uint8_t mean[3];
        for (int i = 0; i < 5000; i++) npg_colour_add(&sums, rgb);
        assert_true(npg_colour_mean(mean, &sums));
        assert_memory_equal(mean, rgb, 3);
    }
}

static void outliers_do_not_count(void **state)
{
    (void)state;
    npg_colour_sums sums = {{{0}}};
    shape_random random = {4};
    uint8_t mean[3];
    double sum = 0;
    for (int i = 0; i < 300; i++) {
        double value = 100 + 8 * shape_gauss(&random);
        const uint8_t rgb[3] = {(uint8_t)lrint(value), 0, 255};
        sum += rgb[0];
        npg_colour_add(&sums, rgb);
    }
    for (int i = 0; i < 100; i++) npg_colour_add(&sums, (const uint8_t[3]){250, 200, 10});
    assert_true(npg_colour_mean(mean, &sums));
    assert_true(fabs(mean[0] - sum / 300) < 2);
    assert_int_equal(mean[1], 0);
    assert_int_equal(mean[2], 255);
    npg_colour_sums none = {{{0}}};
    assert_false(npg_colour_mean(mean, &none));
}

/* Two sheets close together that face away from each other keep their colours; a point without a colour says
 * nothing. */
static void sides_are_kept_apart(void **state)
{
    (void)state;
    enum { N = 800 };
    static float points[3 * N], normals[3 * N];
    static uint8_t colours[4 * N];
    shape_random random = {9};
    for (int i = 0; i < N; i++) {
        int side = i % 2;
        shape_put(points + 3 * i, shape_uniform(&random), shape_uniform(&random), 0.002 * side);
        shape_put(normals + 3 * i, 0, 0, side ? 1 : -1);
        const uint8_t rgba[4] = {side ? 200 : 10, 50, 60, i % 7 ? 255 : 0};
        memcpy(colours + 4 * i, rgba, 4);
        if (!rgba[3]) memset(colours + 4 * i, 255, 3);
    }
    const float verts[9] = {0.5f, 0.5f, 0, 0.5f, 0.5f, 0.002f, 5, 5, 5},
                facing[9] = {0, 0, -1, 0, 0, 1, 0, 0, 1};
    const npg_coloured cloud = {points, normals, colours, N};
    uint8_t out[12];
    assert_int_equal(npg_colour_vertices(out, verts, facing, 3, &cloud, 0.05), NPG_OK);
    assert_memory_equal(out, ((const uint8_t[12]){10, 50, 60, 255, 200, 50, 60, 255, 0, 0, 0, 0}), 12);
    const npg_coloured empty = {points, normals, colours, 0};
    assert_int_equal(npg_colour_vertices(out, verts, facing, 3, &empty, 0.05), NPG_OK);
    assert_int_equal(out[3], 0);
}

static void unseen_vertices_borrow(void **state)
{
    (void)state;
    npg_mesh *mesh;
    assert_int_equal(npg_mesh_open(&mesh, 7, 2), NPG_OK);
    const uint32_t faces[6] = {0, 1, 2, 1, 3, 2}; /* 4, 5 and 6 belong to none */
    memcpy(mesh->faces, faces, sizeof faces);
    uint8_t colours[28] = {100, 0, 0, 255, 200, 0, 0, 255};
    assert_int_equal(npg_colour_fill(colours, mesh), NPG_OK);
    assert_memory_equal(colours + 8, ((const uint8_t[4]){150, 0, 0, 254}), 4);
    assert_int_equal(colours[15], 254);
    assert_memory_equal(colours + 16, ((const uint8_t[4]){128, 128, 128, 254}), 4);
    npg_mesh_unref(&mesh);
}

static void cells_take_all_frames_together(void **state)
{
    (void)state;
    npg_colour_cells *cells;
    float points[12], normals[12];
    uint8_t colours[16];
    assert_int_equal(npg_colour_cells_open(&cells, 0.1, 2), NPG_OK);
    for (int i = 0; i < 9; i++) {
        const uint8_t rgb[3] = {(uint8_t)(i < 7 ? 90 : 240), 1, 2};
        npg_colour_cells_add(cells, (const float[3]){0.51f, 0.52f, 0.53f}, (const float[3]){0, 0, 1}, rgb, 1);
        npg_colour_cells_add(cells, (const float[3]){0.51f, 0.52f, 0.53f}, (const float[3]){0, 0, -1},
                             (const uint8_t[3]){7, 8, 9}, 3);
        npg_colour_cells_add(cells, (const float[3]){-0.5f, 0, 0}, (const float[3]){0, 0, 1}, rgb,
                             1); /* no room */
    }
    assert_int_equal(npg_colour_cells_count(cells), 2);
    npg_colour_cells_means(cells, points, normals, colours);
    assert_memory_equal(colours, ((const uint8_t[8]){90, 1, 2, 255, 7, 8, 9, 255}), 8);
    assert_true(fabsf(points[0] - 0.51f) < 1e-6f && normals[2] == 1 && normals[5] == -1);
    npg_colour_cells_close(&cells);
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_mean_is_exact), cmocka_unit_test(outliers_do_not_count),
        cmocka_unit_test(sides_are_kept_apart), cmocka_unit_test(unseen_vertices_borrow),
        cmocka_unit_test(cells_take_all_frames_together)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
