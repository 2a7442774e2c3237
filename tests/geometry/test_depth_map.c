/* Depth map: a ball before a wall, as one sensor sees them: empty, there, hidden, beside; edges, holes. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/geometry.h"
#include "geometry/sensor_space.h"
#include "pipeline/memory.h"

/* The sensor stands at -4 on an axis and looks along it; a ball of radius 0.5 around the origin, behind it a
 * wall at 1, four wide. */
enum { WALL = 200, COUNT = WALL * WALL };
#define BIN    0.04
#define MARGIN 0.05

typedef struct scene {
    float points[3 * COUNT], sensor[3];
    uint8_t which[COUNT];
    size_t count;
    int axis;
} scene;

static void put(float out[3], const scene *s, double ahead, double x, double y)
{
    out[s->axis] = (float)ahead;
    out[(s->axis + 1) % 3] = (float)x;
    out[(s->axis + 2) % 3] = (float)y;
}

/* How far along the ray to a place of the wall the first thing is, 1 at the wall. */
static double hit(double x, double y)
{
    const double way[3] = {5, x, y}, length = sqrt(25 + x * x + y * y);
    double along = 4 * way[0] / length, miss_sq = 16 - along * along;
    if (miss_sq > 0.25) return 1;
    return (along - sqrt(0.25 - miss_sq)) / length;
}

static void make_scene(scene *s, int axis, double hole)
{
    s->axis = axis;
    s->count = 0;
    put(s->sensor, s, -4, 0, 0);
    for (int i = 0; i < COUNT; i++) {
        double x = (i % WALL + 0.5) * 4 / WALL - 2, y = (double)(i / WALL + 0.5) * 4 / WALL - 2,
               share = hit(x, y);
        if (hypot(x - 1.2, y) < hole) continue;
        put(s->points + 3 * s->count, s, -4 + 5 * share, x * share, y * share);
        s->which[s->count++] = share < 1 ? 7 : 3; /* as if one sensor saw the ball, another the wall */
    }
}

static npg_depth_map *open_map(const scene *s)
{
    npg_depth_map *map;
    assert_int_equal(npg_depth_map_open(&map, s->sensor, s->points, s->count, BIN, MARGIN), NPG_OK);
    return map;
}

/* Of a part of the scene alone. */
static npg_depth_map *open_map_of(const scene *s, uint8_t which)
{
    static scene part;
    part = *s;
    part.count = 0;
    for (size_t i = 0; i < s->count; i++)
        if (s->which[i] == which)
            memcpy(part.points + 3 * part.count++, s->points + 3 * i, 3 * sizeof(float));
    return open_map(&part);
}

static npg_sight_kind look(const npg_depth_map *map, const scene *s, double ahead, double x, double y)
{
    float place[3];
    put(place, s, ahead, x, y);
    return npg_depth_map_look(map, place);
}

/* From the wall's end outward: there, then too near to say, then beside. */
static void assert_end_is_open(const npg_depth_map *map, const scene *s)
{
    const npg_sight_kind order[3] = {NPG_SEEN_AT, NPG_SEEN_UNKNOWN, NPG_SEEN_BESIDE};
    size_t at = 0;
    for (double x = 1.98; x < 2.5; x += 0.005) {
        npg_sight_kind kind = look(map, s, 1, x, 0.1);
        if (kind != order[at]) at++;
        assert_true(at < 3 && kind == order[at]);
    }
    assert_int_equal(at, 2);
}

