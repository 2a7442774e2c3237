/* Keyframe: box, score against a plain count, choice by number, skipped frames, order, live runs. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "tests/support/test_chain.h"

extern const npg_stage npg_stage_ingest, npg_stage_keyframe;
static const npg_stage *const chain[] = {&test_source, &npg_stage_keyframe, &test_sink, NULL};
static const npg_stage *const live_chain[] = {&npg_stage_ingest, &npg_stage_keyframe, &test_sink, NULL};

enum { FRAMES = 11 };

/* What the frames are like, and what the sink saw. */
typedef struct scene {
    size_t point_counts[FRAMES];
    bool skipped[FRAMES];
    int64_t first_number;
    bool with_bad_points;
    float stride; /* along x, from frame to frame */
    /* seen */
    int64_t order[FRAMES], seen_count, key, key_count;
    npg_plan plan;
    npg_frame_box box;
    size_t best_cells;
    double best_score;
} scene;

/* A stream of numbers in [0, 1) that depends on the seed alone. */
static double next_number(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(*seed >> 11) / 9007199254740992.0;
}

static npg_status fill_points(npg_frame *frame, size_t count, bool with_bad_points)
{
    uint64_t seed = (uint64_t)frame->index + 1;
    NPG_TRY(npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, count, 12));
    frame->point_count = count;
    for (size_t i = 0; i < 3 * count; i++) /* many fall into one cell: the cloud is a small cube */
        frame->pos_local[i] = (float)(0.1 * next_number(&seed));
    if (count > 1) {
        for (int a = 0; a < 3; a++) frame->pos_local[a] = -3.0f;
        for (int a = 0; a < 3; a++) frame->pos_local[3 + a] = 2.0f;
    }
    if (!with_bad_points || count < 8) return NPG_OK;
    frame->pos_local[6] = NAN;
    frame->pos_local[10] = INFINITY;
    frame->pos_local[14] = -INFINITY;
    return NPG_OK;
}

static npg_status make(npg_frame *frame, npg_facts *facts, int64_t index, void *user)
{
    const scene *s = user;
    if (!facts->origin.known) facts->origin.known = true;
    frame->number = s->first_number + index;
    frame->is_skipped = s->skipped[index];
    if (frame->is_skipped) return NPG_OK;
    NPG_TRY(fill_points(frame, s->point_counts[index], s->with_bad_points));
    for (size_t i = 0; i < frame->point_count; i++) frame->pos_local[3 * i] += s->stride * (float)index;
    return NPG_OK;
}

static npg_status see(npg_worker *worker, npg_frame *frame, void *user)
{
    scene *s = user;
    const npg_facts *facts = npg_worker_facts(worker);
    const json_t *stages = json_object_get(npg_worker_run_report(worker), "stages");
    const json_t *best = json_array_get(json_object_get(json_object_get(stages, "keyframe"), "best"), 0);
    if (s->seen_count < FRAMES) s->order[s->seen_count++] = frame->index;
    if (frame->is_key) {
        s->key = frame->index;
        s->key_count++;
    }
    s->plan = facts->plan;
    s->box = facts->box;
    s->best_cells = (size_t)json_integer_value(json_object_get(best, "cells"));
    s->best_score = json_real_value(json_object_get(best, "score"));
    return NPG_OK;
}

static scene scene_of(size_t point_count)
{
    scene s = {.first_number = 0, .key = -1};
    for (int i = 0; i < FRAMES; i++) s.point_counts[i] = point_count;
    return s;
}

static npg_status run_scene(scene *s, const char *const (*more)[2], char text[1024])
{
    const char *settings[16][2] = {{"input", "any"}, {"output", "any"}, {"chunk", "3"}};
    for (int i = 0; more && more[i][0]; i++) memcpy(settings[3 + i], more[i], sizeof *more);
    script = (test_script){FRAMES, make, see, s};
    return run_chain(chain, (const char *const(*)[2])settings, text);
}

