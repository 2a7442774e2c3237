/* Cleaning: what goes, what stays, and what is no surface at all. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "outlier/outlier_internal.h"
#include "tests/support/shapes.h"
#include "tests/support/test_chain.h"

extern const npg_stage npg_stage_outlier;

static float truth[3 * 400000];

static void open_frame(npg_frame *frame, size_t n, uint64_t seed)
{
    shape_random r = {seed};
    memset(frame, 0, sizeof *frame);
    frame->point_count = frame->cleaning.read = n;
    assert_int_equal(npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, n, 3 * sizeof(float)), NPG_OK);
    shape_torus(frame->pos_local, truth, n, 1, 0.3, &r);
}

static void what_is_not_a_number_goes(void **state)
{
    (void)state;
    npg_frame frame;
    open_frame(&frame, 1000, 1);
    frame.pos_local[3 * 10] = NAN;
    frame.pos_local[3 * 20 + 1] = INFINITY;
    frame.pos_local[3 * 30 + 2] = -INFINITY;
    frame.pos_local[3 * 999] = 3e30f;
    float tenth = frame.pos_local[3 * 11];
    assert_int_equal(npg_clean_finite(&frame), NPG_OK);
    assert_int_equal(frame.point_count, 996);
    assert_int_equal(frame.cleaning.not_finite, 4);
    assert_true(frame.pos_local[3 * 10] == tenth);
    npg_frame_clear(&frame);
}

static void duplicates_go(void **state)
{
    (void)state;
    npg_frame frame;
    open_frame(&frame, 1000, 2);
    for (size_t i = 0; i < 100; i++)
        memcpy(frame.pos_local + 3 * (900 + i), frame.pos_local + 3 * (3 * i), 3 * sizeof(float));
    shape_put(frame.pos_local, 0.0, 1, 1);
    shape_put(frame.pos_local + 3 * 500, -0.0, 1, 1);
    assert_int_equal(npg_clean_duplicates(&frame), NPG_OK);
    assert_int_equal(frame.cleaning.duplicate, 100); /* 99 copies of what is still there, and minus zero */
    assert_int_equal(frame.point_count, 900);
    npg_frame_clear(&frame);
}

static void too_many_points_are_thinned(void **state)
{
    (void)state;
    npg_frame frame;
    open_frame(&frame, 50001, 4);
    for (size_t i = 0; i < frame.point_count; i++) shape_put(frame.pos_local + 3 * i, (double)i, 0, 0);
    for (int again = 0; again < 2; again++) {
        assert_int_equal(npg_clean_cap(&frame, 20000), NPG_OK);
        assert_int_equal(frame.point_count, 20000);
        assert_int_equal(frame.cleaning.thinned, 30001);
    }
    for (size_t i = 0; i + 1 < frame.point_count;
         i++) { /* evenly: no two that were beside each other, no gap */
        double step = (double)(frame.pos_local[3 * (i + 1)] - frame.pos_local[3 * i]);
        assert_true(step == 2 || step == 3);
    }
    npg_frame_clear(&frame);
    assert_int_equal(npg_clean_point_max(0, 20000), npg_clean_point_max(0, 100));
    assert_int_equal(npg_clean_point_max(0, 100000), 200000);
    assert_int_equal(npg_clean_point_max(1000, 100000), 1000);
}

static npg_status drop_isolated(npg_frame *frame)
{
    return npg_isolated_drop(&frame, 1, 12, 5);
}

static void of_a_clean_cloud_hardly_any_go(void **state)
{
    (void)state;
    npg_frame frame;
    open_frame(&frame, 10000, 5);
    assert_int_equal(drop_isolated(&frame), NPG_OK);
    assert_true(frame.cleaning.isolated <= 50); /* of a clean cloud, 0.5 % at most */
    npg_frame_clear(&frame);
}

/* 10 000 points, that many of them anywhere: those far from the torus go, its own stay. */
static void drop_scattered(size_t scattered)
{
    npg_frame frame;
    shape_random r = {6};
    size_t near = 0, far = 0;
    open_frame(&frame, 10000, 7);
    for (size_t i = 0; i < scattered; i++) {
        float *p = frame.pos_local + 3 * i;
        for (int a = 0; a < 3; a++) p[a] = (float)(4 * shape_uniform(&r) - 2);
    }
    shape_put(frame.pos_local, 900, 900, 900); /* so far that it hides the others from one round */
    assert_int_equal(drop_isolated(&frame), NPG_OK);
    for (size_t i = 0; i < frame.point_count; i++) {
        const float *p = frame.pos_local + 3 * i;
        double off = fabs(hypot(hypot((double)p[0], (double)p[1]) - 1, (double)p[2]) - 0.3);
        near += off < 0.001;
        far += off > 0.3;
    }
    assert_int_equal(far, 0);
    assert_true((double)near > (double)(10000 - scattered) * 0.99);
    npg_frame_clear(&frame);
}