static void a_ball_before_a_wall(void **state)
{
    static scene s;
    (void)state;
    for (int axis = 0; axis < 3; axis++) {
        make_scene(&s, axis, 0);
        npg_depth_map *map = open_map(&s);
        assert_int_equal(look(map, &s, -0.5, 0, 0), NPG_SEEN_AT);     /* the ball's front */
        assert_int_equal(look(map, &s, -0.6, 0, 0), NPG_SEEN_EMPTY);  /* before it */
        assert_int_equal(look(map, &s, -3.9, 0, 0), NPG_SEEN_EMPTY);  /* near the sensor */
        assert_int_equal(look(map, &s, -0.47, 0, 0), NPG_SEEN_AT);    /* within the margin behind it */
        assert_int_equal(look(map, &s, 0, 0, 0), NPG_SEEN_HIDDEN);    /* in the ball */
        assert_int_equal(look(map, &s, 0.8, 0, 0), NPG_SEEN_HIDDEN);  /* between ball and wall */
        assert_int_equal(look(map, &s, 0.8, 1.2, 0), NPG_SEEN_EMPTY); /* beside the ball, before the wall */
        assert_int_equal(look(map, &s, 1, 1.2, 0.3), NPG_SEEN_AT);    /* the wall */
        assert_int_equal(look(map, &s, 1.2, 1.2, 0.3), NPG_SEEN_HIDDEN); /* behind it */
        assert_int_equal(look(map, &s, 1, 3, 0), NPG_SEEN_BESIDE);       /* past its end */
        assert_int_equal(look(map, &s, -8, 0, 0), NPG_SEEN_BESIDE);      /* behind the sensor */
        assert_end_is_open(map, &s);
        npg_depth_map_close(&map);
        assert_null(map);
    }
    assert_int_equal(npg_memory_used(), 0);
}

/* On the ball's outline bins beside each other saw the ball and the wall: between them nothing is empty. */
static void the_outline_proves_nothing(void **state)
{
    static scene s;
    (void)state;
    make_scene(&s, 0, 0);
    npg_depth_map *map = open_map(&s);
    for (int i = 0; i < 100; i++) {
        double angle = 0.0628 * i;
        assert_int_equal(look(map, &s, 0, 0.505 * cos(angle), 0.505 * sin(angle)), NPG_SEEN_AT);
        assert_int_equal(look(map, &s, 0, 0.65 * cos(angle), 0.65 * sin(angle)), NPG_SEEN_EMPTY);
    }
    npg_depth_map_close(&map);
}

/* No point in a direction: inside of the outline that is a hole in what was seen, and not empty space. */
static void a_hole_is_unknown(void **state)
{
    static scene s;
    (void)state;
    make_scene(&s, 2, 0.3);
    npg_depth_map *map = open_map(&s);
    assert_int_equal(look(map, &s, 1, 1.2, 0), NPG_SEEN_UNKNOWN);
    assert_int_equal(look(map, &s, 0, 0.95, 0), NPG_SEEN_UNKNOWN);
    assert_int_equal(look(map, &s, 0.8, 1.2, 0.6), NPG_SEEN_EMPTY);
    npg_depth_map_close(&map);
}

static void parts_of_a_scene_say_what_they_saw(void **state)
{
    static scene s;
    (void)state;
    make_scene(&s, 1, 0);
    npg_depth_map *ball = open_map_of(&s, 7), *wall = open_map_of(&s, 3), *none = open_map_of(&s, 1);
    assert_int_equal(look(ball, &s, 0.8, 1.2, 0), NPG_SEEN_BESIDE);
    assert_int_equal(look(ball, &s, -0.6, 0, 0), NPG_SEEN_EMPTY);
    assert_int_equal(look(wall, &s, -0.6, 0, 0), NPG_SEEN_UNKNOWN); /* the ball's shadow: a hole */
    assert_int_equal(look(wall, &s, 0.8, 1.2, 0), NPG_SEEN_EMPTY);
    assert_int_equal(look(none, &s, -0.6, 0, 0), NPG_SEEN_UNKNOWN);
    npg_depth_map_close(&ball);
    npg_depth_map_close(&wall);
    npg_depth_map_close(&none);
}

