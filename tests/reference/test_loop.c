/* Loop: rounds and growth, decided without a run. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "reference/loop.h"

static npg_brief next(npg_reference_loop *loop, int64_t unreached, bool has_changed)
{
    const npg_pass_result result = {.unreached_count = unreached,
                                    .has_changed = has_changed,
                                    .explained_from = 2,
                                    .explained_to = has_changed ? 6 : 20};
    return npg_reference_next(loop, &result);
}

static npg_reference_loop begun(int64_t rounds, size_t attempts)
{
    npg_reference_loop loop;
    npg_reference_begin(&loop, rounds, attempts);
    return loop;
}

/* The same of a reference that is one side of the body. */
static npg_brief next_side(npg_reference_loop *loop, int64_t unreached)
{
    const npg_pass_result result = {.unreached_count = unreached, .has_changed = true, .is_side = true};
    return npg_reference_next(loop, &result);
}

static void every_round_is_walked_once(void **state)
{
    (void)state;
    npg_reference_loop loop;
    for (int64_t rounds = 0; rounds < 4; rounds++) {
        int64_t walked = 0;
        npg_brief brief = npg_reference_begin(&loop, rounds, 2);
        for (; brief.rounds_left; walked++) {
            assert_false(brief.leaves_open || brief.was_open);
            brief = next(&loop, 0, false);
            assert_true(brief.takes_gathered);
        }
        assert_int_equal(walked, rounds);
    }
}

static void what_a_reference_explains_is_gathered_alone(void **state)
{
    (void)state;
    npg_reference_loop loop;
    npg_brief brief = npg_reference_begin(&loop, 1, 2);
    assert_true(brief.gathers_from < 0 && brief.gathers_to > 1000);
    brief = next(&loop, 0, true);
    assert_false(brief.takes_gathered);
    assert_int_equal(brief.rounds_left, 1); /* once more, of these frames */
    assert_int_equal(brief.gathers_from, 2);
    assert_int_equal(brief.gathers_to, 6);
    brief = next(&loop, 0, true);
    assert_true(brief.takes_gathered);
    assert_int_equal(brief.rounds_left, 0);
}

static void too_few_explained_frames_are_no_reference(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(1, 2);
    const npg_pass_result result = {.has_changed = true, .explained_from = 5, .explained_to = 6};
    npg_brief brief = npg_reference_next(&loop, &result);
    assert_false(brief.takes_gathered);
    assert_int_equal(brief.rounds_left, 0);
}

static void a_side_grows_until_all_is_reached_and_is_gathered_once_more(void **state)
{
    (void)state;
    npg_reference_loop loop;
    npg_brief brief = npg_reference_begin(&loop, 1, 2);
    int64_t passes = 0;
    for (int64_t unreached = 60; unreached > 0; unreached -= 20, passes++) {
        brief = next_side(&loop, unreached);
        assert_true(brief.leaves_open && brief.takes_gathered);
        assert_int_equal(brief.rounds_left, 1);
        assert_int_equal(loop.now.grown, passes + 1);
    }
    brief = next_side(&loop, 0); /* whole now, and its newest part has nothing around it */
    assert_false(brief.leaves_open);
    assert_int_equal(brief.rounds_left, 1);
    brief = next_side(&loop, 0);
    assert_int_equal(brief.rounds_left, 0);
    assert_int_equal(loop.now.grown, passes);
    assert_true(brief.takes_gathered);
}

static void a_side_that_reaches_all_is_gathered_whatever_it_lacks(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(1, 2);
    npg_brief brief = next_side(&loop, 0);
    assert_true(brief.takes_gathered);
    assert_int_equal(brief.rounds_left, 1); /* what was past its border was not followed */
    brief = next_side(&loop, 0);
    assert_true(brief.takes_gathered);
    assert_int_equal(brief.rounds_left, 0);
}

