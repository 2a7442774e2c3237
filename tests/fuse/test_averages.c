/* Averages: means of many points over small cubes, in a table that may be too small for them. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "fuse/fuse_internal.h"
#include "pipeline/memory.h"
#include "tests/support/shapes.h"

#define ROOM 400 /* means at most, in these tests */

typedef struct means {
    float points[3 * ROOM], normals[3 * ROOM];
    size_t count;
} means;

static means means_of(const npg_cells *cells, int64_t frames_least)
{
    means m = {.count = 0};
    assert_true(npg_cells_count(cells) <= ROOM);
    assert_int_equal(npg_cells_means(cells, m.points, m.normals, &m.count, frames_least), NPG_OK);
    return m;
}

static npg_cells *cells_of(double side, size_t most)
{
    npg_cells *cells;
    assert_int_equal(npg_cells_open(&cells, side, most), NPG_OK);
    return cells;
}

/* A point that is its own place, facing +z. */
static void put(npg_cells *cells, float x, float y, float z, float weight, int64_t frame)
{
    const float at[3] = {x, y, z}, up[3] = {0, 0, 1};
    assert_int_equal(npg_cells_add(cells, at, up, at, up, weight, frame), NPG_OK);
}

static void assert_near(const float *got, double x, double y, double z)
{
    const double wanted[3] = {x, y, z};
    for (int a = 0; a < 3; a++)
        if (!(fabs((double)got[a] - wanted[a]) < 1e-5))
            fail_msg("%g, not %g, on axis %d", (double)got[a], wanted[a], a);
}

static void means_are_weighted_by_their_points(void **state)
{
    const float at[3] = {0.05f, 0.05f, 0.05f}, facing[3] = {0, 0.1f, 1};
    const float points[2][3] = {{0.01f, 0.02f, 0.5f}, {0.05f, -0.02f, 0.1f}}; /* need not lie in the cube */
    const float normals[2][3] = {{0, 0, 1}, {0, 1, 0}};
    npg_cells *cells = cells_of(0.1, 100);
    (void)state;
    assert_int_equal(npg_cells_add(cells, at, facing, points[0], normals[0], 1, 0), NPG_OK);
    assert_int_equal(npg_cells_add(cells, at, facing, points[1], normals[1], 3, 1), NPG_OK);
    means m = means_of(cells, 1);
    assert_int_equal(m.count, 1);
    assert_near(m.points, 0.04, -0.01, 0.2);
    assert_near(m.normals, 0, 3 / sqrt(10), 1 / sqrt(10));
    npg_cells_close(&cells);
    assert_null(cells);
}

static void two_sides_of_a_thin_sheet_stay_two(void **state)
{
    const float top[3] = {0.02f, 0.02f, 0.012f}, bottom[3] = {0.02f, 0.02f, 0.010f};
    const float up[3] = {0, 0, 1}, down[3] = {0, 0, -1};
    npg_cells *cells = cells_of(0.1, 100);
    (void)state;
    for (int64_t frame = 0; frame < 3; frame++) {
        assert_int_equal(npg_cells_add(cells, top, up, top, up, 1, frame), NPG_OK);
        assert_int_equal(npg_cells_add(cells, bottom, down, bottom, down, 1, frame), NPG_OK);
    }
    means m = means_of(cells, 2);
    assert_int_equal(m.count, 2);
    assert_near(m.points, 0.02, 0.02, 0.012);
    assert_near(m.normals, 0, 0, 1);
    assert_near(m.points + 3, 0.02, 0.02, 0.010);
    assert_near(m.normals + 3, 0, 0, -1);
    npg_cells_close(&cells);
}

static void what_few_frames_saw_is_left_out(void **state)
{
    npg_cells *cells = cells_of(0.1, 100);
    (void)state;
    for (int i = 0; i < 5; i++) put(cells, 1.65f, 0.05f, 0.05f, 1, 0); /* one frame, however many points */
    put(cells, 0.05f, 0.05f, 0.05f, 1, 0);
    put(cells, 0.25f, 0.05f, 0.05f, 1, 1); /* another cell of the same four */
    put(cells, -0.05f, 0.05f, 0.05f, 1, 2);
    means m = means_of(cells, 2);
    assert_int_equal(m.count, 2);
    assert_near(m.points, 0.05, 0.05, 0.05);
    assert_near(m.points + 3, 0.25, 0.05, 0.05);
    assert_int_equal(means_of(cells, 1).count, 4);
    assert_int_equal(means_of(cells, 3).count, 0);
    npg_cells_close(&cells);
}

/* ---- a table that becomes full ---- */

enum { POINTS = 3000 };

typedef struct input {
    float points[POINTS][3], weights[POINTS];
} input;