/* All around: every direction has its bin, and the map's seams are no edges. */
static void a_sensor_inside_sees_all_around(void **state)
{
    enum { N = 60000 };
    static float points[3 * N];
    const float sensor[3] = {0.1f, 0, 0};
    npg_depth_map *map;
    (void)state;
    for (int i = 0; i < N; i++) { /* Fibonacci's lattice */
        double z = 1 - (2 * i + 1.0) / N, angle = 2.399963 * i, r = sqrt(1 - z * z);
        const float at[3] = {(float)(r * cos(angle)), (float)(r * sin(angle)), (float)z};
        memcpy(points + 3 * i, at, sizeof at);
    }
    assert_int_equal(npg_depth_map_open(&map, sensor, points, N, 0.04, 0.05), NPG_OK);
    for (int i = 0; i < N; i += 7) {
        const float *p = points + 3 * i;
        const float before[3] = {0.8f * p[0], 0.8f * p[1], 0.8f * p[2]},
                    behind[3] = {1.3f * p[0], 1.3f * p[1], 1.3f * p[2]};
        assert_int_equal(npg_depth_map_look(map, p), NPG_SEEN_AT);
        assert_int_equal(npg_depth_map_look(map, before), NPG_SEEN_EMPTY);
        assert_int_equal(npg_depth_map_look(map, behind), NPG_SEEN_HIDDEN);
    }
    assert_int_equal(npg_depth_map_look(map, sensor), NPG_SEEN_UNKNOWN);
    npg_depth_map_close(&map);
}

static void memory_that_fails_is_reported(void **state)
{
    static scene s;
    npg_depth_map *map;
    uint64_t n = 1;
    (void)state;
    make_scene(&s, 0, 0);
    for (npg_status status = NPG_MEMORY; status == NPG_MEMORY; n++) {
        npg_memory_fail_at(n, false);
        status = npg_depth_map_open(&map, s.sensor, s.points, s.count, BIN, MARGIN);
        npg_memory_fail_at(0, false);
        assert_true(status == NPG_MEMORY || status == NPG_OK);
        if (status) assert_int_equal(npg_memory_used(), 0);
    }
    assert_true(n > 4);
    npg_depth_map_close(&map);
    assert_int_equal(npg_memory_used(), 0);
}

/* ---- cube sets ---- */

static void between_the_middles_of_cubes_the_value_is_linear(void **state)
{
    const float middles[6] = {0.25f, 0.25f, 0.25f, -0.25f, 0.25f, 0.25f};
    const float in[3] = {0, 0.25f, 0.25f}, half[3] = {0.5f, 0.25f, 0.25f}, eighth[3] = {0.5f, 0.5f, 0.5f},
                out[3] = {0.75f, 0.25f, 0.25f}, far[3] = {1e9f, -1e9f, 0};
    npg_cube_set *set;
    (void)state;
    assert_int_equal(npg_cube_set_open(&set, middles, 2, 0.5), NPG_OK);
    assert_true(npg_cube_set_value(set, middles) == 1);
    assert_true(npg_cube_set_value(set, in) == 1);
    assert_true(npg_cube_set_value(set, half) == 0.5);
    assert_true(npg_cube_set_value(set, eighth) == 0.125);
    assert_true(npg_cube_set_value(set, out) == 0);
    assert_true(npg_cube_set_value(set, far) == 0);
    npg_cube_set_close(&set);
    assert_int_equal(npg_cube_set_open(&set, middles, 0, 0.5), NPG_OK);
    assert_true(npg_cube_set_value(set, middles) == 0);
    npg_cube_set_close(&set);
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_ball_before_a_wall),
                                       cmocka_unit_test(the_outline_proves_nothing),
                                       cmocka_unit_test(a_hole_is_unknown),
                                       cmocka_unit_test(parts_of_a_scene_say_what_they_saw),
                                       cmocka_unit_test(a_sensor_inside_sees_all_around),
                                       cmocka_unit_test(memory_that_fails_is_reported),
                                       cmocka_unit_test(between_the_middles_of_cubes_the_value_is_linear)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
