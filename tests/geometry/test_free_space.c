/* Free space: a square before nothing, as one or two sensors see it: beside, empty, there, hidden, unknown. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "geometry/sensor_space.h"
#include "pipeline/memory.h"

/* The sensor is at (0, 0, -4) and looks along z; its cells are 0.01 of what is ahead wide.  A square of side 0.8
 * stands at z = 0, so 20 cells wide.  Around it is nothing. */
enum { SIDE = 100, HALF = 10 };

typedef struct scene {
    npg_depth_view views[2];
    float cells[2 * SIDE * SIDE];
    npg_frame frame;
} scene;

static const npg_frame_box unit = {.scale = 1};

static void make_scene(scene *s, float around)
{
    *s = (scene){.frame = {.sensor_count = 1, .view_cell_count = SIDE * SIDE}};
    s->views[0] = (npg_depth_view){.to_sensor = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 4},
                                   .first = {-0.5, -0.5},
                                   .step = 0.01,
                                   .width = SIDE,
                                   .height = SIDE};
    for (int i = 0; i < SIDE * SIDE; i++) {
        int x = i % SIDE - SIDE / 2, y = i / SIDE - SIDE / 2;
        s->cells[i] = x >= -HALF && x < HALF && y >= -HALF && y < HALF ? 4 : around;
    }
    s->frame.views = s->views;
    s->frame.view_cells = s->cells;
}

static npg_sight_kind look(const scene *s, const npg_frame_box *box, float x, float y, float z)
{
    npg_free_space *space;
    const float place[3] = {x, y, z};
    assert_int_equal(npg_free_space_open(&space, &s->frame, box), NPG_OK);
    npg_sight_kind kind = npg_free_space_look(space, place);
    assert_int_equal(npg_free_space_is_empty(space, place),
                     kind == NPG_SEEN_EMPTY || kind == NPG_SEEN_BESIDE);
    npg_free_space_close(&space);
    return kind;
}

static void one_sensor_says_five_things(void **state)
{
    static scene s;
    (void)state;
    make_scene(&s, INFINITY);
    assert_int_equal(look(&s, &unit, 0, 0, 0), NPG_SEEN_AT);
    assert_int_equal(look(&s, &unit, 0, 0, 0.1f), NPG_SEEN_AT); /* three cells are 0.12 there */
    assert_int_equal(look(&s, &unit, 0, 0, 0.2f), NPG_SEEN_HIDDEN);
    assert_int_equal(look(&s, &unit, 0, 0, -0.1f), NPG_SEEN_AT);
    assert_int_equal(look(&s, &unit, 0, 0, -0.2f), NPG_SEEN_EMPTY);
    assert_int_equal(look(&s, &unit, 0.45f, 0, 0), NPG_SEEN_UNKNOWN); /* a cell beside the outline */
    assert_int_equal(look(&s, &unit, 0.6f, 0, 0), NPG_SEEN_BESIDE);
    assert_int_equal(look(&s, &unit, 0.6f, 0, 3),
                     NPG_SEEN_HIDDEN); /* what is farther away seems nearer the middle */
    assert_int_equal(look(&s, &unit, 0, 0, -5), NPG_SEEN_UNKNOWN); /* behind the sensor */
    assert_int_equal(look(&s, &unit, 9, 0, 0), NPG_SEEN_UNKNOWN);  /* outside of the image */
}

static void a_margin_is_three_cells_of_the_best_sensor(void **state)
{
    static scene s;
    npg_free_space *space;
    const float there[3] = {0, 0, 0}, beside[3] = {0.6f, 0, 0};
    (void)state;
    make_scene(&s, INFINITY);
    assert_int_equal(npg_free_space_open(&space, &s.frame, &unit), NPG_OK);
    assert_float_equal(npg_free_space_margin(space, there), 0.12, 1e-6);
    assert_float_equal(npg_free_space_margin(space, beside), 0, 0);
    npg_free_space_close(&space);
}

/* Before a wall at z = 2 the square at z = 0 is nearer from where it is hardly missed, and the wall from far off. */
static void the_shortest_way_out_is_found(void **state)
{
    static scene s;
    npg_free_space *space;
    float to[3] = {7, 7, 7};
    (void)state;
    make_scene(&s, 6);
    assert_int_equal(npg_free_space_open(&space, &s.frame, &unit), NPG_OK);
    assert_false(npg_free_space_leave(space, to, (const float[3]){0, 0, 0.05f}));
    assert_float_equal(to[0], 7, 0);
    assert_true(npg_free_space_leave(space, to, (const float[3]){0.1f, 0, -1}));
    assert_true(fabsf(to[2]) < 1e-5F && fabsf(to[0] - 0.1f) < 0.1F); /* ahead, onto the square */
    assert_true(npg_free_space_leave(space, to, (const float[3]){0.7f, 0, 0.5f}));
    assert_true(fabsf(to[0] - 0.4275F) < 0.03F); /* sideways, behind its last column */
    assert_float_equal(to[2], 0.5, 0.05);
    assert_true(npg_free_space_leave(space, to, (const float[3]){1.5f, 0, 1.5f}));
    assert_float_equal(to[2], 2, 0.05); /* onto the wall */
    npg_free_space_close(&space);
}

