/* The whole library through its public interface: clouds are pushed, meshes are pulled; memory that is
 * refused and a close in the middle end it cleanly. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "neupig.h"
#include "pipeline/memory.h"

enum { FRAMES = 4, POINTS = 900, VERTS_MAX = 2000 };

static const double far_off[3] = {431000.25, 5412000.5, 120}; /* metres, as a survey has them */

/* A ball of radius 1 m that moves 4 cm per frame. */
static void centre_of(double centre[3], int64_t frame)
{
    for (int a = 0; a < 3; a++) centre[a] = far_off[a] + (a == 0 ? 0.04 * (double)frame : 0);
}

static void make_ball(double *points, float *normals, int64_t frame)
{
    double centre[3];
    centre_of(centre, frame);
    for (int i = 0; i < POINTS; i++) { /* an even spiral, turned a little in every frame */
        double z = 1 - 2 * (i + 0.5) / POINTS, turn = i * 2.399963229728653 + 0.7 * (double)frame;
        double flat = sqrt(1 - z * z), n[3] = {flat * cos(turn), flat * sin(turn), z};
        for (int a = 0; a < 3; a++) {
            points[3 * i + a] = centre[a] + n[a];
            normals[3 * i + a] = (float)n[a];
        }
    }
}

static npg_options *open_options(void)
{
    const char *const settings[][2] = {{"pull", "yes"},        {"epochs", "40"}, {"faces", "600"},
                                       {"poisson-depth", "4"}, {"output", ""},   {"bars.residual", "5"},
                                       {"keyframe", "12"}};
    npg_options *options;
    assert_int_equal(npg_options_open(&options), NPG_OK);
    for (size_t i = 0; i < sizeof settings / sizeof *settings; i++)
        assert_int_equal(npg_options_set(options, settings[i][0], settings[i][1]), NPG_OK);
    return options;
}

static npg_status push_all(npg_run *run)
{
    static double points[3 * POINTS];
    static float normals[3 * POINTS];
    for (int64_t t = 0; t < FRAMES; t++) {
        npg_cloud cloud = {sizeof cloud, 10 + t, POINTS, points, normals, NULL};
        make_ball(points, normals, t);
        npg_status status = npg_run_push(run, &cloud);
        if (status) return status;
    }
    return npg_run_finish(run);
}

static void check_result(const npg_result *result)
{
    double centre[3], worst = 0;
    centre_of(centre, result->index);
    assert_int_equal(result->number, 10 + result->index);
    assert_true(result->vertex_count > 100 && result->vertex_count < VERTS_MAX);
    assert_true(result->face_count > 200 && result->face_count <= 600);
    for (size_t i = 0; i < 3 * result->face_count; i++) assert_true(result->faces[i] < result->vertex_count);
    for (size_t v = 0; v < result->vertex_count; v++) {
        double dist_sq = 0;
        for (int a = 0; a < 3; a++) dist_sq += pow(result->vertices[3 * v + (size_t)a] - centre[a], 2);
        worst = fmax(worst, fabs(sqrt(dist_sq) - 1));
    }
    assert_true(worst < 0.15); /* metres: few epochs, but the ball is where it was pushed */
    assert_true(result->residual >= 0 && result->residual < 0.02);
    assert_true(result->coverage > 0.9);
    assert_true(result->good);
}

/* Positions of all frames in the order of time, and the faces. */
typedef struct motion {
    double vertices[FRAMES][3 * VERTS_MAX];
    uint32_t faces[3 * 600];
} motion;

static void run_once(motion *out)
{
    npg_options *options = open_options();
    npg_run *run;
    npg_result *result;
    int seen[FRAMES] = {0};
    memset(out, 0, sizeof *out);
    npg_status status = npg_run_open(&run, options, NULL);
    if (status) print_error("%s\n", npg_error_text());
    assert_int_equal(status, NPG_OK);
    assert_int_equal(push_all(run), NPG_OK);
    while ((status = npg_run_pull(run, &result)) == NPG_OK) {
        check_result(result);
        assert_int_equal(seen[result->index]++, 0);
        memcpy(out->vertices[result->index], result->vertices, result->vertex_count * 3 * sizeof(double));
        if (seen[result->index] && out->faces[1])
            assert_memory_equal(out->faces, result->faces, result->face_count * 12);
        memcpy(out->faces, result->faces, result->face_count * 12);
        npg_result_close(&result);
    }
    if (status != NPG_END) print_error("%s\n", npg_error_text());
    assert_int_equal(status, NPG_END);
    for (int t = 0; t < FRAMES; t++) assert_int_equal(seen[t], 1);
    assert_int_equal(npg_run_wait(run), NPG_OK);
    npg_run_close(&run);
    npg_options_close(&options);
    assert_int_equal(npg_memory_used(), 0);
}