/* On a wavy sheet around the origin, in the middle of cells of 1/64, so that no mean lies on their border. */
static void make_input(input *in)
{
    shape_random random = {5};
    for (size_t i = 0; i < POINTS; i++) {
        double x = floor(128 * shape_uniform(&random)) - 64, y = floor(128 * shape_uniform(&random)) - 64;
        double z = floor(4 * sin(0.05 * x) - 3 * cos(0.04 * y));
        const double cell[3] = {x, y, z};
        for (int a = 0; a < 3; a++)
            in->points[i][a] = (float)((cell[a] + 0.3 + 0.4 * shape_uniform(&random)) / 64);
        in->weights[i] = (float)(0.2 + shape_uniform(&random));
    }
}

static npg_cells *filled(const input *in, size_t most)
{
    npg_cells *cells = cells_of(1.0 / 64, most);
    for (size_t i = 0; i < POINTS; i++)
        put(cells, in->points[i][0], in->points[i][1], in->points[i][2], in->weights[i], (int64_t)i / 500);
    return cells;
}

static bool is_in_the_same_cube(const float a[3], const float b[3], double side)
{
    for (int i = 0; i < 3; i++)
        if (floor((double)a[i] / side) != floor((double)b[i] / side)) return false;
    return true;
}

/* Every mean is that of all points in its cube, found without any table. */
static size_t check_mean(const input *in, const float *mean, double side)
{
    double sum[3] = {0, 0, 0}, weight = 0;
    size_t count = 0;
    for (size_t i = 0; i < POINTS; i++) {
        if (!is_in_the_same_cube(in->points[i], mean, side)) continue;
        for (int a = 0; a < 3; a++) sum[a] += (double)(in->weights[i] * in->points[i][a]);
        weight += (double)in->weights[i];
        count++;
    }
    assert_true(count > 0);
    assert_near(mean, sum[0] / weight, sum[1] / weight, sum[2] / weight);
    return count;
}

static void a_full_table_takes_larger_cubes(void **state)
{
    static input in;
    size_t covered = 0;
    (void)state;
    make_input(&in);
    npg_cells *cells = filled(&in, 300);
    double doublings = log2(64 * npg_cells_side(cells));
    assert_true(doublings >= 1 && doublings <= 5 && doublings == floor(doublings));
    assert_in_range(npg_cells_count(cells), 50, 300);
    means m = means_of(cells, 1);
    assert_int_equal(m.count, npg_cells_count(cells));
    for (size_t i = 0; i < m.count; i++) covered += check_mean(&in, m.points + 3 * i, npg_cells_side(cells));
    assert_int_equal(covered, POINTS); /* so no two means share a cube, and no point is lost */
    npg_cells_close(&cells);
}

static void equal_input_gives_equal_bytes(void **state)
{
    static input in;
    static means m[2];
    (void)state;
    make_input(&in);
    for (int i = 0; i < 2; i++) {
        npg_cells *cells = filled(&in, 300);
        m[i] = means_of(cells, 3);
        npg_cells_close(&cells);
    }
    assert_true(m[0].count > 0);
    assert_memory_equal(&m[0], &m[1], sizeof m[0]);
}

/* Cubes on both sides of 0 never become one: eight of them, each with eight octants, are the least. */
static void a_table_for_one_cell_ends(void **state)
{
    npg_cells *cells = cells_of(0.01, 1);
    (void)state;
    for (int i = 0; i < 64; i++) {
        const float at[3] = {i & 1 ? 0.3f : -0.3f, i & 2 ? 0.3f : -0.3f, i & 4 ? 0.3f : -0.3f};
        const float facing[3] = {i & 8 ? 1 : -1, i & 16 ? 1 : -1, i & 32 ? 1 : -1};
        for (int64_t frame = 0; frame < 2; frame++)
            assert_int_equal(npg_cells_add(cells, at, facing, at, facing, 1, frame), NPG_OK);
    }
    assert_int_equal(means_of(cells, 2).count, 64);
    npg_cells_close(&cells);
}

static npg_status fill_with_failure(const input *in, uint64_t n)
{
    npg_cells *cells = NULL;
    npg_memory_fail_at(n, false);
    npg_status status = npg_cells_open(&cells, 1.0 / 64, 300);
    const float up[3] = {0, 0, 1};
    for (size_t i = 0; i < POINTS && !status; i++)
        status = npg_cells_add(cells, in->points[i], up, in->points[i], up, 1, 0);
    npg_memory_fail_at(0, false);
    npg_cells_close(&cells);
    return status;
}

static void memory_that_fails_is_reported(void **state)
{
    static input in;
    uint64_t n = 1;
    (void)state;
    make_input(&in);
    for (; fill_with_failure(&in, n) == NPG_MEMORY; n++) assert_int_equal(npg_memory_used(), 0);
    assert_true(n > 9); /* opening takes five; the rest are of growing */
    assert_int_equal(fill_with_failure(&in, n), NPG_OK);
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(means_are_weighted_by_their_points),
        cmocka_unit_test(two_sides_of_a_thin_sheet_stay_two),
        cmocka_unit_test(what_few_frames_saw_is_left_out),
        cmocka_unit_test(a_full_table_takes_larger_cubes),
        cmocka_unit_test(equal_input_gives_equal_bytes),
        cmocka_unit_test(a_table_for_one_cell_ends),
        cmocka_unit_test(memory_that_fails_is_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
