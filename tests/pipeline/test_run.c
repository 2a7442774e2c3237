/* Run: passes, push and pull, failures of every stage in every place, stop and close at work, no memory. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

#include <sched.h>

#include "tests/support/test_chain.h"

/* ---- a stage that counts what happens to it and fails where it is told ---- */

typedef enum place { NOWHERE, IN_INIT, IN_PROCESS, IN_FLUSH, IN_CONCLUDE } place;

typedef struct probe {
    atomic_int inits, frames, flushes, uninits, concludes;
    place fails;
    npg_pass in_pass;
} probe;

static probe probes[3];

static npg_status fail_here(const npg_worker *worker, int which, place here)
{
    if (probes[which].fails != here) return NPG_OK;
    if (here != IN_CONCLUDE && npg_worker_pass(worker) != probes[which].in_pass) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "probe %d fails in place %d", which, here);
}

static npg_status probe_process(npg_worker *worker, npg_chunk **chunk, int which)
{
    atomic_fetch_add(&probes[which].frames, (int)npg_chunk_count(*chunk));
    return fail_here(worker, which, IN_PROCESS);
}

#define PROBE(i)                                                                                             \
    static npg_status init_##i(npg_worker *worker)                                                           \
    {                                                                                                        \
        atomic_fetch_add(&probes[i].inits, 1);                                                               \
        return fail_here(worker, i, IN_INIT);                                                                \
    }                                                                                                        \
    static npg_status process_##i(npg_worker *worker, npg_chunk **chunk)                                     \
    {                                                                                                        \
        return probe_process(worker, chunk, i);                                                              \
    }                                                                                                        \
    static npg_status flush_##i(npg_worker *worker)                                                          \
    {                                                                                                        \
        atomic_fetch_add(&probes[i].flushes, 1);                                                             \
        return fail_here(worker, i, IN_FLUSH);                                                               \
    }                                                                                                        \
    static void uninit_##i(npg_worker *worker)                                                               \
    {                                                                                                        \
        (void)worker;                                                                                        \
        atomic_fetch_add(&probes[i].uninits, 1);                                                             \
    }                                                                                                        \
    static npg_status conclude_##i(npg_worker *worker)                                                       \
    {                                                                                                        \
        atomic_fetch_add(&probes[i].concludes, 1);                                                           \
        return fail_here(worker, i, IN_CONCLUDE);                                                            \
    }                                                                                                        \
    static const npg_stage probe_##i = {.name = "probe" #i,                                                  \
                                        .help = "",                                                          \
                                        .state_size = 16,                                                    \
                                        .passes = NPG_PASS_MEASURE | NPG_PASS_SOLVE,                         \
                                        .init = init_##i,                                                    \
                                        .process = process_##i,                                              \
                                        .flush = flush_##i,                                                  \
                                        .uninit = uninit_##i,                                                \
                                        .conclude = conclude_##i};
PROBE(0)
PROBE(1)
PROBE(2)

static const npg_stage *const probe_chain[] = {&test_source, &probe_0, &probe_1, &probe_2, &test_sink, NULL};

static const char *const from_files[][2] = {
    {"input", "any"}, {"output", "any"}, {"chunk", "2"}, {NULL, NULL}};

static int set_up(void **state)
{
    (void)state;
    memset(probes, 0, sizeof probes);
    script = (test_script){.frame_count = 7};
    return 0;
}

/* ---- runs over files ---- */

static npg_status count_frame(npg_worker *worker, npg_frame *frame, void *user)
{
    int64_t *next = user;
    (void)worker;
    return frame->index == (*next)++ ? NPG_OK : npg_error(NPG_FAILED, "out of order");
}

static void a_run_goes_through_its_passes(void **state)
{
    (void)state;
    int64_t seen = 0;
    script.see = count_frame;
    script.user = &seen;
    size_t before = npg_memory_used();
    assert_int_equal(run_chain(probe_chain, from_files, NULL), NPG_OK);
    assert_int_equal(seen, 7);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(probes[i].inits, 2);
        assert_int_equal(probes[i].frames, 14);
        assert_int_equal(probes[i].flushes, 2);
        assert_int_equal(probes[i].uninits, 2);
        assert_int_equal(probes[i].concludes, 1);
    }
    assert_int_equal(npg_memory_used(), before);
}