static void a_side_before_cameras_is_looked_at_once_more_and_trimmed(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(1, 2);
    const npg_pass_result side = {.is_side = true, .has_images = true};
    npg_brief brief = npg_reference_next(&loop, &side);
    assert_int_equal(brief.rounds_left, 1); /* what was past its border was not followed */
    assert_false(brief.trims_only);
    brief = npg_reference_next(&loop, &side);
    assert_int_equal(brief.rounds_left, 1); /* nor what was gathered last */
    assert_false(brief.trims_only);
    brief = npg_reference_next(&loop, &side);
    assert_int_equal(brief.rounds_left, 0);
    assert_true(brief.trims_only);
}

/* A pass with a side of the keyframe `key` in which so many of 100 frames failed; 3 is the keyframe to try next. */
static npg_brief fails(npg_reference_loop *loop, int64_t key, int64_t bad, bool has_images)
{
    const npg_pass_result side = {.key = key,
                                  .frame_count = 100,
                                  .bad_count = bad,
                                  .next = 3,
                                  .is_side = true,
                                  .has_images = has_images};
    return npg_reference_next(loop, &side);
}

static void a_side_grows_for_as_long_as_fewer_frames_fail(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(1, 0);
    for (int64_t bad = 60; bad > 3; bad -= 10) {
        assert_int_equal(fails(&loop, 5, bad, false).rounds_left, 1);
        assert_true(loop.now.brief.is_best && loop.now.brief.takes_gathered);
    }
    assert_int_equal(fails(&loop, 5, 9, false).rounds_left, 0); /* one less is chance */
    npg_reference_begin(&loop, 1, 0);
    fails(&loop, 5, 60, false);
    assert_int_equal(fails(&loop, 5, 2, false).rounds_left, 0); /* and a few that fail are no reason */
}

static void a_side_that_has_grown_for_the_worse_is_taken_back(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(1, 0);
    assert_true(fails(&loop, 5, 60, true).is_best);
    assert_true(fails(&loop, 5, 10, true).is_best);
    npg_brief brief = fails(&loop, 5, 12, true); /* two more are chance */
    assert_true(brief.is_best && brief.is_last_look && !brief.takes_back);
    brief = fails(&loop, 5, 30, true);
    assert_true(brief.takes_back && brief.takes_poses && !brief.trims_only);
    assert_int_equal(brief.rounds_left, 1); /* that frames contradict it */
    brief = fails(&loop, 5, 12, true);
    assert_true(brief.trims_only && brief.takes_gathered && !brief.takes_back);
    assert_int_equal(brief.rounds_left, 0);
}

static void a_side_that_fails_is_grown_from_another_keyframe(void **state)
{
    (void)state;
    npg_reference_loop loop;
    for (int64_t bad = 40; bad < 100; bad += 20) { /* of the other: fewer, or more */
        bool is_better = bad < 50;
        npg_reference_begin(&loop, 1, 1);
        assert_false(fails(&loop, 5, 50, false).is_attempt); /* it may grow to more */
        npg_brief brief = fails(&loop, 5, 50, false);
        assert_true(brief.is_attempt && !brief.takes_gathered && !brief.takes_poses);
        assert_true(brief.is_best); /* the one that was followed last */
        assert_int_equal(brief.key, 3);
        assert_int_equal(brief.rounds_left, 1);
        assert_false(fails(&loop, 3, bad, false).is_attempt);
        brief = fails(&loop, 3, bad, false);
        assert_int_equal(brief.key, is_better ? 3 : 5);
        assert_int_equal(brief.rounds_left, !is_better);
        if (is_better) continue;
        assert_true(brief.takes_back && brief.is_attempt && !brief.takes_gathered && !brief.takes_poses);
        brief = fails(&loop, 5, 50, false); /* its last pass once more, and then it is enough */
        assert_true(brief.takes_gathered && brief.takes_poses && !brief.takes_back);
        assert_int_equal(brief.key, 5);
        assert_int_equal(brief.rounds_left, 0);
    }
    npg_reference_begin(&loop, 1, 1);
    fails(&loop, 5, 3, false);
    assert_true(fails(&loop, 5, 3, false).is_attempt);
    npg_reference_begin(&loop, 1, 1);
    fails(&loop, 5, 2, false);
    assert_false(fails(&loop, 5, 2, false).is_attempt); /* a few */
}

