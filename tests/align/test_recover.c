/* Recover: lost frames are found again from the frames around them, also where the body has gone lengths away;
 * what is not lost is left alone; where nothing helps the attempts end. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "align/align_internal.h"
#include "tests/support/ball_capture.h"

/* Frames that were made to be lost are as good again as they were. */
static void assert_all_are_found(capture *c, const double *before, int lost)
{
    npg_recover_result result;
    assert_int_equal(npg_recover(c->tracker, &result, c->frames, FRAMES, NULL, NULL), NPG_OK);
    print_message("%d lost, %d found in %d fits\n", (int)result.lost, (int)result.found, (int)result.tried);
    assert_int_equal(result.lost, lost);
    assert_true(result.tried <= 16); /* 18 to 20 where what has not changed is tried again */
    for (int t = 0; t < FRAMES; t++) {
        print_message("frame %d: %.2g, first %.2g\n", t, c->frames[t].tracked.chamfer, before[t]);
        assert_true(c->frames[t].tracked.chamfer < 2 * before[t]);
    }
    close_capture(c);
}

static void open_known(capture *c, double before[FRAMES])
{
    open_capture(c);
    for (int t = 0; t < FRAMES; t++) before[t] = c->frames[t].tracked.chamfer;
}

static void lost_frames_are_found_from_those_around(void **state)
{
    static capture c;
    double before[FRAMES];
    const int lost[] = {0, 3, 4, 5};
    (void)state;
    open_known(&c, before);
    for (int i = 0; i < 4; i++) lose(&c, lost[i]);
    assert_all_are_found(&c, before, 4);
}

/* The second half of the frames is elsewhere: neither the poses around them nor the motion there leads to
 * where the body went. */
static void lose_far_away(capture *c)
{
    for (int t = FRAMES / 2; t < FRAMES; t++) {
        lose(c, t);
        for (int i = 0; i < VERTS; i++) c->points[t][3 * i] += 4;
    }
}

static void lost_frames_are_found_where_the_body_went(void **state)
{
    static capture c;
    double before[FRAMES];
    (void)state;
    open_known(&c, before);
    lose_far_away(&c);
    assert_all_are_found(&c, before, FRAMES / 2);
}

/* That is known by its poses alone. */
static void lost_frames_are_found_from_the_group_before(void **state)
{
    static capture c;
    double before[FRAMES];
    (void)state;
    open_known(&c, before);
    lose_far_away(&c);
    for (int t = 0; t < FRAMES / 2; t++) {
        c.frames[t].is_fixed = true;
        c.frames[t].cloud.points = NULL;
    }
    assert_all_are_found(&c, before, FRAMES / 2);
}

static void what_is_found_is_left_alone(void **state)
{
    static capture c;
    npg_recover_result result;
    (void)state;
    open_capture(&c);
    double *poses;
    assert_int_equal(npg_alloc_array(&poses, NPG_FOR_RUN, FRAMES * c.size, sizeof(double)), NPG_OK);
    for (int t = 0; t < FRAMES; t++) c.frames[t].tracked.chamfer = 1e-4;
    lose(&c, 2);
    memcpy(poses, c.poses, FRAMES * c.size * sizeof *poses);
    c.frames[2].is_fixed =
        true; /* of the group before: no place to start from, and not this group's to mend */
    assert_int_equal(npg_recover(c.tracker, &result, c.frames, FRAMES, NULL, NULL), NPG_OK);
    assert_int_equal(result.lost + result.tried, 0);
    assert_memory_equal(poses, c.poses, FRAMES * c.size * sizeof *poses);
    npg_release(&poses);
    close_capture(&c);
}

/* As frames with few points, or with holes, have it: their surface is farther from points, each by as much as its
 * holes are large, but the points are not from it.  Where the others are alike, it is no hole. */
static void surface_without_points_is_lost_among_alike(void **state)
{
    static capture c;
    npg_recover_result result;
    (void)state;
    open_capture(&c);
    for (int t = 0; t < FRAMES; t++) {
        c.frames[t].tracked.point_dist_sq = 1e-5;
        c.frames[t].tracked.chamfer = 0.02 * (t + 1);
    }
    c.frames[2].tracked.chamfer = 0.3;
    assert_int_equal(npg_recover(c.tracker, &result, c.frames, FRAMES, NULL, NULL), NPG_OK);
    assert_int_equal(result.lost + result.tried, 0);
    c.frames[2].tracked.point_dist_sq = 0.25;
    assert_int_equal(npg_recover(c.tracker, &result, c.frames, FRAMES, NULL, NULL), NPG_OK);
    assert_int_equal(result.lost, 1);
    for (int t = 0; t < FRAMES; t++) {
        c.frames[t].tracked.point_dist_sq = 1e-5;
        c.frames[t].tracked.chamfer = 0.1 + 0.001 * t;
    }
    c.frames[2].tracked.chamfer = 0.13;
    c.frames[2].cloud.count = VERTS / 2; /* half of the body */
    assert_int_equal(npg_recover(c.tracker, &result, c.frames, FRAMES, NULL, NULL), NPG_OK);
    assert_int_equal(result.lost, 0);
    c.frames[2].cloud.count = VERTS;
    assert_int_equal(npg_recover(c.tracker, &result, c.frames, FRAMES, NULL, NULL), NPG_OK);
    assert_int_equal(result.lost, 1);
    close_capture(&c);
}

