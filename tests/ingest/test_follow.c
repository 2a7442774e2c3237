/* Follow: files of a folder that grows, complete and incomplete, in time, late, broken, missing; what ends
 * it.  The folder changes when the follower asks whether to stop, so that every step has its place. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "ingest/ingest_internal.h"
#include "tests/support/temp_folder.h"
#include "tests/support/test_chain.h"

extern const npg_stage npg_stage_ingest;

static temp_folder folder;
static char capture[300]; /* the folder that the running test follows */

static int open_capture(void **state)
{
    (void)state;
    if (open_temp_folder(&folder)) return -1;
    snprintf(capture, sizeof capture, "%s/capture", folder.path);
    return mkdir(capture, 0777);
}

static int close_capture(void **state)
{
    (void)state;
    close_temp_folder(&folder);
    return npg_memory_used() ? -1 : 0;
}

/* ---- what happens in the folder, step by step ---- */

static void write_part(const char *name, const char *text, const char *mode)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s", capture, name);
    FILE *file = fopen(path, mode);
    fputs(text, file);
    fclose(file);
}

#define HEAD                                                                                                 \
    "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "           \
    "z\nend_header\n"

static void write_frame(int number)
{
    char name[64];
    snprintf(name, sizeof name, "frame_%d.ply", number);
    write_part(name, HEAD "1 2 3\n", "wb");
}

typedef void (*deed)(void);
static deed deeds[16]; /* one before each look; then nothing */
static int deed_count, asked;
static bool stops_then;

static bool act(void *user)
{
    (void)user;
    int step = asked++;
    if (step < deed_count && deeds[step]) deeds[step]();
    return stops_then && step >= deed_count;
}

#define DEEDS(...)                                                                                           \
    do {                                                                                                     \
        const deed all[] = {__VA_ARGS__};                                                                    \
        memcpy(deeds, all, sizeof all);                                                                      \
        deed_count = sizeof all / sizeof *all;                                                               \
        asked = 0;                                                                                           \
    } while (0)

/* "number number! ..." in the order they are given, ! where the file is broken, then why it ended. */
static const char *follow_all(const npg_follow_settings *wanted, char seen[256])
{
    npg_follow_settings settings = *wanted;
    npg_follow *follow;
    npg_origin origin = {0};
    npg_status status = NPG_OK;
    if (!settings.where) settings.where = capture;
    settings.end_name = "capture.end";
    settings.stopping = act;
    seen[0] = 0;
    assert_int_equal(npg_follow_open(&follow, &settings), NPG_OK);
    while (status == NPG_OK || status == NPG_PARTIAL) {
        npg_frame frame = {0};
        size_t used = strlen(seen);
        status = npg_follow_next(follow, &frame, &origin);
        if (status == NPG_OK || status == NPG_PARTIAL)
            snprintf(seen + used, 256 - used, "%d%s ", (int)frame.number, status ? "!" : "");
        else
            snprintf(seen + used, 256 - used, "%s late %d", npg_status_name(status),
                     (int)npg_follow_facts_of(follow)->late_count);
        if (status == NPG_OK) assert_int_equal(frame.point_count, 1);
        npg_frame_clear(&frame);
    }
    npg_follow_close(&follow);
    return seen;
}

#define FOLLOW_LOOSELY(...) follow_all(&(npg_follow_settings){__VA_ARGS__}, (char[256]){0})
#define FOLLOW(...)         FOLLOW_LOOSELY(.finds_gaps = true, __VA_ARGS__)
#define END(late)           "end late " #late

/* ---- deeds ---- */

static void end_it(void)
{
    write_part("capture.end", "", "wb");
}
static void frame_0(void)
{
    write_frame(0);
}
static void frame_1(void)
{
    write_frame(1);
}
static void frame_2(void)
{
    write_frame(2);
}
static void half_of_1(void)
{
    write_part("frame_1.ply", "ply\nformat ascii 1.0\nelement ver", "wb");
}
static void rest_of_1(void)
{
    write_part("frame_1.ply",
               "tex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n", "ab");
}
static void moved_3(void)
{
    char from[512], to[512];
    write_part(".frame_3.ply.part", HEAD "1 2 3\n", "wb");
    snprintf(from, sizeof from, "%s/.frame_3.ply.part", capture);
    snprintf(to, sizeof to, "%s/frame_3.ply", capture);
    rename(from, to);
}
static void frames_3_to_12(void)
{
    for (int i = 3; i <= 12; i++) write_frame(i);
}

/* ---- tests ---- */