static void one_frame_of_a_short_capture_is_a_few(void **state)
{
    (void)state;
    for (int64_t bad = 1; bad <= 2; bad++) {
        npg_reference_loop loop;
        const npg_pass_result side = {
            .key = 5, .frame_count = 24, .bad_count = bad, .next = 3, .is_side = true, .has_images = true};
        npg_reference_begin(&loop, 1, 1);
        npg_reference_next(&loop, &side);
        assert_int_equal(npg_reference_next(&loop, &side).is_attempt, bad > 1);
    }
}

static void growth_that_stands_still_makes_room_for_another_keyframe(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(1, 1);
    assert_false(fails(&loop, 5, 60, true).is_attempt);
    assert_false(fails(&loop, 5, 40, true).is_attempt); /* it gains */
    npg_brief brief = fails(&loop, 5, 40, true);
    assert_true(brief.is_attempt && !brief.takes_poses); /* not looked at once more before */
    assert_int_equal(brief.key, 3);
    assert_false(fails(&loop, 3, 80, true).is_attempt);
    brief = fails(&loop, 3, 80, true); /* nor does the other one gain, and it has more of them */
    assert_int_equal(brief.key, 5);
    assert_true(brief.takes_back && !brief.is_best); /* none of the other's is kept */
    brief = fails(&loop, 5, 40, true);
    assert_true(brief.rounds_left && brief.is_last_look && !brief.is_attempt); /* now it goes on to its end */
    assert_int_equal(brief.key, 5);
    npg_reference_begin(&loop, 1, 1);
    fails(&loop, 5, 0, true);
    assert_false(fails(&loop, 5, 9, true).is_attempt); /* it is taken back to where none failed */
}

static void a_keyframe_is_as_good_as_the_best_that_it_came_to(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(1, 1);
    fails(&loop, 5, 60, true);
    fails(&loop, 5, 30, true);
    assert_true(fails(&loop, 5, 50, true).is_attempt && !loop.now.brief.is_best);
    fails(&loop, 3, 70, true);
    npg_brief brief = fails(&loop, 3, 40, true);
    assert_false(brief.is_attempt ||
                 brief.is_best); /* fewer than with the last of the one before, and it gains */
    brief = fails(&loop, 3, 41, true);
    assert_true(brief.takes_back);
    assert_int_equal(brief.key, 5);
    brief = fails(&loop, 5, 30, true); /* from its best on as before */
    assert_true(brief.is_best && !brief.takes_back && brief.takes_gathered);
    fails(&loop, 5, 50, true);
    brief = fails(&loop, 5, 50, true);
    assert_true(brief.takes_back && brief.takes_poses); /* to where 30 failed */
    brief = fails(&loop, 5, 30, true);
    assert_true(brief.trims_only && brief.takes_gathered);
    assert_int_equal(brief.rounds_left, 0);
}

static void a_keyframe_that_is_behind_is_given_up(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(1, 1);
    for (int64_t bad = 70; bad > 20; bad -= 20) fails(&loop, 5, bad, true);
    assert_true(fails(&loop, 5, 30, true).is_attempt);
    assert_false(fails(&loop, 3, 90, true).takes_back); /* which may come in a pass ... */
    assert_false(fails(&loop, 3, 70, true).takes_back); /* ... where the first was a pass earlier */
    npg_brief brief = fails(&loop, 3, 60, true);        /* it gains, and had to come to 50 */
    assert_true(brief.takes_back);
    assert_int_equal(brief.key, 5);
}

static void a_keyframe_without_a_side_is_given_up(void **state)
{
    (void)state;
    npg_reference_loop loop;
    const npg_pass_result none = {
        .key = 3, .frame_count = 100, .bad_count = 100, .next = 4, .has_no_surface = true, .is_side = true};
    npg_reference_begin(&loop, 1, 1);
    fails(&loop, 5, 50, false);
    assert_int_equal(fails(&loop, 5, 50, false).key, 3);
    npg_brief brief = npg_reference_next(&loop, &none);
    assert_int_equal(brief.key, 5);
    assert_int_equal(brief.rounds_left, 1);
}

