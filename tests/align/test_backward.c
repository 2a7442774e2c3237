/* Backward tracking: frames that were lost on the way out are found on the way back; what the way back would spoil
 * stays; frames that are fixed, or of which nothing was hidden, are left alone. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "align/align_internal.h"
#include "tests/support/ball_capture.h"

#define KEY 10 /* index of the first frame */

static float since[2 * VERTS]; /* nothing has been hidden for long */

/* The same, as a sensor above the ball sees it. */
static void open_seen(capture *c)
{
    static const float above[3] = {0, 0, 3};
    open_capture(c);
    for (int t = 0; t < FRAMES; t++) {
        c->frames[t].cloud.sensors = above;
        c->frames[t].cloud.sensor_count = 1;
        c->frames[t].since = since;
    }
}

static npg_backward_result sweep(capture *c)
{
    npg_backward_result result;
    assert_int_equal(npg_track_backward(c->tracker, &result, c->frames, FRAMES, KEY, NULL, NULL), NPG_OK);
    return result;
}

static void lost_frames_are_found_on_the_way_back(void **state)
{
    static capture c;
    double last[FRAMES];
    (void)state;
    open_seen(&c);
    for (int t = 0; t < FRAMES; t++) last[t] = c.frames[t].tracked.chamfer;
    for (int t = 3; t < 6; t++) lose(&c, t);
    npg_backward_result result = sweep(&c);
    assert_int_equal(result.tried, FRAMES - 2); /* neither the key nor the outermost */
    assert_true(result.taken >= 3);
    for (int t = 0; t < FRAMES; t++) assert_true(c.frames[t].tracked.chamfer < 2 * last[t]);
    close_capture(&c);
}

static void what_is_right_is_not_led_astray(void **state)
{
    static capture c;
    double last[FRAMES];
    (void)state;
    open_seen(&c);
    for (int t = 0; t < FRAMES; t++) last[t] = c.frames[t].tracked.chamfer;
    lose(&c, FRAMES - 1);
    sweep(&c);
    for (int t = 0; t < FRAMES - 1; t++) assert_true(c.frames[t].tracked.chamfer <= 1.05 * last[t]);
    close_capture(&c);
}

static void others_are_left_alone(void **state)
{
    static capture c;
    npg_backward_result result;
    double *poses;
    (void)state;
    open_seen(&c);
    size_t bytes = FRAMES * c.size * sizeof *poses;
    assert_int_equal(npg_alloc(&poses, NPG_FOR_RUN, bytes), NPG_OK);
    memcpy(poses, c.poses, bytes);
    assert_int_equal(npg_track_backward(c.tracker, &result, c.frames, FRAMES, KEY, stop_at_once, NULL),
                     NPG_STOPPED);
    for (int t = 0; t < FRAMES; t += 2) c.frames[t].is_fixed = true;
    for (int t = 1; t < FRAMES; t += 2) c.frames[t].since = NULL;
    result = sweep(&c);
    assert_int_equal(result.tried, 0);
    assert_memory_equal(poses, c.poses, bytes);
    npg_release(&poses);
    close_capture(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(lost_frames_are_found_on_the_way_back),
                                       cmocka_unit_test(what_is_right_is_not_led_astray),
                                       cmocka_unit_test(others_are_left_alone)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
