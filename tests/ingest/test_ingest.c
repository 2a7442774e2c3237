/* Ingest: frames of files, of standard input and of a pushing program, in the order each pass needs them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <fcntl.h>

#include "ingest/ingest_internal.h"
#include "tests/support/group_folder.h"
#include "tests/support/test_chain.h"

extern const npg_stage npg_stage_ingest;

/* ---- a stage that writes down what it sees, and plans ---- */

static npg_frame_store *store; /* of the capture that is open */

static npg_status open_capture(npg_capture **capture, const char *path, npg_missing missing, bool keep_going,
                               size_t limit)
{
    npg_frame_files *list;
    *capture = NULL;
    npg_status status = npg_frame_store_open(&store, limit, NULL);
    if (!status) status = npg_frame_files_open(&list, path, "", missing != NPG_MISSING_IGNORE, NULL);
    return status ? status : npg_capture_open(capture, &list, path, missing, keep_going, store);
}

static void close_capture(npg_capture **capture)
{
    npg_capture_close(capture);
    npg_frame_store_close(&store);
}

static char seen[3][2048]; /* per pass: "index/number(flags)points@first-x" */
static npg_facts facts_at_end;
static npg_plan wanted_plan;

static int pass_number(npg_pass pass)
{
    return pass == NPG_PASS_MEASURE ? 0 : pass == NPG_PASS_SCORE ? 1 : 2;
}

static npg_status watch_process(npg_worker *worker, npg_chunk **chunk)
{
    char *text = seen[pass_number(npg_worker_pass(worker))];
    for (size_t i = 0; i < npg_chunk_count(*chunk); i++) {
        const npg_frame *frame = npg_chunk_frame(*chunk, i);
        size_t used = strlen(text);
        double x =
            frame->point_count ? (double)frame->pos_local[0] + npg_worker_facts(worker)->origin.world[0] : 0;
        assert_true(frame->fields & NPG_FIELD_POINTS);
        snprintf(text + used, sizeof seen[0] - used, "%s%lld/%lld%s%s:%zu@%g", used ? " " : "",
                 (long long)frame->index, (long long)frame->number, frame->is_skipped ? "s" : "",
                 frame->is_held ? "h" : "", frame->point_count, x);
    }
    return NPG_OK;
}

static npg_status watch_flush(npg_worker *worker)
{
    npg_facts *facts = test_facts(worker);
    if (npg_worker_pass(worker) == NPG_PASS_SCORE) {
        facts->plan = wanted_plan;
        facts->plan.frame_count = facts->frame_count;
    }
    facts_at_end = *facts;
    return NPG_OK;
}

static const npg_stage watch = {.name = "watch",
                                .help = "",
                                .passes = NPG_PASS_MEASURE | NPG_PASS_SCORE | NPG_PASS_SOLVE,
                                .needs = NPG_FIELD_POINTS,
                                .process = watch_process,
                                .flush = watch_flush};

static const npg_stage *const chain[] = {&npg_stage_ingest, &watch, NULL};

static char failure[1024];

#define OPTIONS(...) ((const char *const[][2]){__VA_ARGS__, {"output", "unused"}, {NULL, NULL}})

static npg_status run(const char *const (*options)[2])
{
    memset(seen, 0, sizeof seen);
    facts_at_end = (npg_facts){0};
    wanted_plan = (npg_plan){.key = 1, .window = 100};
    return run_chain(chain, options, failure);
}

#define RUN(...) run(OPTIONS(__VA_ARGS__))

static npg_status expect_ok(npg_status status)
{
    if (status < 0) print_error("%s\n", failure);
    return status;
}

/* ---- files ---- */

/* A folder with frames f<number>.xyz, each of `number` points, the first at x = 100 + number. */
static const char *make_capture(const char *name, const int *numbers)
{
    static char path[400];
    snprintf(path, sizeof path, "%s", in_folder(&folder, name));
    mkdir(path, 0777);
    for (; *numbers >= 0; numbers++) {
        char file[500], text[2000] = "";
        size_t used = 0;
        snprintf(file, sizeof file, "%s/f%d.xyz", path, *numbers);
        for (int i = 0; i < *numbers; i++)
            used += (size_t)snprintf(text + used, sizeof text - used, "%d %d 0\n", 100 + *numbers + i, i);
        write_text_file(file, text);
    }
    return path;
}

#define CAPTURE(name, ...) make_capture(name, (const int[]){__VA_ARGS__, -1})