static void a_whole_body_is_not_trimmed(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(1, 2);
    const npg_pass_result whole = {.has_images = true};
    npg_brief brief = npg_reference_next(&loop, &whole);
    assert_int_equal(brief.rounds_left, 0);
    assert_false(brief.trims_only);
}

static void growth_in_vain_asks_for_less_and_then_ends(void **state)
{
    (void)state;
    for (int64_t to_and_fro = 0; to_and_fro <= 10; to_and_fro += 10) {
        npg_reference_loop loop;
        npg_brief brief = npg_reference_begin(&loop, 1, 2);
        double first = brief.explained_least, least = first;
        int passes = 0;
        for (; brief.rounds_left; passes++) {
            brief = next(&loop, passes % 2 ? 30 : 30 + to_and_fro, false);
            assert_true(brief.explained_least <= least);
            least = brief.explained_least;
            assert_true(passes < 10);
        }
        assert_true(least < first && least > 0);
        assert_true(passes > 3); /* it does not give up at once */
    }
}

static void growth_never_goes_on_for_ever(void **state)
{
    (void)state;
    npg_reference_loop loop;
    npg_brief brief = npg_reference_begin(&loop, 1, 2);
    int64_t passes = 0;
    for (int64_t unreached = 1000; brief.rounds_left; unreached--, passes++)
        brief = next(&loop, unreached, false); /* one frame more each time */
    assert_in_range(passes, 10, 100);
}

/* A pass with the keyframe `key` in which so many frames failed, and the one to try next. */
static npg_brief next_of(npg_reference_loop *loop, int64_t key, int64_t bad, int64_t next_key)
{
    const npg_pass_result result = {.key = key, .bad_count = bad, .explained_to = 20, .next = next_key};
    return npg_reference_next(loop, &result);
}

static void a_frame_that_fails_is_the_next_keyframe(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(1, 2);
    npg_brief brief = next_of(&loop, 5, 9, 3);
    assert_true(brief.is_attempt && brief.rounds_left == 1);
    assert_int_equal(brief.key, 3);
    assert_false(brief.takes_gathered || brief.takes_poses);
    brief = next_of(&loop, 3, 0, -1); /* all is well */
    assert_int_equal(brief.key, 3);
    assert_false(brief.is_attempt);
    assert_true(brief.takes_gathered && brief.takes_poses && loop.now.brief.keeps_gathered);
    assert_int_equal(brief.rounds_left, 0);
}

static npg_brief try_of(npg_reference_loop *loop, int64_t key, bool is_beatable)
{
    const npg_pass_result result = {.key = key, .explained_to = 20, .is_beatable = is_beatable};
    return npg_reference_next(loop, &result);
}

static void a_keyframe_that_none_can_beat_is_compared_with_none(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(1, 2);
    npg_brief brief = try_of(&loop, 5, false);
    assert_false(brief.compares);
    assert_true(brief.takes_gathered && brief.takes_poses);
    assert_int_equal(brief.rounds_left, 0);
}

static void the_pass_of_a_keyframe_that_stays_counts(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(1, 2);
    npg_brief brief = try_of(&loop, 5, true);
    assert_true(brief.compares);
    brief = npg_reference_compared(&loop, 5);
    assert_false(brief.compares);
    assert_true(brief.takes_gathered && brief.takes_poses);
    assert_int_equal(brief.rounds_left, 0);
}

static void a_keyframe_that_is_beaten_is_followed_no_further(void **state)
{
    (void)state;
    for (int with_pass = 0; with_pass < 2; with_pass++) {
        npg_reference_loop loop = begun(1, 2);
        npg_brief brief = with_pass ? try_of(&loop, 5, true) : npg_reference_doubt(&loop);
        assert_true(brief.compares);
        brief = npg_reference_compared(&loop, 8);
        assert_false(brief.compares || brief.takes_gathered || brief.takes_poses);
        assert_int_equal(brief.rounds_left, 1);
        brief = try_of(&loop, 8, true); /* candidates are compared once */
        assert_false(brief.compares);
        assert_true(brief.takes_gathered && brief.takes_poses);
        assert_int_equal(brief.rounds_left, 0);
    }
}