static void the_first_failure_is_the_runs(void **state)
{
    const npg_pass passes[] = {NPG_PASS_MEASURE, NPG_PASS_SOLVE};
    char text[1024], expected[64];
    size_t before = npg_memory_used();
    for (int which = 0; which < 3; which++)
        for (place where = IN_INIT; where <= IN_CONCLUDE; where++)
            for (int p = 0; p < 2; p++) {
                set_up(state);
                probes[which].fails = where;
                probes[which].in_pass = passes[p];
                assert_int_equal(run_chain(probe_chain, from_files, text), NPG_BAD_INPUT);
                snprintf(expected, sizeof expected, "probe %d fails in place %d", which, where);
                assert_non_null(strstr(text, expected));
                assert_true(where == IN_CONCLUDE || !probes[which].concludes);
                assert_int_equal(probes[which].inits, probes[which].uninits);
                assert_int_equal(npg_memory_used(), before);
            }
}

static npg_status fail_at_three(npg_frame *frame, npg_facts *facts, int64_t index, void *user)
{
    (void)facts;
    (void)user;
    NPG_TRY(npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, 10, 12));
    return index == 3 ? npg_error(NPG_DEVICE, "frame 3 is cursed") : NPG_OK;
}

static void a_failing_source_ends_the_run(void **state)
{
    char text[1024];
    (void)state;
    size_t before = npg_memory_used();
    script.make = fail_at_three;
    assert_int_equal(run_chain(probe_chain, from_files, text), NPG_DEVICE);
    assert_string_equal(text, "source: frame 3 is cursed");
    assert_int_equal(npg_memory_used(), before);
}

static npg_status warn_of_frame(npg_worker *worker, npg_frame *frame, void *user)
{
    if (frame->index == 2) npg_worker_warn(worker, *(bool *)user, 2, "odd \xff byte");
    return NPG_OK;
}

static void a_partial_warning_makes_a_partial_run(void **state)
{
    (void)state;
    bool is_partial = false;
    script.see = warn_of_frame;
    script.user = &is_partial;
    assert_int_equal(run_chain(probe_chain, from_files, NULL), NPG_OK);
    is_partial = true;
    assert_int_equal(run_chain(probe_chain, from_files, NULL), NPG_PARTIAL);
}

static const npg_stage needy = {
    .name = "needy", .help = "", .passes = NPG_PASS_SOLVE, .needs = NPG_FIELD_FIGURES};
static const npg_stage idle = {.name = "idle", .help = "", .passes = NPG_PASS_SOLVE};
static const npg_stage *const broken_chain[] = {&test_source, &needy, NULL};
static const npg_stage *const idle_chain[] = {&test_source, &idle, NULL};

static npg_run *open_any(const npg_stage *const *chain, const npg_hooks *hooks)
{
    npg_options *options;
    npg_run *run;
    assert_int_equal(npg_options_open_chain(&options, chain), NPG_OK);
    npg_options_set(options, "input", "any");
    npg_options_set(options, "output", "any");
    assert_int_equal(npg_run_open_chain(&run, options, hooks, chain), NPG_OK);
    npg_options_close(&options);
    return run;
}