static void three_passes_each_in_its_order(void **state)
{
    (void)state;
    static const char *const caches[] = {"0", "512"}, *const chunks[] = {"1", "4"};
    const char *path = CAPTURE("order", 1, 2, 3, 4, 5);
    for (size_t k = 0; k < 4; k++) {
        assert_int_equal(expect_ok(RUN({"input", path}, {"cache", caches[k / 2]}, {"chunk", chunks[k % 2]})),
                         NPG_OK);
        const char *in_time = "0/1:1@101 1/2:2@102 2/3:3@103 3/4:4@104 4/5:5@105";
        assert_string_equal(seen[0], in_time);
        assert_string_equal(seen[1], in_time);
        assert_string_equal(seen[2], "1/2:2@102 2/3:3@103 3/4:4@104 4/5:5@105 0/1:1@101");
        assert_int_equal(facts_at_end.frame_count, 5);
        assert_int_equal(facts_at_end.skipped_count, 0);
        assert_true(facts_at_end.origin.known && facts_at_end.origin.world[0] == 101);
    }
}

static void gaps_are_refused_skipped_held_or_ignored(void **state)
{
    (void)state;
    const char *path = CAPTURE("gap", 1, 2, 5);
    assert_int_equal(RUN({"input", path}), NPG_BAD_INPUT);
    assert_non_null(strstr(failure, "2 of 5 frames are missing: 3, 4"));
    assert_int_equal(RUN({"input", path}, {"missing", "skip"}), NPG_PARTIAL);
    assert_string_equal(seen[0], "0/1:1@101 1/2:2@102 2/3s:0@0 3/4s:0@0 4/5:5@105");
    assert_int_equal(facts_at_end.skipped_count, 2);
    assert_int_equal(RUN({"input", path}, {"missing", "hold"}), NPG_OK);
    assert_string_equal(seen[0], "0/1:1@101 1/2:2@102 2/3h:2@102 3/4h:2@102 4/5:5@105");
    assert_string_equal(seen[2], "1/2:2@102 2/3h:2@102 3/4h:2@102 4/5:5@105 0/1:1@101");
    assert_int_equal(RUN({"input", path}, {"missing", "ignore"}), NPG_OK);
    assert_string_equal(seen[0], "0/1:1@101 1/2:2@102 2/5:5@105");
    assert_int_equal(RUN({"input", path}, {"missing", "hold"}, {"frames", "0-2"}), NPG_OK);
    assert_string_equal(seen[0], "0/0h:1@101 1/1:1@101 2/2:2@102");
}

static void a_selection_makes_its_own_capture(void **state)
{
    (void)state;
    const char *path = CAPTURE("select", 1, 2, 3, 4, 5);
    assert_int_equal(RUN({"input", path}, {"frames", "1::2"}), NPG_OK);
    assert_string_equal(seen[0], "0/2:2@102 1/4:4@104");
    assert_int_equal(RUN({"input", path}, {"frames", "2-3,5"}), NPG_OK);
    assert_string_equal(seen[0], "0/2:2@102 1/3:3@103 2/5:5@105");
    assert_int_equal(RUN({"input", path}, {"frames", "x"}), NPG_USAGE);
    assert_int_equal(RUN({"input", path}, {"frames", "70:"}), NPG_USAGE);
}

static void a_bad_file_stops_or_is_skipped(void **state)
{
    (void)state;
    char bad[500];
    const char *path = CAPTURE("bad", 1, 2, 3);
    snprintf(bad, sizeof bad, "%s/f2.xyz", path);
    write_text_file(bad, "1 2 3\n1 2\n");
    assert_int_equal(RUN({"input", path}), NPG_BAD_INPUT);
    assert_non_null(strstr(failure, "frame 2: "));
    assert_non_null(strstr(failure, "f2.xyz: line 2: 2 values"));
    assert_int_equal(RUN({"input", path}, {"keep-going", "yes"}), NPG_PARTIAL);
    assert_string_equal(seen[0], "0/1:1@101 1/2s:0@0 2/3:3@103");
    assert_string_equal(seen[2], "1/2s:0@0 2/3:3@103 0/1:1@101");
    assert_int_equal(facts_at_end.skipped_count, 1);
    write_text_file(bad, "1 2 3\n1 2\n");
    snprintf(bad, sizeof bad, "%s/f1.xyz", path);
    write_text_file(bad, "what\n");
    snprintf(bad, sizeof bad, "%s/f3.xyz", path);
    write_text_file(bad, "what\n");
    assert_int_equal(RUN({"input", path}, {"keep-going", "yes"}), NPG_BAD_INPUT);
    assert_non_null(strstr(failure, "none of the 3 frames can be used"));
}

