/* Stages that a program adds to the chain: which passes they see, what they may change, how they fail. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

#include "tests/support/test_chain.h"

enum { FRAMES = 5, POINTS = 6 };

/* Every frame has the points (frame, i, 0). */
static npg_status make_points(npg_frame *frame, npg_facts *facts, int64_t index, void *user)
{
    (void)facts, (void)user;
    NPG_TRY(npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, POINTS, 3 * sizeof(float)));
    NPG_TRY(npg_alloc_array(&frame->normals, NPG_FOR_FRAMES, POINTS, 3 * sizeof(float)));
    frame->point_count = POINTS;
    for (int i = 0; i < POINTS; i++) {
        frame->pos_local[3 * i] = (float)index;
        frame->pos_local[3 * i + 1] = (float)i;
        frame->normals[3 * i] = (float)i;
    }
    return NPG_OK;
}

static npg_status pass_on(npg_worker *worker, npg_chunk **chunk)
{
    (void)worker, (void)chunk;
    return NPG_OK;
}

static const npg_stage cleaner = {.name = "cleaner",
                                  .help = "",
                                  .passes = NPG_PASS_MEASURE | NPG_PASS_SCORE | NPG_PASS_SOLVE,
                                  .gives = NPG_FIELD_CLEAN,
                                  .process = pass_on};
static const npg_stage keyer = {.name = "keyer",
                                .help = "",
                                .passes = NPG_PASS_MEASURE | NPG_PASS_SCORE | NPG_PASS_SOLVE,
                                .gives = NPG_FIELD_KEY,
                                .process = pass_on};
static const npg_stage absent = {.name = "absent", .help = ""};
static const npg_stage *const chain[] = {&absent, &test_source, &cleaner, &keyer, &test_sink, NULL};

typedef struct seen {
    int frames, points, points_at_end;
    bool first_only_kept;
    npg_status fails_with;
    const char *text;
    float spoils;
} seen;

static npg_status count_frames(void *user, npg_frame_view *frame)
{
    seen *s = user;
    assert_int_equal(frame->struct_size, sizeof *frame);
    assert_true(isnan(frame->residual) && isnan(frame->coverage));
    assert_null(frame->vertices);
    assert_int_equal(frame->vertex_count, 0);
    s->frames++;
    s->points += (int)frame->point_count;
    for (size_t i = 0; i < frame->point_count; i++) assert_int_equal(frame->keep[i], 1);
    return NPG_OK;
}

/* Keep the points with odd numbers, moved by one. */
static npg_status keep_odd(void *user, npg_frame_view *frame)
{
    (void)user;
    for (size_t i = 0; i < frame->point_count; i++) {
        frame->keep[i] = (int)frame->points[3 * i + 1] % 2;
        frame->points[3 * i + 2] = 1;
    }
    return NPG_OK;
}

static npg_status misbehave(void *user, npg_frame_view *frame)
{
    const seen *s = user;
    if (frame->index != 3) return NPG_OK;
    if (s->spoils != 0) frame->points[4] = s->spoils;
    if (s->first_only_kept) memset(frame->keep, 0, frame->point_count);
    return s->text ? npg_error_set(s->fails_with, s->text) : s->fails_with;
}

static npg_status check_odd(npg_worker *worker, npg_frame *frame, void *user)
{
    seen *s = user;
    (void)worker;
    assert_int_equal(frame->point_count, POINTS / 2);
    for (size_t i = 0; i < frame->point_count; i++) {
        assert_true(frame->pos_local[3 * i + 1] == (float)(2 * i + 1));
        assert_true(frame->normals[3 * i] == (float)(2 * i + 1));
        assert_true(frame->pos_local[3 * i + 2] == 1);
    }
    s->points_at_end += (int)frame->point_count;
    return NPG_OK;
}

/* A run over files with these stages; the options are gone before it begins to be waited for. */
static npg_status run_with(const npg_custom_stage *stages, size_t count, char text[1024])
{
    npg_options *options = NULL;
    npg_run *run = NULL;
    assert_int_equal(npg_options_open_chain(&options, chain), NPG_OK);
    assert_int_equal(npg_options_set(options, "input", "any"), NPG_OK);
    assert_int_equal(npg_options_set(options, "output", "any"), NPG_OK);
    for (size_t i = 0; i < count; i++) assert_int_equal(npg_options_add_stage(options, &stages[i]), NPG_OK);
    npg_status status = npg_run_open_chain(&run, options, NULL, chain);
    npg_options_close(&options);
    if (!status) status = npg_run_wait(run);
    snprintf(text, 1024, "%s", status ? npg_error_text() : "");
    npg_run_close(&run);
    assert_int_equal(npg_memory_used(), 0);
    return status;
}

static void set_script(void *user)
{
    script = (test_script){.frame_count = FRAMES, .make = make_points, .user = user};
}