/* In an image they have neighbours: they are followed, though no surface is made of them. */
static void those_of_depth_images_are_marked(void **state)
{
    (void)state;
    npg_frame frame;
    size_t marked = 0;
    uint8_t keep[1000];
    open_frame(&frame, 1000, 8);
    shape_put(frame.pos_local + 3 * 7, 900, 900, 900);
    frame.sensor_count = 1;
    assert_int_equal(npg_alloc(&frame.views, NPG_FOR_FRAMES, sizeof *frame.views), NPG_OK);
    assert_int_equal(drop_isolated(&frame), NPG_OK);
    assert_int_equal(frame.point_count, 1000);
    assert_int_equal(frame.cleaning.isolated, 0);
    for (size_t i = 0; i < 1000; i++) marked += frame.isolated[i];
    assert_true(frame.isolated[7] && marked <= 10);
    memset(keep, 1, sizeof keep);
    keep[3] = 0;
    npg_frame_keep(&frame, keep); /* marks go with their points */
    assert_true(frame.isolated[6] && frame.pos_local[3 * 6] > 800);
    npg_frame_clear(&frame);
}

/* So many that they make each other look usual, too. */
static void scattered_points_go_few_or_many(void **state)
{
    (void)state;
    for (size_t scattered = 300; scattered <= 3000; scattered *= 10) drop_scattered(scattered);
}

/* Of half of the body a sixth: its points lie apart, too, but on a surface. */
static void a_side_of_few_points_stays(void **state)
{
    (void)state;
    npg_frame frame;
    size_t count = 0;
    open_frame(&frame, 10000, 8);
    for (size_t i = 0; i < frame.point_count; i++)
        if (frame.pos_local[3 * i] < 0 || i % 6 == 0)
            memmove(frame.pos_local + 3 * count++, frame.pos_local + 3 * i, 3 * sizeof(float));
    frame.point_count = count;
    assert_int_equal(drop_isolated(&frame), NPG_OK);
    assert_in_range(frame.cleaning.isolated, 0, count / 200);
    npg_frame_clear(&frame);
}

static void open_dusty_frame(npg_frame *frame, uint64_t seed)
{
    shape_random r = {seed};
    open_frame(frame, 3000, seed);
    frame->index = (int64_t)seed;
    for (size_t i = 0; i < 30; i++)
        shape_put(frame->pos_local + 3 * (100 * i), 5 * shape_uniform(&r), 5 * shape_uniform(&r), 5);
}

static void frames_are_searched_together(void **state)
{
    enum { FRAMES = 5 };
    (void)state;
    npg_frame frames[FRAMES], *pointers[FRAMES], alone;
    for (size_t i = 0; i < FRAMES; i++) {
        open_dusty_frame(&frames[i], i);
        pointers[i] = &frames[i];
    }
    pointers[1]->is_skipped = true;
    assert_int_equal(npg_isolated_drop(pointers, FRAMES, 12, 5), NPG_OK);
    assert_int_equal(pointers[1]->point_count, 3000);
    for (size_t i = 0; i < FRAMES; i++) {
        if (i != 1) {
            open_dusty_frame(&alone, i);
            assert_int_equal(drop_isolated(&alone), NPG_OK);
            assert_in_range(alone.cleaning.isolated, 25, 60);
            assert_int_equal(alone.point_count + alone.cleaning.isolated, 3000);
            assert_int_equal(frames[i].point_count, alone.point_count);
            assert_memory_equal(frames[i].pos_local, alone.pos_local,
                                alone.point_count * 3 * sizeof *alone.pos_local);
            npg_frame_clear(&alone);
        }
        npg_frame_clear(&frames[i]);
    }
}

static void expect_refusal(npg_frame *frame, const char *words)
{
    assert_int_equal(npg_clean_check(frame), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), words));
}

static void what_is_no_surface_is_refused(void **state)
{
    (void)state;
    npg_frame frame;
    shape_random r = {8};
    open_frame(&frame, 500, 8);
    assert_int_equal(npg_clean_check(&frame), NPG_OK);
    for (size_t count = 0; count <= 3; count++) {
        frame.point_count = count;
        expect_refusal(&frame, "usable points of 500");
    }
    frame.point_count = 500;
    for (size_t i = 0; i < 500; i++) { /* an oblique plane, rounded to float */
        double x = shape_uniform(&r), y = shape_uniform(&r);
        shape_put(frame.pos_local + 3 * i, x, y, 0.3 * x - 0.7 * y + 5);
    }
    expect_refusal(&frame, "one plane");
    for (size_t i = 0; i < 500; i++) shape_put(frame.pos_local + 3 * i, 0.1 * (double)i, 0.2 * (double)i, 3);
    expect_refusal(&frame, "one line");
    for (size_t i = 0; i < 500; i++) shape_put(frame.pos_local + 3 * i, 1, 2, 3);
    expect_refusal(&frame, "one place");
    npg_frame_clear(&frame);
}