static void nothing_to_read(void **state)
{
    (void)state;
    const char *path = in_folder(&folder, "empty");
    mkdir(path, 0777);
    assert_int_equal(RUN({"input", path}), NPG_BAD_INPUT);
    assert_non_null(strstr(failure, "empty: no file here has a format"));
    assert_int_equal(RUN({"input", in_folder(&folder, "not-there")}), NPG_BAD_INPUT);
    assert_non_null(strstr(failure, "not-there: there is no such file or folder"));
}

static void a_file_that_is_exchanged_is_refused_one_that_is_touched_is_not(void **state)
{
    (void)state;
    npg_capture *capture;
    npg_origin origin = {0};
    npg_frame frame;
    const char *path = in_folder(&folder, "exchanged");
    mkdir(path, 0777);
    write_text_file(in_folder(&folder, "exchanged/f0.xyz"), "1 2 3\n");
    assert_int_equal(open_capture(&capture, path, NPG_MISSING_ERROR, true, 0), NPG_OK);
    for (int touched = 0; touched < 2; touched++) {
        assert_int_equal(npg_capture_read(capture, &frame, 0, &origin, false), NPG_OK);
        npg_frame_clear(&frame);
        write_text_file(in_folder(&folder, "exchanged/f0.xyz"), "1 2 3\n");
    }
    write_text_file(in_folder(&folder, "exchanged/f0.xyz"), "1 2 4\n");
    assert_int_equal(npg_capture_read(capture, &frame, 0, &origin, false), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "f0.xyz was exchanged"));
    close_capture(&capture);
    /* nor is one that is not what stage job saw */
    assert_int_equal(open_capture(&capture, path, NPG_MISSING_ERROR, true, 1 << 20), NPG_OK);
    capture->hashes[0] = 1;
    assert_int_equal(npg_capture_read(capture, &frame, 0, &origin, false), NPG_USAGE);
    close_capture(&capture);
}

static void few_files_are_parsed_twice(void **state)
{
    (void)state;
    npg_capture *capture;
    npg_origin origin = {0};
    const char *path = CAPTURE("cache", 1, 2, 3, 4);
    for (int limited = 0; limited < 2; limited++) {
        /* Room for the first two frames: 1 + 2 points. */
        size_t limit = limited ? 2 * sizeof(npg_frame) + 3 * 3 * sizeof(float) : 1 << 20;
        assert_int_equal(open_capture(&capture, path, NPG_MISSING_ERROR, false, limit), NPG_OK);
        for (int pass = 0; pass < 3; pass++)
            for (int64_t i = 0; i < 4; i++) {
                npg_frame frame;
                assert_int_equal(npg_capture_read(capture, &frame, i, &origin, pass == 2), NPG_OK);
                assert_int_equal(frame.point_count, i + 1);
                assert_int_equal(frame.index, i);
                npg_frame_clear(&frame);
                assert_true(npg_frame_store_used(capture->store).memory_bytes <= limit);
            }
        assert_int_equal(capture->reads, limited ? 4 + 2 + 2 : 4);
        close_capture(&capture);
    }
}

/* ---- standard input ---- */

static npg_status run_with_input(const char *text, const char *const (*options)[2])
{
    const char *path = in_folder(&folder, "stdin");
    write_text_file(path, text);
    int kept = dup(0), fd = open(path, O_RDONLY);
    dup2(fd, 0);
    close(fd);
    npg_status status = run(options);
    dup2(kept, 0);
    close(kept);
    return status;
}

#define HEAD                                                                                                 \
    "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "           \
    "z\nend_header\n"

static void frames_from_standard_input(void **state)
{
    (void)state;
    const char *text = HEAD "5 0 0\n" HEAD "6 0 0\n" HEAD "7 0 0\n" HEAD "8 0 0\n";
    assert_int_equal(expect_ok(run_with_input(text, OPTIONS({"input", "-"}))), NPG_OK);
    assert_string_equal(seen[0], "0/0:1@5 1/1:1@6 2/2:1@7 3/3:1@8");
    assert_string_equal(seen[1], seen[0]);
    assert_string_equal(seen[2], "1/1:1@6 2/2:1@7 3/3:1@8 0/0:1@5");
    assert_int_equal(facts_at_end.frame_count, 4);
    assert_int_equal(run_with_input(text, OPTIONS({"input", "-"}, {"frames", "1::2"})), NPG_OK);
    assert_string_equal(seen[2], "1/3:1@8 0/1:1@6");
    assert_int_equal(run_with_input(text, OPTIONS({"input", "-"}, {"frames", "-1:"})), NPG_USAGE);
    assert_int_equal(run_with_input("", OPTIONS({"input", "-"})), NPG_BAD_INPUT);
    assert_non_null(strstr(failure, "standard input: no frame came"));
    assert_int_equal(run_with_input(HEAD "5 0 0\n" HEAD, OPTIONS({"input", "-"})), NPG_BAD_INPUT);
    assert_non_null(strstr(failure, "frame 1: standard input: "));
}