/* ---- from files ---- */

static void the_figures_size_is_that_of_a_frame_not_of_its_way(void **state)
{
    (void)state;
    for (int far = 0; far < 2; far++) {
        scene s = scene_of(20);
        s.stride = far ? 40 : 0;
        s.skipped[3] = true;
        assert_int_equal(run_scene(&s, NULL, NULL), NPG_OK);
        assert_true(fabs(s.box.diagonal - 5 * sqrt(3)) < 1e-4);                      /* from -3 to 2 */
        assert_true(fabs(s.box.scale - 1.9 / (5 + 40 * (FRAMES - 1) * far)) < 1e-6); /* of all frames */
    }
}

static void equal_frames_give_the_middle(void **state)
{
    const char *const papers[][2] = {{"keyframe-choice", "paper"}, {NULL, NULL}};
    (void)state;
    scene s = scene_of(2);
    assert_int_equal(run_scene(&s, papers, NULL), NPG_OK);
    assert_int_equal(s.key, 5); /* of 0..10: 5 and 6 are as far from 5.5, the lower index wins */
    assert_int_equal(s.key_count, 1);
    assert_int_equal(s.order[0], 5);
    assert_int_equal(s.best_cells, 2);
    assert_true(fabs(s.best_score - 2 * exp(-0.001 * 0.25)) < 1e-12);
}

static void every_frame_comes_once_in_the_plans_order(void **state)
{
    (void)state;
    scene s = scene_of(20);
    const char *const settings[][2] = {{"window", "4"}, {"overlap", "1"}, {NULL, NULL}};
    assert_int_equal(run_scene(&s, settings, NULL), NPG_OK);
    assert_int_equal(s.plan.frame_count, FRAMES);
    assert_int_equal(s.plan.window, 4);
    assert_int_equal(s.plan.overlap, 1);
    assert_int_equal(s.seen_count, FRAMES);
    for (int i = 0; i < FRAMES; i++) assert_int_equal(s.order[i], npg_plan_frame(&s.plan, i));
    assert_int_equal(run_scene(&s, NULL, NULL), NPG_OK);
    assert_int_equal(s.plan.window, FRAMES); /* no window given: one over all */
}

static int by_value(const void *left, const void *right)
{
    int64_t a = *(const int64_t *)left, b = *(const int64_t *)right;
    return a < b ? -1 : a > b;
}

/* The score's count done the plain way: every point's cell as a number, sorted. */
static size_t count_cells(const npg_frame *frame, const npg_frame_box *box)
{
    int64_t *cells = calloc(frame->point_count, sizeof *cells);
    size_t count = 0, distinct = 0;
    for (size_t i = 0; i < frame->point_count; i++) {
        int64_t cell = 0;
        bool is_finite = true;
        for (size_t a = 0; a < 3; a++) {
            float unit = (float)(((double)frame->pos_local[3 * i + a] - box->centre[a]) * box->scale);
            is_finite = is_finite && isfinite(unit);
            cell = cell * 512 + (is_finite ? (int64_t)(((double)unit + 1) * 256) : 0);
        }
        if (is_finite) cells[count++] = cell;
    }
    qsort(cells, count, sizeof *cells, by_value);
    for (size_t i = 0; i < count; i++) distinct += i == 0 || cells[i] != cells[i - 1];
    free(cells);
    return distinct;
}