static void misuse_is_refused(void **state)
{
    char text[1024];
    npg_run *run = NULL;
    npg_result *result = NULL;
    npg_cloud cloud = {.struct_size = sizeof cloud};
    const char *const nowhere[][2] = {{"input", "any"}, {NULL, NULL}};
    (void)state;
    assert_int_equal(run_chain(broken_chain, from_files, text), NPG_USAGE);
    assert_non_null(strstr(text, "needy"));
    assert_int_equal(run_chain(idle_chain, from_files, text), NPG_USAGE);
    assert_non_null(strstr(text, "idle"));
    assert_int_equal(run_chain(probe_chain, nowhere, text), NPG_USAGE);
    assert_int_equal(npg_run_open(NULL, NULL, NULL), NPG_USAGE);
    assert_int_equal(npg_run_wait(NULL), NPG_USAGE);
    npg_run_close(NULL);
    npg_run_close(&run);
    npg_run_stop(NULL);
    run = open_any(probe_chain, NULL);
    assert_int_equal(npg_run_push(run, &cloud), NPG_USAGE);
    assert_int_equal(npg_run_finish(run), NPG_USAGE);
    assert_int_equal(npg_run_pull(run, &result), NPG_USAGE);
    npg_run_close(&run);
    assert_null(run);
}

/* ---- pushed frames, pulled results ---- */

/* Gives every frame vertices: its own points, and a reference of one face. */
static npg_status mesh_process(npg_worker *worker, npg_chunk **chunk)
{
    npg_facts *facts = test_facts(worker);
    npg_frame *frame = npg_chunk_frame(*chunk, 0);
    if (!facts->reference) {
        NPG_TRY(npg_mesh_open(&facts->reference, 3, 1));
        for (uint32_t i = 0; i < 3; i++) facts->reference->faces[i] = i;
        npg_bounds_add_points(&facts->bounds_local, frame->pos_local, frame->point_count);
        NPG_TRY(npg_frame_box_set(&facts->box, &facts->origin, &facts->bounds_local));
    }
    NPG_TRY(npg_alloc_array(&frame->vert_unit, NPG_FOR_FRAMES, 3, 3 * sizeof(float)));
    frame->vert_count = 3;
    npg_box_local_to_unit(&facts->box, frame->vert_unit, frame->pos_local, 3);
    frame->fields |= NPG_FIELD_VERTICES;
    return NPG_OK;
}

static const npg_stage mesher = {.name = "mesher",
                                 .help = "",
                                 .passes = NPG_PASS_SOLVE,
                                 .gives = NPG_FIELD_VERTICES,
                                 .process = mesh_process};
static const npg_stage *const live_chain[] = {&test_source, &mesher, &probe_0, NULL};

static npg_run *open_live(void)
{
    npg_options *options;
    npg_run *run;
    assert_int_equal(npg_options_open_chain(&options, live_chain), NPG_OK);
    assert_int_equal(npg_options_set(options, "pull", "yes"), NPG_OK);
    assert_int_equal(npg_run_open_chain(&run, options, NULL, live_chain), NPG_OK);
    npg_options_close(&options);
    return run;
}

static npg_status push_triangle(npg_run *run, int64_t number)
{
    const double at = 5e6 + 0.001 * (double)number;
    const double points[9] = {at, 0, 0, at + 1, 0, 0, at, 1, 0.5};
    const float normals[9] = {0, 0, 1, 0, 0, 1, 0, 0, 1};
    npg_cloud cloud = {sizeof cloud, number, 3, points, normals, NULL};
    return npg_run_push(run, &cloud);
}

static void *push_fifty(void *argument)
{
    npg_run *run = argument;
    for (int64_t i = 0; i < 50; i++)
        if (push_triangle(run, 10 * i)) return NULL;
    npg_run_finish(run);
    return run;
}

static void frames_go_in_and_come_out(void **state)
{
    (void)state;
    pthread_t pusher;
    void *pushed;
    size_t before = npg_memory_used();
    npg_run *run = open_live();
    assert_int_equal(pthread_create(&pusher, NULL, push_fifty, run), 0);
    for (int64_t i = 0; i < 50; i++) {
        npg_result *result;
        assert_int_equal(npg_run_pull(run, &result), NPG_OK);
        assert_int_equal(result->index, i);
        assert_int_equal(result->number, 10 * i);
        assert_int_equal(result->vertex_count, 3);
        assert_int_equal(result->faces[2], 2);
        assert_true(fabs(result->vertices[0] - 5e6 - 0.01 * (double)i) < 1e-6);
        assert_true(fabs(result->vertices[8] - 0.5) < 1e-6);
        npg_result_close(&result);
        assert_null(result);
    }
    npg_result *result;
    assert_int_equal(npg_run_pull(run, &result), NPG_END);
    assert_null(result);
    pthread_join(pusher, &pushed);
    assert_non_null(pushed);
    assert_int_equal(npg_run_wait(run), NPG_OK);
    assert_int_equal(npg_run_wait(run), NPG_OK);
    assert_int_equal(probes[0].concludes, 1);
    assert_int_equal(push_triangle(run, 1000), NPG_USAGE);
    npg_run_close(&run);
    assert_int_equal(npg_memory_used(), before);
}

