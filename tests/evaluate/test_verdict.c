/* Verdict: what is wrong with a frame beside the others of its capture. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "evaluate/evaluate_internal.h"
#include "pipeline/memory.h"

enum { FRAMES = 20, KEY = 5 };

static npg_frame frames[FRAMES];
static bool is_seen_from; /* sensors are known */

/* A body that goes forward by 1 % of its size a frame, of which all is covered but 2 %. */
static int make_capture(void **state)
{
    (void)state;
    is_seen_from = false;
    memset(frames, 0, sizeof frames);
    for (int t = 0; t < FRAMES; t++) {
        frames[t].index = t;
        frames[t].number = 100 + t;
        frames[t].figures.coverage = 0.98;
        frames[t].figures.vertex_dist_mean = 0.008;
        for (int i = 0; i < 3 * NPG_MARKS; i++) frames[t].figures.marks[i] = 0.1f * (float)i;
        for (int k = 0; k < NPG_MARKS; k++) frames[t].figures.marks[3 * k] += 0.01f * (float)t;
    }
    return 0;
}

static void move(int from, int to, float by)
{
    for (int t = from; t <= to; t++)
        for (int k = 0; k < NPG_MARKS; k++) frames[t].figures.marks[3 * k + 1] += by;
}

/* The faults of the first `count` frames: their kinds, by index; 0 where there is none. */
static void judge(int faults[FRAMES], int count)
{
    npg_verdict verdict = {.bars = {0.25, 0.01, 0.005, is_seen_from}, .key = KEY};
    npg_late_faults late;
    memset(faults, 0, FRAMES * sizeof *faults);
    for (int i = 0; i < count; i++) /* in no order */
        assert_int_equal(npg_verdict_add(&verdict, &frames[(7 * i + 3) % count]), NPG_OK);
    assert_int_equal(npg_verdict_finish(&verdict, &late), NPG_OK);
    for (size_t i = 0; i < late.count; i++) {
        assert_int_equal(late.faults[i].number, 100 + late.faults[i].index);
        assert_true(late.faults[i].value > late.faults[i].bound);
        faults[late.faults[i].index] = late.faults[i].fault;
    }
    npg_release(&late.faults);
    npg_release(&verdict.records);
    assert_int_equal(npg_memory_used(), 0);
}

/* Of all frames, only those from `first` to `last` have a fault, of that kind; 0: none has. */
static void expect(int kind, int first, int last)
{
    int faults[FRAMES];
    judge(faults, FRAMES);
    for (int t = 0; t < FRAMES; t++) assert_int_equal(faults[t], kind && t >= first && t <= last ? kind : 0);
}

static void an_even_capture_has_no_fault(void **state)
{
    (void)state;
    expect(0, 0, 0);
}

static void half_a_body_without_points(void **state)
{
    (void)state;
    frames[9].figures.coverage = 0.505; /* above the bar of 50 % */
    expect(NPG_FAULT_UNCOVERED, 9, 9);
    frames[9].figures.fault = NPG_FAULT_MEDIAN; /* known before: not said again */
    expect(0, 0, 0);
}

/* Legs that change places: in half of the frames and more, and no hole tells of it but in the best ones. */
static void a_part_without_points_in_every_other_frame(void **state)
{
    int faults[FRAMES];
    (void)state;
    for (int t = 0; t < FRAMES; t += 2) frames[t].figures.coverage = 0.9;
    judge(faults, FRAMES);
    for (int t = 0; t < FRAMES; t++) assert_int_equal(faults[t], t % 2 ? 0 : NPG_FAULT_UNCOVERED);
    is_seen_from = true; /* a side that turns away */
    expect(0, 0, 0);
}

static void what_is_usual_in_a_capture_is_no_fault(void **state)
{
    (void)state;
    for (int t = 0; t < FRAMES; t++) {
        frames[t].figures.coverage = 0.6 + 0.02 * (t % 7); /* cameras that see parts */
        frames[t].figures.vertex_dist_mean = 0.03 + 0.01 * (t % 5);
        frames[t].figures.misfits[NPG_MISFIT_STRETCHED].share = 0.01 * (t % 3); /* a body that folds */
        frames[t].figures.misfits[NPG_MISFIT_UNSUPPORTED].share = 0.02 * (t % 3);
    }
    expect(0, 0, 0);
}

static void a_surface_that_stands_off_its_points(void **state)
{
    (void)state;
    is_seen_from = true;
    frames[0].figures.coverage = 0.8;
    frames[0].figures.vertex_dist_mean = 0.02; /* of points that are seen less well */
    expect(0, 0, 0);
    frames[0].figures.vertex_dist_mean = 0.068;
    expect(NPG_FAULT_DISTANCE, 0, 0);
}