static void the_score_is_the_methods(void **state)
{
    const char *const papers[][2] = {{"keyframe-choice", "paper"}, {NULL, NULL}};
    (void)state;
    for (int variant = 0; variant < 2; variant++) {
        scene s = scene_of(3000);
        s.with_bad_points = variant == 1;
        s.point_counts[2] = 9000;
        s.point_counts[7] = 30;
        assert_int_equal(run_scene(&s, papers, NULL), NPG_OK);
        int64_t best = -1;
        double best_score = -1;
        size_t best_cells = 0;
        for (int64_t t = 0; t < FRAMES; t++) {
            npg_frame frame = {.index = t};
            assert_int_equal(fill_points(&frame, s.point_counts[t], s.with_bad_points), NPG_OK);
            size_t cells = count_cells(&frame, &s.box);
            double score = (double)cells * exp(-0.001 * ((double)t - 5.5) * ((double)t - 5.5));
            if (score > best_score) {
                best_score = score;
                best = t;
                best_cells = cells;
            }
            npg_frame_clear(&frame);
        }
        assert_true(best_cells < 9000); /* cells were shared, so distinct ones were counted */
        assert_int_equal(s.key, best);
        assert_int_equal(s.best_cells, best_cells);
        assert_true(fabs(s.best_score - best_score) < 1e-9 * best_score);
    }
}

static void bad_points_do_not_reach_the_box(void **state)
{
    (void)state;
    scene s = scene_of(50);
    s.with_bad_points = true;
    assert_int_equal(run_scene(&s, NULL, NULL), NPG_OK);
    for (int a = 0; a < 3; a++) assert_true(fabs(s.box.centre[a] + 0.5) < 1e-6);
    assert_true(fabs(s.box.scale - 0.95 / 2.5) < 1e-6);
}

static void a_number_names_the_keyframe(void **state)
{
    (void)state;
    char text[1024];
    scene s = scene_of(10);
    s.first_number = 200;
    const char *const named[][2] = {{"keyframe", "209"}, {NULL, NULL}};
    assert_int_equal(run_scene(&s, named, NULL), NPG_OK);
    assert_int_equal(s.key, 9);
    const char *const missing[][2] = {{"keyframe", "9"}, {NULL, NULL}};
    assert_int_equal(run_scene(&s, missing, text), NPG_USAGE);
    assert_non_null(strstr(text, "keyframe 9"));
    s.skipped[9] = true;
    assert_int_equal(run_scene(&s, named, text), NPG_BAD_INPUT);
    assert_non_null(strstr(text, "209"));
}

static void a_skipped_frame_is_never_the_key(void **state)
{
    (void)state;
    char text[1024];
    scene s = scene_of(10);
    for (int i = 1; i < FRAMES; i++) s.skipped[i] = true;
    assert_int_equal(run_scene(&s, NULL, NULL), NPG_OK);
    assert_int_equal(s.key, 0);
    assert_int_equal(s.seen_count, FRAMES);
    s.skipped[0] = true;
    assert_int_equal(run_scene(&s, NULL, text), NPG_BAD_INPUT);
    assert_non_null(strstr(text, "no frame"));
}

static void captures_without_extent_are_refused(void **state)
{
    (void)state;
    scene s = scene_of(0);
    assert_int_equal(run_scene(&s, NULL, NULL), NPG_BAD_INPUT);
    s.point_counts[3] = 1;
    assert_int_equal(run_scene(&s, NULL, NULL), NPG_BAD_INPUT);
}

static void an_overlap_must_fit(void **state)
{
    (void)state;
    char text[1024];
    scene s = scene_of(10);
    const char *const settings[][2] = {{"window", "4"}, {"overlap", "4"}, {NULL, NULL}};
    assert_int_equal(run_scene(&s, settings, text), NPG_USAGE);
    assert_non_null(strstr(text, "overlap"));
}

/* ---- live ---- */

static npg_status push_scene(npg_run *run, const scene *s, int64_t frame_count)
{
    npg_status status = NPG_OK;
    for (int64_t t = 0; t < frame_count && !status; t++) {
        npg_frame frame = {.index = t % FRAMES};
        size_t count = s->point_counts[t % FRAMES];
        status = fill_points(&frame, count, false);
        double *points = calloc(3 * count, sizeof *points);
        for (size_t i = 0; i < 3 * count && !status; i++) points[i] = (double)frame.pos_local[i];
        npg_cloud cloud = {sizeof cloud, s->first_number + t, count, points, NULL, NULL};
        if (!status) status = npg_run_push(run, &cloud);
        free(points);
        npg_frame_clear(&frame);
    }
    return status;
}