static void numbers_must_grow(void **state)
{
    (void)state;
    npg_run *run = open_live();
    assert_int_equal(push_triangle(run, 5), NPG_OK);
    assert_int_equal(push_triangle(run, 5), NPG_USAGE);
    assert_int_equal(push_triangle(run, 4), NPG_USAGE);
    assert_int_equal(push_triangle(run, 6), NPG_OK);
    npg_run_close(&run);
}

static void a_failure_reaches_who_pushes_and_who_pulls(void **state)
{
    (void)state;
    pthread_t pusher;
    npg_result *result = NULL;
    npg_status status = NPG_OK;
    probes[0].fails = IN_PROCESS;
    probes[0].in_pass = NPG_PASS_SOLVE;
    npg_run *run = open_live();
    assert_int_equal(pthread_create(&pusher, NULL, push_fifty, run), 0);
    assert_int_equal(npg_run_pull(run, &result), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "probe0"));
    pthread_join(pusher, NULL);
    status = push_triangle(run, 100000);
    assert_int_equal(status, NPG_BAD_INPUT);
    assert_int_equal(npg_run_wait(run), NPG_BAD_INPUT);
    npg_run_close(&run);
}

/* ---- stop and close ---- */

static void *stop_soon(void *argument)
{
    npg_run_stop(argument);
    return NULL;
}

static void stop_wakes_a_run_that_waits_for_frames(void **state)
{
    (void)state;
    for (int i = 0; i < 30; i++) {
        set_up(state);
        pthread_t stopper;
        npg_result *result;
        npg_run *run = open_live();
        if (i % 2) assert_int_equal(push_triangle(run, 1), NPG_OK);
        assert_int_equal(pthread_create(&stopper, NULL, stop_soon, run), 0);
        npg_status status = npg_run_pull(run, &result);
        if (status == NPG_OK) {
            npg_result_close(&result);
            status = npg_run_pull(run, &result);
        }
        assert_int_equal(status, NPG_STOPPED);
        assert_int_equal(npg_run_wait(run), NPG_STOPPED);
        assert_int_equal(probes[0].concludes, 0);
        pthread_join(stopper, NULL);
        npg_run_close(&run);
    }
}

static void stop_is_seen_between_chunks(void **state)
{
    (void)state;
    script.frame_count = INT64_C(1) << 40; /* would never end by itself */
    for (int i = 0; i < 10; i++) {
        npg_run *run = open_any(probe_chain, NULL);
        while (atomic_load(&probes[2].frames) < 100 * (i + 1)) sched_yield();
        npg_run_stop(run);
        assert_int_equal(npg_run_wait(run), NPG_STOPPED);
        assert_int_equal(npg_status_exit_code(NPG_STOPPED), 75);
        npg_run_close(&run);
    }
}

static void close_at_any_moment_frees_everything(void **state)
{
    size_t before = npg_memory_used();
    for (int pushes = 0; pushes < 20; pushes++) {
        set_up(state);
        npg_result *result;
        npg_run *run = open_live();
        for (int i = 0; i < pushes % 4; i++) assert_int_equal(push_triangle(run, i), NPG_OK);
        if (pushes % 4 == 2) {
            assert_int_equal(npg_run_pull(run, &result), NPG_OK);
            npg_result_close(&result);
        }
        npg_run_close(&run);
        assert_int_equal(probes[0].concludes, 0); /* what is not whole must not be called done */
        assert_int_equal(npg_memory_used(), before);
    }
}