static void a_web_in_one_frame(void **state)
{
    (void)state;
    npg_misfit *misfits = frames[9].figures.misfits;
    misfits[NPG_MISFIT_STRETCHED].share = 0.02; /* as over a hole in the points, where it is not bare */
    expect(0, 0, 0);
    misfits[NPG_MISFIT_UNSUPPORTED].share = 0.02;
    expect(NPG_FAULT_TORN, 9, 9);
    misfits[NPG_MISFIT_STRETCHED].share = 0.002; /* bare as it is, of what a sampling leaves out */
    expect(0, 0, 0);
}

static void a_jump_there_and_back(void **state)
{
    (void)state;
    move(12, 12, 0.3f);
    expect(NPG_FAULT_JUMP, 12, 12);
    move(13, 14, 0.3f);
    expect(NPG_FAULT_JUMP, 12, 14);
}

static void a_jump_for_good_is_the_fault_of_the_frame_behind_it(void **state)
{
    (void)state;
    move(12, FRAMES - 1, 0.3f);
    expect(NPG_FAULT_JUMP, 12, 12);
    make_capture(NULL);
    move(0, 2, 0.3f); /* on the other side of the keyframe */
    expect(NPG_FAULT_JUMP, 2, 2);
}

static void a_body_that_begins_to_move_or_stops_does_not_jump(void **state)
{
    (void)state;
    for (int t = 10; t < FRAMES; t++) move(t, FRAMES - 1, 0.1f);
    expect(0, 0, 0);
    make_capture(NULL);
    for (int t = 1; t < 10; t++) move(t, FRAMES - 1, 0.1f);
    expect(0, 0, 0);
}

static void a_body_that_swings_does_not_jump(void **state)
{
    (void)state;
    for (int period = 8; period <= 24; period++) {
        make_capture(NULL);
        for (int t = 0; t < FRAMES; t++) move(t, t, 0.5f * (float)sin(6.2831853 * t / period));
        expect(0, 0, 0);
    }
}

static void frames_that_are_missing_take_their_time(void **state)
{
    int faults[FRAMES];
    (void)state;
    for (int t = 10; t < FRAMES; t++) frames[t].figures.coverage = (double)NAN;
    frames[19].figures.coverage = 0.98; /* ten steps on */
    judge(faults, FRAMES);
    for (int t = 0; t < FRAMES; t++) assert_int_equal(faults[t], 0);
}

static void less_than_the_points_tell_is_no_motion(void **state)
{
    (void)state;
    for (int t = 0; t < FRAMES; t++)
        for (int k = 0; k < NPG_MARKS; k++) frames[t].figures.marks[3 * k] -= 0.01f * (float)t;
    move(12, 12, 0.007f); /* of a body that stands still */
    expect(0, 0, 0);
    move(12, 12, 0.007f);
    expect(NPG_FAULT_JUMP, 12, 12);
}

static void three_frames_say_nothing(void **state)
{
    int faults[FRAMES];
    (void)state;
    frames[1].figures.coverage = 0.5;
    move(1, 1, 0.5f);
    judge(faults, 3);
    assert_int_equal(faults[1], 0);
    judge(faults, 5);
    assert_int_equal(faults[1], NPG_FAULT_UNCOVERED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(an_even_capture_has_no_fault, make_capture),
        cmocka_unit_test_setup(half_a_body_without_points, make_capture),
        cmocka_unit_test_setup(a_part_without_points_in_every_other_frame, make_capture),
        cmocka_unit_test_setup(what_is_usual_in_a_capture_is_no_fault, make_capture),
        cmocka_unit_test_setup(a_surface_that_stands_off_its_points, make_capture),
        cmocka_unit_test_setup(a_web_in_one_frame, make_capture),
        cmocka_unit_test_setup(a_jump_there_and_back, make_capture),
        cmocka_unit_test_setup(a_jump_for_good_is_the_fault_of_the_frame_behind_it, make_capture),
        cmocka_unit_test_setup(a_body_that_begins_to_move_or_stops_does_not_jump, make_capture),
        cmocka_unit_test_setup(a_body_that_swings_does_not_jump, make_capture),
        cmocka_unit_test_setup(frames_that_are_missing_take_their_time, make_capture),
        cmocka_unit_test_setup(less_than_the_points_tell_is_no_motion, make_capture),
        cmocka_unit_test_setup(three_frames_say_nothing, make_capture),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
