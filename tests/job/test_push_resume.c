/* Pushed frames: a program that is killed (-9) asks the next run which frame to push first, and its meshes
 * are those of a program that was left alone. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <signal.h>
#include <sys/wait.h>
#include <time.h>

#include "neupig.h"
#include "tests/support/group_folder.h"

enum { FRAMES = 26, POINTS = 400, FIRST = 100, STEP = 10 };

/* ---- a run ---- */

static npg_status open_run(npg_run **run, const char *output, const char *const more[2])
{
    const char *const settings[][2] = {
        {"output", output},      {"window", "5"},        {"overlap", "2"},       {"look-ahead", "8"},
        {"epochs", "2"},         {"faces", "200"},       {"align-nodes", "20"},  {"align-steps", "2"},
        {"bars.flipped", "100"}, {"poisson-depth", "4"}, {"bars.coverage", "0"}, {"bars.residual", "100"}};
    npg_options *options = NULL;
    assert_int_equal(npg_options_open(&options), NPG_OK);
    for (size_t i = 0; i < sizeof settings / sizeof *settings; i++)
        assert_int_equal(npg_options_set(options, settings[i][0], settings[i][1]), NPG_OK);
    if (more) assert_int_equal(npg_options_set(options, more[0], more[1]), NPG_OK);
    npg_status status = npg_run_open(run, options, NULL);
    npg_options_close(&options);
    return status;
}

static int64_t number_of(int t)
{
    return FIRST + (int64_t)STEP * t;
}

/* A ball that sways; other points of it in every frame. */
static npg_status push(npg_run *run, int t, double off)
{
    static double points[3 * POINTS];
    static float normals[3 * POINTS];
    for (int i = 0; i < POINTS; i++) {
        double z = 1 - 2 * (i + 0.5) / POINTS, turn = 2.399963229728653 * i + t, flat = sqrt(1 - z * z);
        const double at[3] = {flat * cos(turn), flat * sin(turn), z};
        for (int a = 0; a < 3; a++) {
            points[3 * i + a] = at[a] + (a ? 0 : 0.1 * sin(0.3 * t) + off);
            normals[3 * i + a] = (float)at[a];
        }
    }
    const npg_cloud cloud = {.struct_size = sizeof cloud,
                             .number = number_of(t),
                             .point_count = POINTS,
                             .points = points,
                             .normals = normals};
    return npg_run_push(run, &cloud);
}

static npg_status finish(npg_run **run, npg_status status)
{
    if (!status) status = npg_run_finish(*run);
    if (!status) status = npg_run_wait(*run);
    if (status < 0) print_message("%s\n", npg_error_text());
    npg_run_close(run);
    return status;
}

/* Push the frames from `first` on. */
static npg_status run_from(const char *output, int first, const char *const more[2])
{
    npg_run *run;
    npg_status status = open_run(&run, output, more);
    for (int t = first; t < FRAMES && !status; t++) status = push(run, t, 0);
    return finish(&run, status);
}

/* ---- a program that is killed ---- */

static int has_state(const char *output, int serial)
{
    static char head[8 + 8 + 8]; /* of a record of the job's store: magic, kind, number */
    char path[600];
    int64_t newest = -1;
    snprintf(path, sizeof path, "%s/job/store.npg", output);
    FILE *file = fopen(path, "rb");
    if (!file) return 0;
    for (long at = 0; !fseek(file, at, SEEK_SET) && fread(head, sizeof head, 1, file) == 1; at += 8)
        if (!memcmp(head, "NPGREC01state\0\0\0", 16)) memcpy(&newest, head + 16, sizeof newest);
    fclose(file);
    return newest >= serial;
}

static const char program[] = "/proc/self/exe";

/* Pushes what is wanted up to frame `last`, then waits for the end that comes. */
static int push_for_ever(const char *output, int last)
{
    npg_run *run;
    int64_t wanted;
    if (open_run(&run, output, NULL) || npg_run_wanted_number(run, &wanted)) return 1;
    for (int t = 0; t <= last; t++)
        if (number_of(t) >= wanted && push(run, t, 0)) return 1;
    for (;;) pause();
}

/* The program that is killed is this one, started anew: a mere fork of a process with threads has their locks, held
 * by nobody who could open them. */
static void run_and_kill(const char *output, int serial, int last)
{
    char last_text[16];
    snprintf(last_text, sizeof last_text, "%d", last);
    pid_t child = fork();
    assert_true(child >= 0);
    if (!child) {
        execl(program, program, output, last_text, (char *)NULL);
        _exit(127);
    }
    while (!has_state(output, serial) && !waitpid(child, NULL, WNOHANG))
        nanosleep(&(struct timespec){0, 10000000}, NULL);
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
    assert_true(has_state(output, serial));
}

