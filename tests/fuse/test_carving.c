/* Carving: what sensors see around a body that moves, voted over frames. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "fuse/fuse_internal.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/image_space.h"
#include "tests/support/shapes.h"

/* The reference is a ball of radius 0.5 (0.4 along y) that has swallowed a pit: the body has, where z > 0.3,
 * a floor at z = 0.3 instead.  It moves from frame to frame before a sensor. */
enum { FRAMES = 5, POINTS = 60000 };
#define PIT  0.3
#define SIDE 0.03

typedef struct capture {
    npg_mesh *mesh;
    npg_skin *carry;
    npg_carving *cells;
    float *now; /* V x 3 */
    float points[3 * POINTS];
    size_t count;
} capture;

static void open_capture(capture *c)
{
    c->mesh = ball_mesh(40, 60);
    assert_int_equal(npg_alloc_array(&c->now, NPG_FOR_RUN, c->mesh->vert_count, 3 * sizeof(float)), NPG_OK);
    assert_int_equal(npg_skin_open(&c->carry, c->mesh), NPG_OK);
    assert_int_equal(npg_carving_open(&c->cells, c->mesh, SIDE, 0.2, 100000), NPG_OK);
}

static void close_capture(capture *c)
{
    npg_carving_close(&c->cells);
    npg_skin_close(&c->carry);
    npg_release(&c->now);
    npg_mesh_unref(&c->mesh);
    assert_int_equal(npg_memory_used(), 0);
}

/* Moved as a whole, and turned about z. */
static void move(float out[3], const float in[3], int frame)
{
    double angle = 0.4 * frame, x = (double)in[0], y = (double)in[1];
    out[0] = (float)(cos(angle) * x - sin(angle) * y + 0.3 * frame);
    out[1] = (float)(sin(angle) * x + cos(angle) * y - 0.1 * frame);
    out[2] = in[2];
}

/* Points of the body, on the side that faces the sensor. */
static void see_body(capture *c, const float sensor[3], int frame)
{
    shape_random random = {11};
    static float unused[3 * POINTS], ball[3 * POINTS];
    shape_sphere(unused, ball, POINTS, 1, &random);
    c->count = 0;
    for (size_t i = 0; i < POINTS; i++) {
        float rest[3] = {0.5f * ball[3 * i], 0.4f * ball[3 * i + 1], 0.5f * ball[3 * i + 2]}, normal[3],
              at[3], way[3];
        bool is_floor = rest[2] > (float)PIT;
        if (is_floor) rest[2] = (float)PIT;
        const float steep[3] = {rest[0] / 0.25f, rest[1] / 0.16f, rest[2] / 0.25f}, up[3] = {0, 0, 1},
                    zero[3] = {0, 0, 0};
        move(at, rest, frame);
        move(normal, is_floor ? up : steep, frame);
        move(way, zero, frame);
        float facing = 0;
        for (int a = 0; a < 3; a++) facing += (normal[a] - way[a]) * (sensor[a] - at[a]);
        if (facing <= 0) continue;
        memcpy(c->points + 3 * c->count++, at, sizeof at);
    }
}

static npg_status see(capture *c, const float sensor[3], int frame)
{
    npg_seen seen = {.sensors = sensor, .sensor_count = 1, .points = c->points, .bin = 0.02, .margin = 0.02};
    for (size_t v = 0; v < c->mesh->vert_count; v++) move(c->now + 3 * v, c->mesh->vert_pos + 3 * v, frame);
    npg_skin_pose(c->carry, c->now);
    see_body(c, sensor, frame);
    seen.point_count = c->count;
    return npg_carving_see(c->cells, c->carry, &seen);
}

/* Which of the empty cells lie in the pit, outside, and in the body. */
typedef struct sums {
    size_t pit, outside, body;
} sums;

static sums find(const capture *c, int frames_least, double share)
{
    sums s = {0, 0, 0};
    float *places;
    assert_int_equal(npg_alloc_array(&places, NPG_FOR_RUN, npg_carving_count(c->cells), 3 * sizeof(float)),
                     NPG_OK);
    size_t count = npg_carving_find(c->cells, places, frames_least, share);
    for (size_t i = 0; i < count; i++) {
        const float *p = places + 3 * i;
        bool is_in_ball = p[0] * p[0] / 0.25f + p[1] * p[1] / 0.16f + p[2] * p[2] / 0.25f < 0.98f;
        s.pit += is_in_ball && p[2] > (float)PIT;
        s.body += is_in_ball && p[2] < (float)PIT - 0.01f;
        s.outside += !is_in_ball;
    }
    npg_release(&places);
    return s;
}

static void a_pit_is_seen_from_above(void **state)
{
    static capture c;
    const float above[3] = {0.6f, 0.1f, 4};
    (void)state;
    open_capture(&c);
    assert_true(npg_carving_count(c.cells) > 5000);
    assert_int_equal(find(&c, 1, 0.5).outside, 0);
    for (int f = 0; f < FRAMES; f++) assert_int_equal(see(&c, above, f), NPG_OK);
    sums s = find(&c, 2, 0.6);
    /* the pit's volume is that of a cap; the margin over its floor is not empty, nor what is hidden below */
    double volume = M_PI * 0.4 / 0.5 * 0.2 * 0.2 * (0.5 - 0.2 / 3), cells = volume / (SIDE * SIDE * SIDE);
    assert_true((double)s.pit > 0.5 * cells && (double)s.pit < 1.05 * cells);
    assert_true(s.outside > 500);
    assert_int_equal(s.body, 0);
    close_capture(&c);
}

