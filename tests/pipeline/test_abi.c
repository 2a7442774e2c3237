/* The public interface as a program of another age sees it: layouts that must stay,
 * structs that are longer or shorter than ours, NULL and closed handles in every function
 * (tests/abi.bats sees that none is left out). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <string.h>

#include "neupig.h"

/* ---- layouts ---- */

typedef struct layout {
    const char *name;
    size_t is, was;
} layout;

#define SIZE(type, was)                                                                                      \
    {                                                                                                        \
        "sizeof " #type, sizeof(type), was                                                                   \
    }
#define AT(type, member, was)                                                                                \
    {                                                                                                        \
#type "." #member, offsetof(type, member), was                                                       \
    }

/* Of version 0.1 on a machine with 64-bit pointers.  A new member goes to the end:
 * then only the size grows. */
static const layout layouts[] = {AT(npg_allocator, user, 8),
                                 AT(npg_allocator, alloc, 16),
                                 AT(npg_allocator, release, 24),
                                 SIZE(npg_allocator, 32),
                                 AT(npg_option_info, stage, 8),
                                 AT(npg_option_info, name, 16),
                                 AT(npg_option_info, help, 24),
                                 AT(npg_option_info, default_text, 32),
                                 AT(npg_option_info, choices, 40),
                                 AT(npg_option_info, value_name, 48),
                                 AT(npg_option_info, type, 56),
                                 AT(npg_option_info, min, 64),
                                 AT(npg_option_info, max, 72),
                                 AT(npg_option_info, use, 80),
                                 SIZE(npg_option_info, 88),
                                 AT(npg_frame_view, index, 8),
                                 AT(npg_frame_view, number, 16),
                                 AT(npg_frame_view, path, 24),
                                 AT(npg_frame_view, point_count, 32),
                                 AT(npg_frame_view, points, 40),
                                 AT(npg_frame_view, normals, 48),
                                 AT(npg_frame_view, keep, 56),
                                 AT(npg_frame_view, points_origin, 64),
                                 AT(npg_frame_view, vertex_count, 88),
                                 AT(npg_frame_view, face_count, 96),
                                 AT(npg_frame_view, vertices, 104),
                                 AT(npg_frame_view, faces, 112),
                                 AT(npg_frame_view, vertices_origin, 120),
                                 AT(npg_frame_view, vertices_unit, 144),
                                 AT(npg_frame_view, residual, 152),
                                 AT(npg_frame_view, coverage, 160),
                                 AT(npg_frame_view, colours, 168),
                                 AT(npg_frame_view, vertex_colours, 176),
                                 SIZE(npg_frame_view, 184),
                                 AT(npg_custom_stage, name, 8),
                                 AT(npg_custom_stage, after, 16),
                                 AT(npg_custom_stage, user, 24),
                                 AT(npg_custom_stage, frame, 32),
                                 SIZE(npg_custom_stage, 40),
                                 AT(npg_log_record, level, 8),
                                 AT(npg_log_record, time_s, 16),
                                 AT(npg_log_record, stage, 24),
                                 AT(npg_log_record, frame, 32),
                                 AT(npg_log_record, message, 40),
                                 SIZE(npg_log_record, 48),
                                 AT(npg_progress, stage, 8),
                                 AT(npg_progress, share, 16),
                                 AT(npg_progress, elapsed_s, 24),
                                 AT(npg_progress, left_s, 32),
                                 AT(npg_progress, frames_done, 40),
                                 AT(npg_progress, frames, 48),
                                 AT(npg_progress, step, 56),
                                 AT(npg_progress, steps, 64),
                                 AT(npg_progress, window, 72),
                                 AT(npg_progress, windows, 80),
                                 AT(npg_progress, loss, 88),
                                 SIZE(npg_progress, 96),
                                 AT(npg_exported, files, 8),
                                 AT(npg_exported, repeated, 16),
                                 SIZE(npg_exported, 24),
                                 AT(npg_hooks, user, 8),
                                 AT(npg_hooks, log, 16),
                                 AT(npg_hooks, progress, 24),
                                 SIZE(npg_hooks, 32),
                                 AT(npg_cloud, number, 8),
                                 AT(npg_cloud, point_count, 16),
                                 AT(npg_cloud, points, 24),
                                 AT(npg_cloud, normals, 32),
                                 AT(npg_cloud, colours, 40),
                                 SIZE(npg_cloud, 48),
                                 AT(npg_result, index, 8),
                                 AT(npg_result, number, 16),
                                 AT(npg_result, vertex_count, 24),
                                 AT(npg_result, face_count, 32),
                                 AT(npg_result, vertices, 40),
                                 AT(npg_result, faces, 48),
                                 AT(npg_result, residual, 56),
                                 AT(npg_result, coverage, 64),
                                 AT(npg_result, vertex_colours, 72),
                                 AT(npg_result, good, 80),
                                 SIZE(npg_result, 88),
                                 AT(npg_capture_facts, points_least, 40),
                                 AT(npg_capture_facts, box_low, 88),
                                 AT(npg_capture_facts, bytes, 136),
                                 AT(npg_capture_facts, time_s, 176),
                                 AT(npg_capture_facts, json, 192),
                                 SIZE(npg_capture_facts, 200),
                                 AT(npg_eval_figures, cd, 16),
                                 AT(npg_eval_figures, corr, 72),
                                 AT(npg_eval_figures, vertices, 80),
                                 AT(npg_eval_figures, diagonal, 112),
                                 AT(npg_eval_figures, constant_topology, 152),
                                 SIZE(npg_eval_figures, 160),
                                 AT(npg_eval_settings, predicted, 8),
                                 AT(npg_eval_settings, points_only, 32),
                                 AT(npg_eval_settings, samples, 40),
                                 AT(npg_eval_settings, seed, 56),
                                 AT(npg_eval_settings, frame, 72),
                                 SIZE(npg_eval_settings, 80),
                                 AT(npg_apply_settings, job, 8),
                                 AT(npg_apply_settings, forms, 40),
                                 AT(npg_apply_settings, fps_scale, 48),
                                 AT(npg_apply_settings, overwrite, 64),
                                 SIZE(npg_apply_settings, 72),
                                 AT(npg_applied, frames, 8),
                                 AT(npg_applied, worst_share, 48),
                                 SIZE(npg_applied, 56),
                                 AT(npg_verified, files, 8),
                                 AT(npg_verified, damaged, 16),
                                 SIZE(npg_verified, 24),
                                 AT(npg_picture_settings, width, 8),
                                 AT(npg_picture_settings, azimuth, 40),
                                 AT(npg_picture_settings, up, 56),
                                 AT(npg_picture_settings, colour, 60),
                                 AT(npg_picture_settings, point_size, 64),
                                 SIZE(npg_picture_settings, 72),
                                 AT(npg_picture, width, 8),
                                 AT(npg_picture, points_drawn, 32),
                                 SIZE(npg_picture, 40),
                                 AT(npg_surface_hit, face, 0),
                                 AT(npg_surface_hit, weights, 4),
                                 AT(npg_surface_hit, dist_sq, 16),
                                 SIZE(npg_surface_hit, 20)};