static void it_sees_every_pass_until_the_keyframe_is_known_and_the_last_one_after(void **state)
{
    char text[1024], early_name[] = "early";
    seen early = {0}, late = {0};
    (void)state;
    set_script(NULL);
    const npg_custom_stage stages[] = {{sizeof *stages, early_name, "cleaner", &early, count_frames},
                                       {sizeof *stages, "late", "keyer", &late, count_frames}};
    assert_int_equal(run_with(stages, 2, text), NPG_OK);
    assert_int_equal(early.frames, 3 * FRAMES);
    assert_int_equal(late.frames, FRAMES);
    assert_int_equal(late.points, FRAMES * POINTS);
}

static void what_it_drops_and_moves_the_stages_behind_get(void **state)
{
    char text[1024];
    seen counted = {0};
    (void)state;
    set_script(&counted);
    script.see = check_odd;
    const npg_custom_stage stages[] = {{sizeof *stages, "odd", "source", NULL, keep_odd},
                                       {sizeof *stages, "count", "source", &counted, count_frames}};
    assert_int_equal(run_with(stages, 2, text), NPG_OK);
    assert_int_equal(counted.points_at_end, FRAMES * POINTS / 2);
    assert_int_equal(counted.points, 3 * FRAMES * POINTS / 2); /* of what the first left */
}

static void check_failure(seen how, npg_status expected, const char *words)
{
    char text[1024];
    set_script(NULL);
    const npg_custom_stage stage = {sizeof stage, "mine", "cleaner", &how, misbehave};
    assert_int_equal(run_with(&stage, 1, text), expected);
    if (!strstr(text, words)) print_error("%s\n", text);
    assert_non_null(strstr(text, words));
}

static void its_failures_end_the_run_with_its_words(void **state)
{
    (void)state;
    check_failure((seen){.fails_with = NPG_DEVICE, .text = "no lamp"}, NPG_DEVICE, "mine: frame 3: no lamp");
    check_failure((seen){.fails_with = NPG_FAILED}, NPG_FAILED, "mine: frame 3: failed");
    check_failure((seen){.fails_with = NPG_END}, NPG_USAGE, "mine: frame 3: returned 1");
    check_failure((seen){.fails_with = NPG_STOPPED}, NPG_STOPPED, "stopped on request");
    check_failure((seen){.spoils = NAN}, NPG_USAGE, "mine: frame 3: left point 1 with a coordinate");
    check_failure((seen){.first_only_kept = true}, NPG_BAD_INPUT, "mine: frame 3: dropped every point");
}

static void check_refused(npg_options *options, npg_custom_stage stage, const char *words)
{
    assert_int_equal(npg_options_add_stage(options, &stage), NPG_USAGE);
    if (!strstr(npg_error_text(), words)) print_error("%s\n", npg_error_text());
    assert_non_null(strstr(npg_error_text(), words));
}

static void what_makes_no_sense_is_refused(void **state)
{
    npg_options *options;
    char name[] = "more-0";
    const size_t size = sizeof(npg_custom_stage);
    (void)state;
    assert_int_equal(npg_options_open_chain(&options, chain), NPG_OK);
    check_refused(options, (npg_custom_stage){size, "a", "nowhere", NULL, keep_odd}, "no stage nowhere");
    check_refused(options, (npg_custom_stage){size, "a", "absent", NULL, keep_odd}, "no stage absent");
    check_refused(options, (npg_custom_stage){size, "keyer", "source", NULL, keep_odd}, "taken");
    check_refused(options, (npg_custom_stage){size, "run", "source", NULL, keep_odd}, "taken");
    check_refused(options, (npg_custom_stage){size, "Two words", "source", NULL, keep_odd}, "small letters");
    check_refused(options, (npg_custom_stage){size, "", "source", NULL, keep_odd}, "small letters");
    check_refused(options, (npg_custom_stage){size, "a", "source", NULL, NULL}, "needs");
    check_refused(options, (npg_custom_stage){size, NULL, "source", NULL, keep_odd}, "needs");
    check_refused(options, (npg_custom_stage){size - 1, "a", "source", NULL, keep_odd}, "struct_size");
    assert_int_equal(npg_options_add_stage(options, NULL), NPG_USAGE);
    assert_int_equal(npg_options_add_stage(NULL, NULL), NPG_USAGE);
    for (int i = 0; i < NPG_CUSTOM_STAGES_MAX; i++) {
        name[5] = (char)('0' + i);
        npg_custom_stage stage = {size, name, "source", NULL, keep_odd};
        assert_int_equal(npg_options_add_stage(options, &stage), NPG_OK);
        check_refused(options, stage, "taken");
    }
    check_refused(options, (npg_custom_stage){size, "last", "source", NULL, keep_odd}, "no more than");
    npg_options_close(&options);
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_sees_every_pass_until_the_keyframe_is_known_and_the_last_one_after),
        cmocka_unit_test(what_it_drops_and_moves_the_stages_behind_get),
        cmocka_unit_test(its_failures_end_the_run_with_its_words),
        cmocka_unit_test(what_makes_no_sense_is_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