static void what_is_there_comes_in_natural_order(void **state)
{
    (void)state;
    for (int i = 12; i >= 8; i--) write_frame(i);
    write_part("calibration.txt", "1 2 3\n", "wb");
    write_part("notes.md", "no frame\n", "wb");
    end_it();
    DEEDS(NULL);
    assert_string_equal(FOLLOW(.idle_s = 0), "8 9 10 11 12 " END(0));
}

static void a_file_counts_when_it_is_complete(void **state)
{
    (void)state;
    DEEDS(frame_0, half_of_1, NULL, frame_2, NULL, NULL, rest_of_1, moved_3, end_it);
    assert_string_equal(FOLLOW(.settle_s = 1000), "0 1 2 3 " END(0));
    assert_true(asked >= 9);
}

static void a_file_that_stays_broken_is_told(void **state)
{
    (void)state;
    DEEDS(frame_0, half_of_1, frame_2, NULL, end_it);
    assert_string_equal(FOLLOW(.settle_s = 0.3), "0 1! 2 " END(0));
    assert_non_null(strstr(npg_error_text(), "frame_1.ply"));
    DEEDS(NULL); /* nothing follows it but the end */
    unlink(in_folder(&folder, "capture/frame_2.ply"));
    assert_string_equal(FOLLOW(.settle_s = 0.3), "0 1! " END(0));
}

static void an_empty_file_is_not_complete(void **state)
{
    (void)state;
    write_part("a_0.xyz", "1 2 3\n", "wb");
    write_part("a_1.xyz", "", "wb");
    write_part("a_2.xyz", "1 2 3\n", "wb");
    DEEDS(NULL, NULL, NULL);
    stops_then = true;
    assert_string_equal(FOLLOW(.settle_s = 1000), "0 stopped late 0");
    stops_then = false;
}

static void time_without_frames_ends_it(void **state)
{
    (void)state;
    DEEDS(frame_0, NULL, frame_1);
    assert_string_equal(FOLLOW(.idle_s = 2.5), "0 1 " END(0));
    DEEDS(NULL);
    assert_int_equal(unlink(in_folder(&folder, "capture/frame_0.ply")), 0);
    assert_int_equal(unlink(in_folder(&folder, "capture/frame_1.ply")), 0);
    assert_string_equal(FOLLOW(.idle_s = 0.3), END(0));
}

static void a_number_that_is_left_out_is_waited_for(void **state)
{
    (void)state;
    DEEDS(frame_0, frame_2, NULL, NULL, frame_1, end_it);
    assert_string_equal(FOLLOW(.idle_s = 0), "0 1 2 " END(0));
}

static void not_for_ever(void **state)
{
    (void)state;
    DEEDS(frame_0, frame_2, NULL, frames_3_to_12, NULL, NULL, NULL, frame_1, NULL, end_it);
    assert_string_equal(FOLLOW(.idle_s = 0), "0 2 3 4 5 6 7 8 9 10 11 12 " END(1));
}

static void nor_where_numbers_mean_nothing(void **state)
{
    (void)state;
    DEEDS(frame_0, frame_2, NULL, NULL, frame_1, NULL, end_it);
    assert_string_equal(FOLLOW_LOOSELY(.finds_gaps = false), "0 2 " END(1));
}

static void a_pattern_chooses_names(void **state)
{
    (void)state;
    char where[400];
    frame_0();
    frame_1();
    write_part("other_5.ply", HEAD "1 2 3\n", "wb");
    end_it();
    snprintf(where, sizeof where, "%s/frame_*.ply", capture);
    DEEDS(NULL);
    assert_string_equal(FOLLOW(.where = where), "0 1 " END(0));
}

static void misuse(void **state)
{
    (void)state;
    npg_follow *follow;
    npg_follow_settings settings = {.where = "/nowhere/at/all", .end_name = ""};
    assert_int_equal(npg_follow_open(&follow, &settings), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "/nowhere/at/all"));
    frame_0();
    settings.where = in_folder(&folder, "capture/frame_0.ply");
    assert_int_equal(npg_follow_open(&follow, &settings), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "only a folder"));
}

static void no_memory_is_said(void **state)
{
    (void)state;
    npg_status status = NPG_MEMORY;
    for (int i = 0; i < 3; i++) write_frame(i);
    end_it();
    DEEDS(NULL);
    const npg_follow_settings settings = {
        .where = capture, .end_name = "capture.end", .finds_gaps = true, .stopping = act};
    uint64_t n = 1;
    for (; status == NPG_MEMORY && n < 200; n += n < 12 ? 1 : 9) {
        npg_follow *follow;
        npg_origin origin = {0};
        npg_memory_fail_at(n, false);
        status = npg_follow_open(&follow, &settings);
        while (!status) {
            npg_frame frame = {0};
            status = npg_follow_next(follow, &frame, &origin);
            npg_frame_clear(&frame);
        }
        npg_memory_fail_at(0, false);
        npg_follow_close(&follow);
        assert_true(status == NPG_MEMORY || status == NPG_END);
        assert_int_equal(npg_memory_used(), 0);
    }
    assert_int_equal(status, NPG_END);
    assert_true(n > 10);
}