static void refused_memory_is_survived(void **state)
{
    (void)state;
    size_t before = npg_memory_used(), refused = 0;
    for (uint64_t n = 1;; n++) {
        npg_frame frame;
        open_frame(&frame, 3000, 9);
        npg_memory_fail_at(n, true);
        npg_status status = npg_clean_finite(&frame);
        if (!status) status = npg_clean_duplicates(&frame);
        if (!status) status = npg_clean_cap(&frame, 1000);
        if (!status) status = drop_isolated(&frame);
        npg_memory_fail_at(0, false);
        npg_frame_clear(&frame);
        assert_int_equal(npg_memory_used(), before);
        if (!status) break;
        assert_int_equal(status, NPG_MEMORY);
        refused++;
    }
    assert_true(refused >= 6);
}

/* ---- the stage ---- */

typedef struct seen {
    int frames, skipped;
    size_t points[3], normals[3];
} seen;

/* Frame 1 has three points only; the others are toruses with a stray point and one that is no number. */
static npg_status make_frame(npg_frame *frame, npg_facts *facts, int64_t index, void *user)
{
    (void)facts;
    (void)user;
    shape_random r = {40 + (uint64_t)index};
    size_t n = index == 1 ? 3 : 2000;
    NPG_TRY(npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, n, 3 * sizeof(float)));
    shape_torus(frame->pos_local, truth, n, 1, 0.3, &r);
    frame->point_count = n;
    frame->is_key = index == 2;
    if (index == 1) return NPG_OK;
    shape_put(frame->pos_local, 5, 5, 5);
    shape_put(frame->pos_local + 3, NAN, 0, 0);
    return NPG_OK;
}

static npg_status see_frame(npg_worker *worker, npg_frame *frame, void *user)
{
    seen *s = user;
    (void)worker;
    s->frames++;
    s->skipped += frame->is_skipped;
    s->points[frame->index] = frame->point_count;
    s->normals[frame->index] = frame->normals ? frame->cleaning.normals_estimated : 0;
    return NPG_OK;
}

static void the_stage_skips_or_refuses(void **state)
{
    (void)state;
    char text[1024];
    seen s = {0};
    const npg_stage *const chain[] = {&test_source, &npg_stage_outlier, &test_sink, NULL};
    const char *const strict[][2] = {{"input", "none"}, {"output", "none"}, {NULL, NULL}};
    const char *const going[][2] = {
        {"input", "none"}, {"output", "none"}, {"keep-going", "yes"}, {NULL, NULL}};
    script = (test_script){3, make_frame, see_frame, &s};
    assert_int_equal(run_chain(chain, strict, text), NPG_BAD_INPUT);
    assert_non_null(strstr(text, "frame 1"));
    assert_non_null(strstr(text, "3 usable points of 3"));
    memset(&s, 0, sizeof s);
    assert_int_equal(run_chain(chain, going, text), NPG_PARTIAL);
    assert_int_equal(s.frames, 3);
    assert_int_equal(s.skipped, 1);
    assert_int_equal(s.points[1], 0);
    assert_true(s.points[0] <= 1998 && s.points[0] >= 1988);
    assert_int_equal(s.normals[2], s.points[2]); /* the keyframe has normals, */
    assert_int_equal(s.normals[0], 0);           /* the others need none */
}

static void a_sensor_that_is_none_is_refused(void **state)
{
    (void)state;
    char text[1024];
    const npg_stage *const chain[] = {&test_source, &npg_stage_outlier, &test_sink, NULL};
    const char *const texts[] = {"1,2", "1,2,x", "1,2,3,4", "", "nan,0,0"};
    script = (test_script){3, make_frame, NULL, NULL};
    for (size_t i = 0; i < 5; i++) {
        const char *const settings[][2] = {
            {"input", "none"}, {"output", "none"}, {"sensor", texts[i]}, {NULL, NULL}};
        assert_int_equal(run_chain(chain, settings, text), NPG_USAGE);
        assert_non_null(strstr(text, "option sensor"));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(what_is_not_a_number_goes),
                                       cmocka_unit_test(duplicates_go),
                                       cmocka_unit_test(too_many_points_are_thinned),
                                       cmocka_unit_test(of_a_clean_cloud_hardly_any_go),
                                       cmocka_unit_test(scattered_points_go_few_or_many),
                                       cmocka_unit_test(a_side_of_few_points_stays),
                                       cmocka_unit_test(frames_are_searched_together),
                                       cmocka_unit_test(what_is_no_surface_is_refused),
                                       cmocka_unit_test(refused_memory_is_survived),
                                       cmocka_unit_test(the_stage_skips_or_refuses),
                                       cmocka_unit_test(a_sensor_that_is_none_is_refused),
                                       cmocka_unit_test(those_of_depth_images_are_marked)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