/* From the side the pit's inside lies beside all that is seen; from below it is hidden. */
static void what_is_hidden_is_not_empty(void **state)
{
    static capture c;
    const float below[3] = {0.6f, 0.1f, -4}, aside[3] = {9, 0, 0};
    (void)state;
    open_capture(&c);
    for (int f = 0; f < FRAMES; f++) assert_int_equal(see(&c, below, f), NPG_OK);
    sums s = find(&c, 1, 0.5);
    assert_int_equal(s.pit, 0);
    assert_int_equal(s.body, 0);
    for (int f = 0; f < FRAMES; f++) assert_int_equal(see(&c, aside, f), NPG_OK);
    assert_true(find(&c, 2, 0.6).pit > 50);
    close_capture(&c);
}

/* One frame alone does not prove what others contradict. */
static void frames_vote(void **state)
{
    static capture c;
    const float above[3] = {0.6f, 0.1f, 4};
    (void)state;
    open_capture(&c);
    assert_int_equal(see(&c, above, 0), NPG_OK);
    assert_true(find(&c, 1, 0.6).pit > 0);
    assert_int_equal(find(&c, 2, 0.6).pit, 0);
    for (size_t i = 0; i < POINTS; i++) c.points[3 * i + 2] = 0.45f; /* a lid: the cells below its height */
    npg_seen seen = {above, 1, c.points, c.count, 0.02, 0.2, NULL, false};
    for (int f = 0; f < 2; f++) assert_int_equal(npg_carving_see(c.cells, c.carry, &seen), NPG_OK);
    assert_int_equal(find(&c, 1, 0.6).pit, 0);
    close_capture(&c);
}

/* A frame of which an image shows a screen at z, as wide as it sees from (0, 0, -4) along z. */
static void see_screen_of(const capture *c, float z, bool is_key)
{
    enum { WIDTH = 80 };
    static float image[WIDTH * WIDTH];
    npg_seen seen = {.sensor_count = 1, .is_key = is_key};
    for (int i = 0; i < WIDTH * WIDTH; i++) image[i] = 4 + z;
    npg_skin_pose(c->carry, c->mesh->vert_pos);
    seen.space = image_space(image, WIDTH, image_from_below);
    assert_int_equal(npg_carving_see(c->cells, c->carry, &seen), NPG_OK);
    npg_free_space_close(&seen.space);
}

static void see_screen(const capture *c, float z)
{
    see_screen_of(c, z, false);
}

static void images_vote(void **state)
{
    static capture c;
    (void)state;
    open_capture(&c);
    assert_int_equal(find(&c, 1, 0.2).body, 0);
    see_screen(&c, 2); /* behind all of the ball */
    sums all = find(&c, 1, 0.2);
    assert_true(all.pit > 50 && all.body > 1000);
    for (int i = 0; i < 4; i++) see_screen(&c, 0.4F);
    assert_int_equal(find(&c, 1, 0.2).pit, all.pit); /* one of five */
    see_screen(&c, 0.4F);
    sums most = find(&c, 1, 0.2);
    assert_true(most.pit < all.pit / 2);   /* one of six, where the screen is */
    assert_true(most.body > all.body / 2); /* what lies before it is empty in all frames */
    close_capture(&c);
}

static void nearly_all_must_speak_against_the_keyframe(void **state)
{
    static capture c;
    (void)state;
    open_capture(&c);
    see_screen_of(&c, 0.4F, true);
    for (int i = 0; i < 3; i++) see_screen(&c, 2);
    size_t three_of_four = find(&c, 1, 0.2).pit;
    see_screen(&c, 2);
    size_t four_of_five = find(&c, 1, 0.2).pit;
    assert_true(four_of_five > 50 && three_of_four < four_of_five / 2);
    close_capture(&c);
}

/* A sensor without a place says nothing, and cells grow where they would be too many. */
static void bounds_hold(void **state)
{
    static capture c;
    const float nowhere[3] = {NAN, 0, 0};
    npg_carving *few;
    (void)state;
    open_capture(&c);
    assert_int_equal(see(&c, nowhere, 0), NPG_OK);
    assert_int_equal(find(&c, 1, 0).pit, 0);
    assert_int_equal(npg_carving_open(&few, c.mesh, 1e-5, 0.2, 2000), NPG_OK);
    assert_true(npg_carving_count(few) <= 2000 && npg_carving_count(few) > 500);
    assert_true(npg_carving_side(few) > 1e-5);
    npg_carving_close(&few);
    close_capture(&c);
}

static void memory_that_fails_is_reported(void **state)
{
    static capture c;
    const float above[3] = {0.6f, 0.1f, 4};
    npg_carving *cells;
    (void)state;
    open_capture(&c);
    size_t used = npg_memory_used();
    npg_status status = NPG_MEMORY;
    for (uint64_t n = 1; status == NPG_MEMORY; n++) {
        npg_memory_fail_at(n, false);
        status = npg_carving_open(&cells, c.mesh, SIDE, 0.2, 100000);
        npg_memory_fail_at(0, false);
        if (status) assert_int_equal(npg_memory_used(), used);
    }
    assert_int_equal(status, NPG_OK);
    npg_carving_close(&cells);
    assert_int_equal(see(&c, above, 0), NPG_OK);
    npg_seen seen = {above, 1, c.points, c.count, 0.02, 0.02, NULL, false};
    npg_memory_fail_at(1, false);
    assert_int_equal(npg_carving_see(c.cells, c.carry, &seen), NPG_MEMORY);
    npg_memory_fail_at(0, false);
    close_capture(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_pit_is_seen_from_above),
        cmocka_unit_test(what_is_hidden_is_not_empty),
        cmocka_unit_test(frames_vote),
        cmocka_unit_test(images_vote),
        cmocka_unit_test(nearly_all_must_speak_against_the_keyframe),
        cmocka_unit_test(bounds_hold),
        cmocka_unit_test(memory_that_fails_is_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