static void clouds_become_one_moving_mesh_the_same_every_time(void **state)
{
    (void)state;
    motion *first = calloc(1, sizeof *first), *second = calloc(1, sizeof *second);
    run_once(first);
    run_once(second);
    assert_memory_equal(first, second, sizeof *first);
    free(first);
    free(second);
}

/* The whole run with the n-th request for memory refused, whichever stage it is that asks. */
static npg_status run_without_memory_at(uint64_t n)
{
    npg_options *options = open_options();
    npg_run *run = NULL;
    npg_result *result = NULL;
    assert_int_equal(npg_options_set(options, "epochs", "2"), NPG_OK);
    npg_memory_fail_at(n, false);
    npg_status status = npg_run_open(&run, options, NULL);
    if (!status) status = push_all(run);
    while (!status && (status = npg_run_pull(run, &result)) == NPG_OK) npg_result_close(&result);
    if (status == NPG_END) status = npg_run_wait(run);
    npg_memory_fail_at(0, false);
    npg_run_close(&run);
    npg_options_close(&options);
    return status;
}

static void no_memory_anywhere_ends_the_run_cleanly(void **state)
{
    (void)state;
    npg_status status = NPG_MEMORY;
    for (uint64_t n = 25; status < 0 && n < 100000; n = n * 9 / 5) {
        status = run_without_memory_at(n);
        assert_true(status == NPG_MEMORY || status >= 0);
        assert_int_equal(npg_memory_used(), 0);
    }
    assert_true(status >= 0); /* the last one asked for less */
}

static void closing_while_the_fit_is_at_work_frees_everything(void **state)
{
    (void)state;
    npg_options *options = open_options();
    npg_run *run;
    assert_int_equal(npg_options_set(options, "epochs", "1000000"), NPG_OK);
    assert_int_equal(npg_run_open(&run, options, NULL), NPG_OK);
    assert_int_equal(push_all(run), NPG_OK);
    sleep(1); /* wherever that is: it may be any stage */
    npg_run_close(&run);
    npg_options_close(&options);
    assert_int_equal(npg_memory_used(), 0);
}

/* One thread that pushes and pulls by turns.  What it pushes while the look-ahead is walked waits for its
 * turn, and so does the push that finds no room. */
static void one_thread_pushes_and_pulls_by_turns(void **state)
{
    enum { LOOK_AHEAD = 4, WINDOW = 3, LEAD = LOOK_AHEAD + 1 + WINDOW, IN_ALL = 16 };
    (void)state;
    static double points[3 * POINTS];
    static float normals[3 * POINTS];
    npg_options *options = open_options();
    const char *const more[][2] = {
        {"look-ahead", "4"}, {"window", "3"}, {"overlap", "1"}, {"keyframe", "11"}, {"epochs", "2"}};
    for (size_t i = 0; i < sizeof more / sizeof *more; i++)
        assert_int_equal(npg_options_set(options, more[i][0], more[i][1]), NPG_OK);
    npg_run *run;
    npg_result *result;
    int64_t pulled = 0;
    assert_int_equal(npg_run_open(&run, options, NULL), NPG_OK);
    for (int64_t t = 0; t < IN_ALL; t++) {
        npg_cloud cloud = {sizeof cloud, 10 + t, POINTS, points, normals, NULL};
        make_ball(points, normals, t);
        assert_int_equal(npg_run_push(run, &cloud), NPG_OK);
        if (t + 1 < LEAD) continue;
        assert_int_equal(npg_run_pull(run, &result), NPG_OK);
        npg_result_close(&result);
        pulled++;
    }
    assert_int_equal(npg_run_finish(run), NPG_OK);
    npg_status status;
    for (; (status = npg_run_pull(run, &result)) == NPG_OK; pulled++) npg_result_close(&result);
    assert_int_equal(status, NPG_END);
    assert_int_equal(pulled, IN_ALL);
    assert_true(npg_run_wait(run) >= 0);
    npg_run_close(&run);
    npg_options_close(&options);
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(clouds_become_one_moving_mesh_the_same_every_time),
                                       cmocka_unit_test(no_memory_anywhere_ends_the_run_cleanly),
                                       cmocka_unit_test(closing_while_the_fit_is_at_work_frees_everything),
                                       cmocka_unit_test(one_thread_pushes_and_pulls_by_turns)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