static void members_stay_where_they_are(void **state)
{
    (void)state;
    if (sizeof(void *) != 8) skip();
    for (size_t i = 0; i < sizeof layouts / sizeof *layouts; i++) {
        if (layouts[i].is != layouts[i].was)
            print_error("%s is %zu, was %zu\n", layouts[i].name, layouts[i].is, layouts[i].was);
        assert_int_equal(layouts[i].is, layouts[i].was);
    }
}

static void status_values_stay(void **state)
{
    const int values[] = {NPG_OK,     NPG_END,      NPG_STOPPED,   NPG_PARTIAL, NPG_CHANGED,
                          NPG_FAILED, NPG_USAGE,    NPG_BAD_INPUT, NPG_DEVICE,  NPG_DISK,
                          NPG_MEMORY, NPG_DIVERGED, NPG_ABORTED};
    const int were[] = {0, 1, 2, 3, 4, -1, -2, -3, -4, -5, -6, -7, -8};
    (void)state;
    assert_memory_equal(values, were, sizeof were);
}

/* ---- programs of another age ---- */

static npg_run *open_pushed(void)
{
    npg_options *options = NULL;
    npg_run *run = NULL;
    assert_int_equal(npg_options_open(&options), NPG_OK);
    assert_int_equal(npg_options_set(options, "pull", "yes"), NPG_OK);
    assert_int_equal(npg_run_open(&run, options, NULL), NPG_OK);
    npg_options_close(&options);
    return run;
}