/* ---- through ingest ---- */

static char passed[512];

static npg_status note(npg_worker *worker, npg_chunk **chunk)
{
    const npg_frame *frame = npg_chunk_frame(*chunk, 0);
    size_t used = strlen(passed);
    (void)worker;
    snprintf(passed + used, sizeof passed - used, "%d/%d%s%s ", (int)frame->index, (int)frame->number,
             frame->is_skipped ? "s" : "", frame->is_held ? "h" : "");
    return NPG_OK;
}

/* Sees the frames as they come. */
static const npg_stage watch = {
    .name = "watch", .help = "", .passes = NPG_PASS_MEASURE, .needs = NPG_FIELD_POINTS, .process = note};

static const npg_stage *const chain[] = {&npg_stage_ingest, &watch, NULL};

#define RUN(...)                                                                                             \
    run_chain(chain,                                                                                         \
              (const char *const[][2]){{"follow", capture},                                                  \
                                       {"output", "unused"},                                                 \
                                       {"follow-settle", "0.3"},                                             \
                                       {"follow-end.idle", "5"},                                             \
                                       __VA_ARGS__,                                                          \
                                       {NULL, NULL}},                                                        \
              text)

static void gaps_and_broken_files_are_treated_as_in_files(void **state)
{
    (void)state;
    char text[1024];
    frame_0();
    frame_1();
    write_frame(4);
    write_frame(5);
    end_it();
    assert_int_equal(RUN({"missing", "error"}), NPG_BAD_INPUT);
    assert_non_null(strstr(text, "2 frames are missing between 1 and 4"));
    passed[0] = 0;
    assert_int_equal(RUN({"missing", "skip"}), NPG_PARTIAL);
    assert_string_equal(passed, "0/0 1/1 2/2s 3/3s 4/4 5/5 ");
    passed[0] = 0;
    assert_int_equal(RUN({"missing", "hold"}), NPG_OK);
    assert_string_equal(passed, "0/0 1/1 2/2h 3/3h 4/4 5/5 ");
    passed[0] = 0;
    assert_int_equal(RUN({"missing", "ignore"}, {"frames", "1:3"}), NPG_OK);
    assert_string_equal(passed, "0/1 1/4 ");
    passed[0] = 0;
    assert_int_equal(RUN({"missing", "hold"}, {"frames", "::2"}), NPG_OK);
    assert_string_equal(passed, "0/0 1/2h 2/4 ");
    half_of_1();
    assert_int_equal(RUN({"missing", "ignore"}), NPG_BAD_INPUT);
    assert_non_null(strstr(text, "frame_1.ply"));
    passed[0] = 0;
    assert_int_equal(RUN({"missing", "ignore"}, {"keep-going", "yes"}), NPG_PARTIAL);
    assert_string_equal(passed, "0/0 1/1s 2/4 3/5 ");
}

static void options_that_make_no_sense(void **state)
{
    (void)state;
    char text[1024];
    assert_int_equal(RUN({"input", "files"}), NPG_USAGE);
    assert_non_null(strstr(text, "files"));
    assert_int_equal(RUN({"follow-end.name", ""}, {"follow-end.idle", "0"}), NPG_USAGE);
    assert_non_null(strstr(text, "nothing would ever end"));
    assert_int_equal(RUN({"frames", "-3:"}), NPG_USAGE);
    end_it();
    assert_int_equal(RUN({"missing", "error"}), NPG_BAD_INPUT);
    assert_non_null(strstr(text, "no frame came"));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, open_capture, close_capture)

int main(void)
{
    const struct CMUnitTest tests[] = {TEST(what_is_there_comes_in_natural_order),
                                       TEST(a_file_counts_when_it_is_complete),
                                       TEST(a_file_that_stays_broken_is_told),
                                       TEST(an_empty_file_is_not_complete),
                                       TEST(time_without_frames_ends_it),
                                       TEST(a_number_that_is_left_out_is_waited_for),
                                       TEST(not_for_ever),
                                       TEST(nor_where_numbers_mean_nothing),
                                       TEST(a_pattern_chooses_names),
                                       TEST(misuse),
                                       TEST(no_memory_is_said),
                                       TEST(gaps_and_broken_files_are_treated_as_in_files),
                                       TEST(options_that_make_no_sense)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