static void *wait_for_run(void *argument)
{
    return (void *)(intptr_t)npg_run_wait(argument);
}

static void several_threads_may_wait(void **state)
{
    (void)state;
    pthread_t waiters[4];
    npg_run *run = open_live();
    for (int i = 0; i < 4; i++) assert_int_equal(pthread_create(&waiters[i], NULL, wait_for_run, run), 0);
    npg_run_stop(run);
    for (int i = 0; i < 4; i++) {
        void *status;
        pthread_join(waiters[i], &status);
        assert_int_equal((intptr_t)status, NPG_STOPPED);
    }
    npg_run_close(&run);
}

/* ---- no memory ---- */

static npg_status make_points(npg_frame *frame, npg_facts *facts, int64_t index, void *user)
{
    (void)facts;
    (void)index;
    (void)user;
    frame->point_count = 5;
    NPG_TRY(npg_copy_text(&frame->path, "frame"));
    return npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, 5, 12);
}

static void every_allocation_may_fail(void **state)
{
    char text[1024];
    size_t before = npg_memory_used();
    npg_status status = NPG_MEMORY;
    uint64_t n = 1;
    for (; status != NPG_OK && n < 500; n++) {
        set_up(state);
        script.make = make_points;
        npg_memory_fail_at(n, n % 2);
        status = run_chain(probe_chain, from_files, text);
        npg_memory_fail_at(0, false);
        assert_true(status == NPG_MEMORY || status == NPG_OK);
        if (status) assert_non_null(strstr(text, "no memory"));
        assert_int_equal(npg_memory_used(), before);
    }
    assert_int_equal(status, NPG_OK);
    assert_true(n > 20); /* the sweep went through a run that really allocates */
}

static void every_allocation_of_a_live_run_may_fail(void **state)
{
    size_t before = npg_memory_used();
    bool is_whole = false;
    for (uint64_t n = 1; !is_whole && n < 500; n++) {
        set_up(state);
        npg_options *options;
        npg_run *run = NULL;
        npg_result *result = NULL;
        assert_int_equal(npg_options_open_chain(&options, live_chain), NPG_OK);
        npg_options_set(options, "pull", "yes");
        npg_memory_fail_at(n, false);
        npg_status status = npg_run_open_chain(&run, options, NULL, live_chain);
        if (!status) status = push_triangle(run, 1);
        if (!status) status = npg_run_pull(run, &result);
        is_whole = status == NPG_OK;
        npg_memory_fail_at(0, false);
        assert_true(status == NPG_MEMORY || is_whole);
        npg_result_close(&result);
        npg_run_close(&run);
        npg_options_close(&options);
        assert_int_equal(npg_memory_used(), before);
    }
    assert_true(is_whole);
}

/* ---- hooks ---- */

typedef struct heard {
    int logs, progresses;
    char last[128];
} heard;

static void hear_log(void *user, const npg_log_record *record)
{
    heard *h = user;
    h->logs++;
    snprintf(h->last, sizeof h->last, "%s:%s", record->stage, record->message);
}

static void hear_progress(void *user, const npg_progress *progress)
{
    heard *h = user;
    h->progresses += progress->share == 0.5 && !strcmp(progress->stage, "sink");
}

static npg_status speak(npg_worker *worker, npg_frame *frame, void *user)
{
    npg_progress progress = {.share = 0.5};
    (void)user;
    if (frame->index) return NPG_OK;
    npg_worker_progress(worker, &progress);
    npg_worker_log(worker, NPG_LOG_INFO, 0, "frame %d", 0);
    return NPG_OK;
}