static void structs_of_a_later_version_are_taken_and_shorter_ones_refused(void **state)
{
    static const double points[3] = {1, 2, 3};
    struct {
        npg_cloud cloud;
        double members_to_come[8];
    } later = {{sizeof later, 7, 1, points, NULL, NULL}, {1, 2, 3}};
    npg_cloud shorter = {offsetof(npg_cloud, normals), 8, 1, points, NULL, NULL};
    npg_run *run = open_pushed();
    (void)state;
    assert_int_equal(npg_run_push(run, &later.cloud), NPG_OK);
    assert_int_equal(npg_run_push(run, &later.cloud), NPG_USAGE); /* taken: the number must grow */
    assert_int_equal(npg_run_push(run, &shorter), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "struct_size"));
    npg_run_close(&run);

    npg_hooks hooks = {.struct_size = 8};
    assert_int_equal(npg_run_open(&run, NULL, &hooks), NPG_USAGE);
    assert_null(run);
    npg_allocator allocator = {.struct_size = 8};
    assert_int_equal(npg_memory_set_allocator(&allocator), NPG_USAGE);
}

static void no_more_is_filled_than_the_caller_has(void **state)
{
    struct {
        npg_option_info info;
        unsigned char members_to_come[16];
    } later;
    (void)state;
    memset(&later, 0xaa, sizeof later);
    later.info.struct_size = sizeof later;
    assert_int_equal(npg_options_describe(0, &later.info), NPG_OK);
    assert_string_equal(later.info.name, "input");
    assert_int_equal(later.info.struct_size, sizeof(npg_option_info));
    for (size_t i = 0; i < sizeof later.members_to_come; i++)
        assert_int_equal(later.members_to_come[i], 0xaa);
    later.info.struct_size = 8;
    assert_int_equal(npg_options_describe(0, &later.info), NPG_USAGE);
    later.info.struct_size = sizeof later.info;
    assert_int_equal(npg_options_describe(100000, &later.info), NPG_END);
}

/* ---- NULL and closed handles ---- */

static void words_are_never_null(void **state)
{
    (void)state;
    assert_int_equal(npg_status_exit_code((npg_status)12345), 1);
    assert_string_equal(npg_status_name((npg_status)12345), "unknown");
    assert_non_null(npg_error_text());
    assert_non_null(npg_version());
    assert_int_equal(npg_error_set(NPG_DISK, NULL), NPG_DISK);
    assert_string_equal(npg_error_text(), "");
    assert_int_equal(npg_memory_used(), 0);
    assert_true(npg_memory_peak() > 0);
    assert_int_equal(npg_memory_set_allocator(NULL), NPG_OK);
}