static npg_status run_live_windows(scene *s, int64_t frame_count, const char *look_ahead,
                                   const char *keyframe, const char *window)
{
    npg_options *options;
    npg_run *run = NULL;
    script = (test_script){FRAMES, make, see, s};
    npg_status status = npg_options_open_chain(&options, live_chain);
    if (!status) status = npg_options_set(options, "output", "any");
    if (!status) status = npg_options_set(options, "look-ahead", look_ahead);
    if (!status) status = npg_options_set(options, "keyframe", keyframe);
    if (!status) status = npg_options_set(options, "window", window);
    if (!status) status = npg_run_open_chain(&run, options, NULL, live_chain);
    if (!status) status = push_scene(run, s, frame_count);
    if (!status) status = npg_run_finish(run);
    if (!status) status = npg_run_wait(run);
    npg_run_close(&run);
    npg_options_close(&options);
    return status;
}

static npg_status run_live(scene *s, int64_t frame_count, const char *look_ahead, const char *keyframe)
{
    return run_live_windows(s, frame_count, look_ahead, keyframe, "24");
}

static void a_live_run_finds_the_same_key_and_order(void **state)
{
    (void)state;
    scene files = scene_of(500);
    files.point_counts[8] = 1500;
    scene live = files;
    assert_int_equal(run_scene(&files, NULL, NULL), NPG_OK);
    assert_int_equal(run_live(&live, FRAMES, "11", "-1"), NPG_OK);
    assert_int_equal(live.key, files.key);
    assert_int_equal(live.best_cells, files.best_cells);
    assert_memory_equal(live.order, files.order, sizeof live.order);
    live = files;
    live.seen_count = 0;
    live.first_number = 40;
    assert_int_equal(run_live(&live, FRAMES, "64", "43"), NPG_OK);
    assert_int_equal(live.order[0], 3);
}

static void one_window_over_more_than_the_look_ahead_is_refused(void **state)
{
    (void)state;
    size_t before = npg_memory_used();
    scene s = scene_of(20);
    assert_int_equal(run_live_windows(&s, 30, "8", "-1", "0"), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "look-ahead"));
    assert_int_equal(s.seen_count, 0);
    assert_int_equal(npg_memory_used(), before);
    assert_int_equal(run_live(&s, 0, "8", "-1"), NPG_BAD_INPUT);
    assert_int_equal(run_live_windows(&s, 30, "8", "25", "6"), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "look-ahead of 8 frames: keyframe 25"));
}

static void no_memory_is_said(void **state)
{
    (void)state;
    size_t before = npg_memory_used();
    npg_status status = NPG_MEMORY;
    uint64_t n = 1;
    for (; status && n < 400; n++) {
        scene s = scene_of(4);
        npg_memory_fail_at(n, false);
        status = run_live(&s, 6, "8", "-1");
        npg_memory_fail_at(0, false);
        assert_true(status == NPG_OK || status == NPG_MEMORY);
        assert_int_equal(npg_memory_used(), before);
    }
    assert_int_equal(status, NPG_OK);
    assert_true(n > 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_figures_size_is_that_of_a_frame_not_of_its_way),
        cmocka_unit_test(equal_frames_give_the_middle),
        cmocka_unit_test(every_frame_comes_once_in_the_plans_order),
        cmocka_unit_test(the_score_is_the_methods),
        cmocka_unit_test(bad_points_do_not_reach_the_box),
        cmocka_unit_test(a_number_names_the_keyframe),
        cmocka_unit_test(a_skipped_frame_is_never_the_key),
        cmocka_unit_test(captures_without_extent_are_refused),
        cmocka_unit_test(an_overlap_must_fit),
        cmocka_unit_test(a_live_run_finds_the_same_key_and_order),
        cmocka_unit_test(one_window_over_more_than_the_look_ahead_is_refused),
        cmocka_unit_test(no_memory_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