static void hooks_hear_the_stages(void **state)
{
    (void)state;
    heard h = {0};
    npg_hooks hooks = {sizeof hooks, &h, hear_log, hear_progress};
    script.see = speak;
    npg_run *run = open_any(probe_chain, &hooks);
    assert_int_equal(npg_run_wait(run), NPG_OK);
    npg_run_close(&run);
    assert_int_equal(h.progresses, 1);
    assert_true(h.logs >= 2); /* the memory formula, and the frame */
    assert_string_equal(h.last, "sink:frame 0");
}

/* ---- the time left ---- */

static double expect_one(const npg_worker *worker, npg_pass pass)
{
    (void)worker;
    return pass == NPG_PASS_SOLVE;
}

static double expect_three(const npg_worker *worker, npg_pass pass)
{
    return 3 * expect_one(worker, pass);
}

static npg_status report_all(npg_worker *worker, npg_chunk **chunk)
{
    (void)chunk;
    npg_worker_step(worker, 1, 1, 1);
    return NPG_OK;
}

static npg_status report_half(npg_worker *worker, npg_chunk **chunk)
{
    (void)chunk;
    npg_worker_step(worker, 0.5, 1, 2);
    npg_worker_step(worker, 0.25, 1, 4); /* goes back */
    return NPG_OK;
}

static const npg_stage early = {
    .name = "early", .help = "", .passes = NPG_PASS_SOLVE, .process = report_all, .expects = expect_one};
static const npg_stage late = {
    .name = "late", .help = "", .passes = NPG_PASS_SOLVE, .process = report_half, .expects = expect_three};
static const npg_stage *const timed_chain[] = {&test_source, &early, &late, &test_sink, NULL};

static npg_status measure_one(npg_frame *frame, npg_facts *facts, int64_t index, void *user)
{
    (void)frame;
    (void)index;
    (void)user;
    facts->point_count_max = 1; /* the capture has been measured */
    return NPG_OK;
}

typedef struct timed {
    double shares[8], left_s[8];
    size_t count;
} timed;

static void hear_time(void *user, const npg_progress *progress)
{
    timed *t = user;
    if (t->count == 8) return;
    t->shares[t->count] = progress->share;
    t->left_s[t->count++] = progress->left_s;
}

static void the_share_counts_stages_by_what_they_expect(void **state)
{
    (void)state;
    const double shares[] = {0.25, 0.625, 0.625};
    timed t = {.count = 0};
    npg_hooks hooks = {sizeof hooks, &t, NULL, hear_time};
    script.frame_count = 1;
    script.make = measure_one;
    npg_run *run = open_any(timed_chain, &hooks);
    assert_int_equal(npg_run_wait(run), NPG_OK);
    npg_run_close(&run);
    assert_int_equal(t.count, 3);
    for (size_t i = 0; i < 3; i++) {
        assert_float_equal(t.shares[i], shares[i], 1e-9);
        assert_true(t.left_s[i] >= 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_run_goes_through_its_passes, set_up),
        cmocka_unit_test_setup(the_first_failure_is_the_runs, set_up),
        cmocka_unit_test_setup(a_failing_source_ends_the_run, set_up),
        cmocka_unit_test_setup(a_partial_warning_makes_a_partial_run, set_up),
        cmocka_unit_test_setup(misuse_is_refused, set_up),
        cmocka_unit_test_setup(frames_go_in_and_come_out, set_up),
        cmocka_unit_test_setup(numbers_must_grow, set_up),
        cmocka_unit_test_setup(a_failure_reaches_who_pushes_and_who_pulls, set_up),
        cmocka_unit_test_setup(stop_wakes_a_run_that_waits_for_frames, set_up),
        cmocka_unit_test_setup(stop_is_seen_between_chunks, set_up),
        cmocka_unit_test_setup(close_at_any_moment_frees_everything, set_up),
        cmocka_unit_test_setup(the_share_counts_stages_by_what_they_expect, set_up),
        cmocka_unit_test_setup(several_threads_may_wait, set_up),
        cmocka_unit_test_setup(every_allocation_may_fail, set_up),
        cmocka_unit_test_setup(every_allocation_of_a_live_run_may_fail, set_up),
        cmocka_unit_test_setup(hooks_hear_the_stages, set_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