static void options_that_are_not_there(void **state)
{
    npg_options *options = NULL;
    (void)state;
    assert_int_equal(npg_options_open(NULL), NPG_USAGE);
    npg_options_close(NULL);
    assert_int_equal(npg_options_open(&options), NPG_OK);
    npg_options_close(&options);
    assert_null(options);
    npg_options_close(&options);
    assert_int_equal(npg_options_set(options, "seed", "1"), NPG_USAGE);
    assert_int_equal(npg_options_load(options, "/dev/null"), NPG_USAGE);
    assert_int_equal(npg_options_load_job(options, "."), NPG_USAGE);
    assert_null(npg_options_get(options, "seed"));
    assert_int_equal(npg_options_describe(0, NULL), NPG_USAGE);
    assert_int_equal(npg_options_add_stage(options, NULL), NPG_USAGE);

    assert_int_equal(npg_options_open(&options), NPG_OK);
    assert_int_equal(npg_options_set(options, NULL, "1"), NPG_USAGE);
    assert_int_equal(npg_options_set(options, "seed", NULL), NPG_USAGE);
    assert_int_equal(npg_options_load(options, NULL), NPG_USAGE);
    assert_int_equal(npg_options_load_job(options, NULL), NPG_USAGE);
    assert_int_equal(npg_options_load_job(options, "/nowhere"), NPG_USAGE);
    assert_null(npg_options_get(options, NULL));
    assert_int_equal(npg_options_add_stage(options, NULL), NPG_USAGE);
    npg_options_close(&options);
}

static void runs_that_are_not_there(void **state)
{
    npg_run *run = NULL;
    npg_result *result = NULL;
    npg_cloud cloud = {.struct_size = sizeof cloud, .number = 1, .point_count = 1};
    int64_t number;
    (void)state;
    assert_int_equal(npg_run_open(NULL, NULL, NULL), NPG_USAGE);
    assert_int_equal(npg_run_open(&run, NULL, NULL), NPG_USAGE); /* neither output nor pull */
    run = open_pushed();
    assert_int_equal(npg_run_push(run, NULL), NPG_USAGE);
    assert_int_equal(npg_run_push(run, &cloud), NPG_USAGE); /* a point, but no points */
    assert_int_equal(npg_run_wanted_number(NULL, &number), NPG_USAGE);
    assert_int_equal(npg_run_wanted_number(run, NULL), NPG_USAGE);
    assert_int_equal(npg_run_pull(run, NULL), NPG_USAGE);
    npg_run_close(&run);
    assert_null(run);
    npg_run_close(&run);
    npg_run_close(NULL);
    npg_run_stop(run);
    assert_int_equal(npg_run_push(run, &cloud), NPG_USAGE);
    assert_int_equal(npg_run_wanted_number(run, &number), NPG_USAGE);
    assert_int_equal(npg_run_finish(run), NPG_USAGE);
    assert_int_equal(npg_run_pull(run, &result), NPG_USAGE);
    assert_int_equal(npg_run_wait(run), NPG_USAGE);
    npg_result_close(&result);
    npg_result_close(NULL);
}

static void surfaces_that_are_not_there(void **state)
{
    static const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    static const uint32_t face[3] = {0, 1, 2}, wild[3] = {0, 1, 3};
    npg_surface *surface = NULL;
    npg_surface_hit hit;
    (void)state;
    assert_int_equal(npg_surface_open(NULL, corners, 3, face, 1), NPG_USAGE);
    assert_int_equal(npg_surface_open(&surface, NULL, 3, face, 1), NPG_USAGE);
    assert_int_equal(npg_surface_open(&surface, corners, 3, NULL, 1), NPG_USAGE);
    assert_int_equal(npg_surface_open(&surface, corners, 0, face, 0), NPG_USAGE);
    assert_int_equal(npg_surface_open(&surface, corners, 3, wild, 1), NPG_USAGE);
    assert_null(surface);
    assert_int_equal(npg_surface_open(&surface, corners, 3, face, 1), NPG_OK);
    assert_int_equal(npg_surface_move(surface, NULL), NPG_USAGE);
    assert_int_equal(npg_surface_closest(surface, NULL, corners, 1), NPG_USAGE);
    assert_int_equal(npg_surface_closest(surface, &hit, NULL, 1), NPG_USAGE);
    assert_int_equal(npg_surface_closest(surface, NULL, NULL, 0), NPG_OK);
    npg_surface_close(&surface);
    assert_null(surface);
    npg_surface_close(&surface);
    npg_surface_close(NULL);
    assert_int_equal(npg_surface_move(surface, corners), NPG_USAGE);
    assert_int_equal(npg_surface_closest(surface, &hit, corners, 1), NPG_USAGE);
    assert_int_equal(npg_memory_used(), 0);
}