static void a_keyframe_that_does_no_better_is_taken_back(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(2, 2);
    next_of(&loop, 5, 4, 3);
    npg_brief brief = next_of(&loop, 3, 9, 7);
    assert_int_equal(brief.key, 7);
    assert_false(loop.now.brief.keeps_gathered);
    brief = next_of(&loop, 7, 4, 9); /* there are two attempts, and no better is not enough */
    assert_int_equal(brief.key, 5);
    assert_false(brief.is_attempt || brief.takes_poses || loop.now.brief.keeps_gathered);
    assert_true(brief.takes_gathered);
    assert_int_equal(brief.rounds_left, 1); /* as without any attempt */
    brief = next_of(&loop, 5, 4, 3);        /* and it is not in question again */
    assert_int_equal(brief.key, 5);
    assert_true(brief.takes_gathered && brief.takes_poses);
    assert_int_equal(brief.rounds_left, 0);
}

static void no_other_keyframe_is_tried_without_need(void **state)
{
    (void)state;
    npg_reference_loop loop = begun(1, 2);
    assert_false(next_of(&loop, 5, 0, -1).is_attempt);
    npg_reference_begin(&loop, 1, 2); /* nor of a side, which fails by what it lacks */
    const npg_pass_result side = {.key = 5, .bad_count = 9, .is_side = true, .next = 3};
    assert_false(npg_reference_next(&loop, &side).is_attempt);
    npg_reference_begin(&loop, 1, 2); /* nor where none can be ... */
    assert_false(next_of(&loop, 5, 9, -1).is_attempt);
    npg_reference_begin(&loop, 1, 0); /* ... or shall be */
    assert_false(next_of(&loop, 5, 9, 3).is_attempt);
    npg_reference_begin(&loop, 1, 2); /* nor one twice */
    assert_true(next_of(&loop, 5, 9, 3).is_attempt);
    assert_false(next_of(&loop, 3, 9, 5).is_attempt);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_round_is_walked_once),
        cmocka_unit_test(what_a_reference_explains_is_gathered_alone),
        cmocka_unit_test(too_few_explained_frames_are_no_reference),
        cmocka_unit_test(a_side_grows_until_all_is_reached_and_is_gathered_once_more),
        cmocka_unit_test(a_side_that_reaches_all_is_gathered_whatever_it_lacks),
        cmocka_unit_test(a_side_before_cameras_is_looked_at_once_more_and_trimmed),
        cmocka_unit_test(a_side_grows_for_as_long_as_fewer_frames_fail),
        cmocka_unit_test(a_side_that_has_grown_for_the_worse_is_taken_back),
        cmocka_unit_test(a_side_that_fails_is_grown_from_another_keyframe),
        cmocka_unit_test(one_frame_of_a_short_capture_is_a_few),
        cmocka_unit_test(growth_that_stands_still_makes_room_for_another_keyframe),
        cmocka_unit_test(a_keyframe_is_as_good_as_the_best_that_it_came_to),
        cmocka_unit_test(a_keyframe_that_is_behind_is_given_up),
        cmocka_unit_test(a_keyframe_without_a_side_is_given_up),
        cmocka_unit_test(a_whole_body_is_not_trimmed),
        cmocka_unit_test(growth_in_vain_asks_for_less_and_then_ends),
        cmocka_unit_test(growth_never_goes_on_for_ever),
        cmocka_unit_test(a_frame_that_fails_is_the_next_keyframe),
        cmocka_unit_test(a_keyframe_that_none_can_beat_is_compared_with_none),
        cmocka_unit_test(the_pass_of_a_keyframe_that_stays_counts),
        cmocka_unit_test(a_keyframe_that_is_beaten_is_followed_no_further),
        cmocka_unit_test(a_keyframe_that_does_no_better_is_taken_back),
        cmocka_unit_test(no_other_keyframe_is_tried_without_need),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