/* ---- pushed frames ---- */

static npg_status push_numbers(const int64_t *numbers, const char *const (*settings)[2])
{
    npg_options *options = NULL;
    npg_run *pushed = NULL;
    memset(seen, 0, sizeof seen);
    npg_status status = npg_options_open_chain(&options, chain);
    for (; !status && (*settings)[0]; settings++)
        status = npg_options_set(options, (*settings)[0], (*settings)[1]);
    if (!status) status = npg_run_open_chain(&pushed, options, NULL, chain);
    for (; !status && *numbers >= 0; numbers++) {
        const double points[] = {(double)*numbers, 0, 0, 1, 1, 1};
        npg_cloud cloud = {
            .struct_size = sizeof cloud, .number = *numbers, .point_count = 2, .points = points};
        status = npg_run_push(pushed, &cloud);
    }
    if (!status) status = npg_run_finish(pushed);
    if (pushed) status = npg_run_wait(pushed);
    snprintf(failure, sizeof failure, "%s", status < 0 ? npg_error_text() : "");
    npg_run_close(&pushed);
    npg_options_close(&options);
    return status;
}

#define PUSH(numbers, ...) push_numbers((const int64_t[]){numbers, -1}, OPTIONS(__VA_ARGS__))
#define LIST(...)          __VA_ARGS__

static void frames_that_are_pushed(void **state)
{
    (void)state;
    wanted_plan = (npg_plan){.key = 0, .window = 100};
    assert_int_equal(expect_ok(PUSH(LIST(3, 4, 8), {"input", ""})), NPG_OK);
    assert_string_equal(seen[2], "0/3:2@3 1/4:2@4 2/8:2@8");
    assert_int_equal(facts_at_end.frame_count, 3);
    assert_int_equal(PUSH(LIST(3, 4, 7), {"missing", "skip"}), NPG_PARTIAL);
    assert_string_equal(seen[2], "0/3:2@3 1/4:2@4 2/5s:0@0 3/6s:0@0 4/7:2@7");
    assert_int_equal(PUSH(LIST(3, 4, 7), {"missing", "hold"}), NPG_OK);
    assert_string_equal(seen[2], "0/3:2@3 1/4:2@4 2/5h:2@4 3/6h:2@4 4/7:2@7");
    assert_int_equal(PUSH(LIST(3), {"frames", "0:2"}), NPG_USAGE);
    assert_int_equal(PUSH(LIST(3, 400000), {"missing", "skip"}), NPG_BAD_INPUT);
    assert_non_null(strstr(failure, "frame 400000 comes 399997 numbers after"));
}

/* ---- memory ---- */

static void no_memory_at_any_point(void **state)
{
    (void)state;
    npg_status status = NPG_MEMORY;
    uint64_t n = 0;
    const char *path = CAPTURE("memory", 1, 2, 4);
    for (; status; n++) {
        npg_capture *capture;
        npg_origin origin = {0};
        npg_memory_fail_at(n + 1, false);
        status = open_capture(&capture, path, NPG_MISSING_HOLD, false, 1 << 20);
        for (int64_t i = 0; !status && i < 4; i++) {
            npg_frame frame;
            status = npg_capture_read(capture, &frame, i, &origin, false);
            npg_frame_clear(&frame);
        }
        npg_memory_fail_at(0, false);
        if (status) assert_int_equal(status, NPG_MEMORY);
        close_capture(&capture);
        assert_int_equal(npg_memory_used(), 0);
    }
    assert_true(n > 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(three_passes_each_in_its_order),
        cmocka_unit_test(gaps_are_refused_skipped_held_or_ignored),
        cmocka_unit_test(a_selection_makes_its_own_capture),
        cmocka_unit_test(a_bad_file_stops_or_is_skipped),
        cmocka_unit_test(nothing_to_read),
        cmocka_unit_test(a_file_that_is_exchanged_is_refused_one_that_is_touched_is_not),
        cmocka_unit_test(few_files_are_parsed_twice),
        cmocka_unit_test(frames_from_standard_input),
        cmocka_unit_test(frames_that_are_pushed),
        cmocka_unit_test(no_memory_at_any_point)};
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