static void same_file(const char *a, const char *b)
{
    char *text_a = text_of_file(a), *text_b = text_of_file(b);
    assert_non_null(text_a);
    assert_non_null(text_b);
    assert_string_equal(text_a, text_b);
    free(text_a);
    free(text_b);
}

static void same_results(const char *left, const char *killed)
{
    static const char *const names[] = {"frames.jsonl", "reference.ply"};
    char a[600], b[600];
    for (int i = 0; i < 2; i++) {
        snprintf(a, sizeof a, "%s/%s", left, names[i]);
        snprintf(b, sizeof b, "%s/%s", killed, names[i]);
        same_file(a, b); /* the first has the checksums of all meshes */
    }
}

/* ---- tests ---- */

static void what_is_wanted_is_pushed_after_two_kills(void **state)
{
    char left[512], killed[512];
    npg_run *run;
    int64_t wanted;
    (void)state;
    snprintf(left, sizeof left, "%s", in_folder(&folder, "left"));
    snprintf(killed, sizeof killed, "%s", in_folder(&folder, "killed"));
    run_and_kill(killed, 0, 12);
    run_and_kill(killed, 3, FRAMES - 1);
    assert_true(run_from(left, 0, NULL) >= 0);
    assert_int_equal(open_run(&run, killed, NULL), NPG_OK);
    assert_int_equal(npg_run_wanted_number(run, &wanted), NPG_OK);
    assert_true(wanted > number_of(4) && wanted <= number_of(FRAMES));
    npg_run_close(&run);
    int first = 0;
    while (number_of(first) < wanted) first++;
    assert_true(run_from(killed, first, NULL) >= 0);
    same_results(left, killed);
}

static void frames_that_come_again_are_compared(void **state)
{
    char left[512], killed[512];
    npg_run *run;
    (void)state;
    snprintf(left, sizeof left, "%s", in_folder(&folder, "left"));
    snprintf(killed, sizeof killed, "%s", in_folder(&folder, "compared"));
    run_and_kill(killed, 3, FRAMES - 1);
    /* another frame under a number that came */
    assert_int_equal(open_run(&run, killed, NULL), NPG_OK);
    npg_status status = push(run, 0, 0.5);
    for (int t = 1; t < FRAMES && !status; t++) status = push(run, t, 0);
    assert_int_equal(finish(&run, status), NPG_USAGE);
    /* one that never came */
    assert_int_equal(open_run(&run, killed, NULL), NPG_OK);
    const double point[3] = {0};
    const npg_cloud other = {
        .struct_size = sizeof other, .number = FIRST + 1, .point_count = 1, .points = point};
    status = npg_run_push(run, &other);
    for (int t = 1; t < FRAMES && !status; t++) status = push(run, t, 0);
    assert_int_equal(finish(&run, status), NPG_USAGE);
    /* all of them */
    assert_true(run_from(killed, 0, NULL) >= 0);
    same_results(left, killed);
    /* a job that is done is as it always was */
    assert_int_equal(run_from(killed, 0, NULL), NPG_USAGE);
    static const char *const again[2] = {"restart", "yes"};
    assert_true(run_from(killed, 0, again) >= 0);
}

static void runs_that_read_files_want_none(void **state)
{
    npg_run *run;
    int64_t wanted;
    const char *const input[2] = {"input", "/nowhere"};
    (void)state;
    assert_int_equal(npg_run_wanted_number(NULL, &wanted), NPG_USAGE);
    assert_int_equal(open_run(&run, in_folder(&folder, "files"), input), NPG_OK);
    assert_int_equal(npg_run_wanted_number(run, NULL), NPG_USAGE);
    assert_int_equal(npg_run_wanted_number(run, &wanted), NPG_USAGE);
    npg_run_close(&run);
    assert_int_equal(open_run(&run, in_folder(&folder, "fresh"), NULL), NPG_OK);
    assert_int_equal(npg_run_wanted_number(run, &wanted), NPG_OK);
    assert_true(wanted == INT64_MIN);
    npg_run_stop(run);
    npg_run_close(&run);
}

int main(int argc, char **argv)
{
    if (argc == 3) return push_for_ever(argv[1], atoi(argv[2]));
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_wanted_is_pushed_after_two_kills),
        cmocka_unit_test(frames_that_come_again_are_compared),
        cmocka_unit_test(runs_that_read_files_want_none),
    };
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