static void results_that_are_not_there(void **state)
{
    const char *const files[] = {"/nowhere.ply"};
    npg_options *options = NULL;
    npg_capture_facts *facts = NULL;
    npg_eval_figures figures = {.struct_size = sizeof figures};
    npg_eval_settings asked = {.struct_size = sizeof asked, .predicted = "/nowhere", .truth = "/nowhere"};
    npg_applied applied = {.struct_size = sizeof applied};
    npg_apply_settings apply = {
        .struct_size = sizeof apply, .job = "/nowhere", .mesh = "a.ply", .output = "out"};
    npg_picture picture = {.struct_size = sizeof picture};
    npg_picture_settings draw = {.struct_size = sizeof draw, .height = 64};
    (void)state;
    assert_int_equal(npg_capture_probe(&facts, NULL), NPG_USAGE);
    assert_int_equal(npg_options_open(&options), NPG_OK);
    assert_int_equal(npg_options_set(options, "input", "/nowhere"), NPG_OK);
    assert_int_equal(npg_capture_probe(NULL, options), NPG_USAGE);
    assert_int_equal(npg_capture_probe(&facts, options), NPG_BAD_INPUT);
    assert_null(facts);
    npg_capture_facts_close(&facts);
    npg_capture_facts_close(NULL);
    npg_options_close(&options);

    assert_int_equal(npg_eval(NULL, &asked), NPG_USAGE);
    assert_int_equal(npg_eval(&figures, NULL), NPG_USAGE);
    assert_int_equal(npg_eval(&figures, &asked), NPG_BAD_INPUT);
    asked.truth = NULL;
    assert_int_equal(npg_eval(&figures, &asked), NPG_USAGE);

    assert_int_equal(npg_apply(NULL, &apply), NPG_USAGE);
    assert_int_equal(npg_apply(&applied, NULL), NPG_USAGE);
    assert_int_equal(npg_apply(&applied, &apply), NPG_USAGE);
    apply.mesh = NULL;
    assert_int_equal(npg_apply(&applied, &apply), NPG_USAGE);

    npg_exported exported = {.struct_size = sizeof exported};
    assert_int_equal(npg_export(NULL, "/nowhere", "glb"), NPG_USAGE);
    assert_int_equal(npg_export(&exported, NULL, "glb"), NPG_USAGE);
    assert_int_equal(npg_export(&exported, "/nowhere", NULL), NPG_USAGE);
    assert_int_equal(npg_export(&exported, "/nowhere", "glb"), NPG_USAGE);

    npg_verified verified = {.struct_size = sizeof verified};
    assert_int_equal(npg_verify(&verified, NULL, NULL, NULL), NPG_USAGE);
    assert_int_equal(npg_verify(NULL, "/nowhere", NULL, NULL), NPG_USAGE);
    assert_int_equal(npg_verify(&verified, "/nowhere", NULL, NULL), NPG_BAD_INPUT);

    assert_int_equal(npg_picture_write(NULL, "a.png", files, 1, &draw), NPG_USAGE);
    assert_int_equal(npg_picture_write(&picture, "a.png", files, 1, NULL), NPG_USAGE);
    assert_int_equal(npg_picture_write(&picture, "a.png", NULL, 0, &draw), NPG_USAGE);
    assert_int_equal(npg_picture_write(&picture, "a.png", files, 1, &draw), NPG_BAD_INPUT);
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(members_stay_where_they_are),
        cmocka_unit_test(status_values_stay),
        cmocka_unit_test(structs_of_a_later_version_are_taken_and_shorter_ones_refused),
        cmocka_unit_test(no_more_is_filled_than_the_caller_has),
        cmocka_unit_test(words_are_never_null),
        cmocka_unit_test(options_that_are_not_there),
        cmocka_unit_test(runs_that_are_not_there),
        cmocka_unit_test(surfaces_that_are_not_there),
        cmocka_unit_test(results_that_are_not_there)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