static void without_any_depth_there_is_no_way_out(void **state)
{
    static scene s;
    npg_free_space *space;
    float to[3] = {7, 7, 7};
    (void)state;
    make_scene(&s, INFINITY);
    for (int i = 0; i < SIDE * SIDE; i++) s.cells[i] = INFINITY;
    assert_int_equal(npg_free_space_open(&space, &s.frame, &unit), NPG_OK);
    assert_false(npg_free_space_leave(space, to, (const float[3]){0, 0, 0}));
    assert_float_equal(to[0], 7, 0);
    npg_free_space_close(&space);
}

static void what_is_not_known_is_not_empty(void **state)
{
    static scene s;
    (void)state;
    make_scene(&s, 0);
    assert_int_equal(look(&s, &unit, 0.6f, 0, 0), NPG_SEEN_UNKNOWN);
    assert_int_equal(look(&s, &unit, 0, 0, -0.2f), NPG_SEEN_EMPTY);
    make_scene(&s, INFINITY);
    s.cells[SIDE / 2 * SIDE + SIDE / 2 + HALF + 5] = 0; /* a pixel without depth, which may be of the body */
    assert_int_equal(look(&s, &unit, 0.6f, 0, 0), NPG_SEEN_UNKNOWN);
    assert_int_equal(look(&s, &unit, 0.6f, 0.3f, 0), NPG_SEEN_BESIDE);
}

static void a_background_that_was_measured_is_no_end(void **state)
{
    static scene s;
    (void)state;
    make_scene(&s, 6); /* a wall */
    assert_int_equal(look(&s, &unit, 1, 0, 0), NPG_SEEN_EMPTY);
    assert_int_equal(look(&s, &unit, 1, 0, 2), NPG_SEEN_AT);
}

static void one_of_two_sensors_is_enough(void **state)
{
    static scene s;
    (void)state;
    make_scene(&s, INFINITY);
    assert_int_equal(look(&s, &unit, 0, 0, 0.5f), NPG_SEEN_HIDDEN);
    s.frame.sensor_count = 2; /* the other one stands at (-4, 0, 0.5) and sees nothing at all */
    s.frame.view_cell_count *= 2;
    s.views[1] = s.views[0];
    s.views[1].at = SIDE * SIDE;
    const double from_the_side[12] = {0, 0, 1, -0.5, 0, 1, 0, 0, 1, 0, 0, 4};
    for (int i = 0; i < 12; i++) s.views[1].to_sensor[i] = from_the_side[i];
    for (int i = 0; i < SIDE * SIDE; i++) s.cells[SIDE * SIDE + i] = INFINITY;
    assert_int_equal(look(&s, &unit, 0, 0, 0.5f), NPG_SEEN_BESIDE);
}

static void the_box_is_minded(void **state)
{
    static scene s;
    const npg_frame_box box = {.scale = 0.5, .centre = {1, 0, 2}};
    (void)state;
    make_scene(&s, INFINITY);
    /* local (0, 0, 0), (0, 0, -0.2), (0.6, 0, 0) */
    assert_int_equal(look(&s, &box, -0.5f, 0, -1), NPG_SEEN_AT);
    assert_int_equal(look(&s, &box, -0.5f, 0, -1.1f), NPG_SEEN_EMPTY);
    assert_int_equal(look(&s, &box, -0.2f, 0, -1), NPG_SEEN_BESIDE);
}

static void a_frame_without_views_says_nothing(void **state)
{
    const npg_frame frame = {.sensor_count = 1};
    npg_free_space *space;
    const float place[3] = {0};
    (void)state;
    assert_int_equal(npg_free_space_open(&space, &frame, &unit), NPG_OK);
    assert_null(space);
    assert_false(npg_free_space_is_empty(space, place));
}

static void no_memory_is_said(void **state)
{
    static scene s;
    npg_free_space *space;
    npg_status status = NPG_MEMORY;
    (void)state;
    make_scene(&s, INFINITY);
    for (int64_t n = 1; status == NPG_MEMORY && n < 20; n++) {
        npg_memory_fail_at(n, false);
        status = npg_free_space_open(&space, &s.frame, &unit);
        npg_memory_fail_at(0, false);
        if (status) assert_null(space);
    }
    assert_int_equal(status, NPG_OK);
    npg_free_space_close(&space);
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_sensor_says_five_things),
        cmocka_unit_test(a_margin_is_three_cells_of_the_best_sensor),
        cmocka_unit_test(the_shortest_way_out_is_found),
        cmocka_unit_test(without_any_depth_there_is_no_way_out),
        cmocka_unit_test(what_is_not_known_is_not_empty),
        cmocka_unit_test(a_background_that_was_measured_is_no_end),
        cmocka_unit_test(one_of_two_sensors_is_enough),
        cmocka_unit_test(the_box_is_minded),
        cmocka_unit_test(a_frame_without_views_says_nothing),
        cmocka_unit_test(no_memory_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