/* A limb that stands where nothing is may be small against the whole body. */
static void what_images_call_astray_is_lost(void **state)
{
    static capture c;
    npg_recover_result result;
    (void)state;
    open_capture(&c);
    double before = c.frames[2].tracked.chamfer;
    lose(&c, 2);
    for (int t = 0; t < FRAMES; t++) c.frames[t].tracked.chamfer = 2e-4;
    assert_int_equal(npg_recover(c.tracker, &result, c.frames, FRAMES, NULL, NULL), NPG_OK);
    assert_int_equal(result.lost, 0);
    c.frames[2].tracked.by_images = true;
    c.frames[2].tracked.astray = 0.03;
    assert_int_equal(npg_recover(c.tracker, &result, c.frames, FRAMES, NULL, NULL), NPG_OK);
    print_message("%d lost, %d found in %d fits\n", (int)result.lost, (int)result.found, (int)result.tried);
    assert_true(result.lost == 1 && result.found == 1 && c.frames[2].tracked.cost < 2 * before);
    close_capture(&c);
}

/* What no pose of a ball explains. */
static void scatter(capture *c, int t)
{
    for (int i = 0; i < 3 * VERTS; i++)
        c->points[t][i] = (float)((i * 7919 + t * 104729) % 2003) / 1001.5f - 1;
}

static void attempts_end(void **state)
{
    static capture c;
    npg_recover_result result;
    (void)state;
    open_capture(&c);
    for (int t = 0; t < FRAMES;
         t++) { /* what no pose of a ball explains, and what one frame claims to explain */
        scatter(&c, t);
        c.frames[t].tracked.cost = c.frames[t].tracked.chamfer = t > 4 ? 1e-5 : 1e-3;
        c.frames[t].tracked.point_dist_sq = c.frames[t].tracked.chamfer / 2;
    }
    assert_int_equal(npg_recover(c.tracker, &result, c.frames, FRAMES, NULL, NULL), NPG_OK);
    print_message("%d lost, %d found in %d fits\n", (int)result.lost, (int)result.found, (int)result.tried);
    assert_int_equal(result.found, 0);
    assert_true(result.tried > 0 && result.tried <= 4 * 9);
    assert_int_equal(npg_recover(c.tracker, &result, c.frames, FRAMES, stop_at_once, NULL), NPG_STOPPED);
    close_capture(&c);
}

static void a_fit_that_will_not_do_is_given_up(void **state)
{
    static capture c;
    npg_tracked whole, given_up, enough;
    double *pose;
    (void)state;
    open_capture(&c);
    scatter(&c, 3);
    npg_tracker_effort effort = npg_tracker_usual(c.tracker);
    assert_int_equal(npg_alloc_array(&pose, NPG_FOR_RUN, c.size, sizeof *pose), NPG_OK);
    npg_tracked *tracked[] = {&whole, &given_up, &enough};
    for (int way = 0; way < 3; way++) {
        memcpy(pose, c.poses, c.size * sizeof *pose);
        if (way) effort.cost_best = effort.cost_most = way == 1 ? whole.cost / 2 : 2 * whole.cost;
        assert_int_equal(
            npg_tracker_fit(c.tracker, tracked[way], pose, &c.frames[3].cloud, NULL, way ? &effort : NULL),
            NPG_OK);
    }
    print_message("%d steps, %d until it is given up\n", whole.steps, given_up.steps);
    assert_true(given_up.steps < whole.steps && 3 * given_up.steps >= 2 * ball_settings.steps);
    assert_true(given_up.cost > whole.cost / 2);
    assert_memory_equal(&enough, &whole, sizeof whole);
    npg_release(&pose);
    close_capture(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(lost_frames_are_found_from_those_around),
                                       cmocka_unit_test(lost_frames_are_found_where_the_body_went),
                                       cmocka_unit_test(lost_frames_are_found_from_the_group_before),
                                       cmocka_unit_test(what_is_found_is_left_alone),
                                       cmocka_unit_test(surface_without_points_is_lost_among_alike),
                                       cmocka_unit_test(what_images_call_astray_is_lost),
                                       cmocka_unit_test(a_fit_that_will_not_do_is_given_up),
                                       cmocka_unit_test(attempts_end)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
