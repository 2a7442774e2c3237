/* Live runs through the public push and pull: bounded memory however long the source, a consumer that stalls
 * stalls the producer and nothing else, results as windows close. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <time.h>

#include "pipeline/plan.h"
#include "pipeline/run_internal.h"
#include "tests/support/test_chain.h"

extern const npg_stage npg_stage_ingest, npg_stage_keyframe;

enum { LOOK_AHEAD = 20, WINDOW = 8, OVERLAP = 3, FRAMES = 150, POINTS = 12 };

/* ---- a stage that solves windows as they are complete: each frame's first points are its vertices ---- */

typedef struct windower_state {
    npg_frame held[LOOK_AHEAD + 2 * WINDOW];
    size_t count, count_max;
    int64_t window_at, total;
} windower_state;

static atomic_size_t held_max;

static npg_frame *held_at(windower_state *s, int64_t index)
{
    for (size_t i = 0; i < s->count; i++)
        if (s->held[i].index == index) return &s->held[i];
    return NULL;
}

static npg_status open_reference(npg_facts *facts)
{
    NPG_TRY(npg_mesh_open(&facts->reference, 3, 1));
    for (uint32_t i = 0; i < 3; i++) facts->reference->faces[i] = i;
    return NPG_OK;
}

static npg_status solve(npg_worker *worker, const npg_window *window)
{
    windower_state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    for (int64_t t = window->first; t <= window->last; t++) {
        npg_frame *frame = held_at(s, t);
        if (frame->vert_unit) continue;
        NPG_TRY(npg_alloc_array(&frame->vert_unit, NPG_FOR_FRAMES, 3, 3 * sizeof(float)));
        frame->vert_count = 3;
        npg_box_local_to_unit(&facts->box, frame->vert_unit, frame->pos_local, 3);
        frame->fields |= NPG_FIELD_VERTICES;
    }
    return NPG_OK;
}

static npg_status pass_on(npg_worker *worker, int64_t solved_window)
{
    windower_state *s = npg_worker_state(worker);
    const npg_plan *plan = &npg_worker_facts(worker)->plan;
    for (size_t i = 0; i < s->count;) {
        npg_frame *frame = &s->held[i];
        bool is_needed = npg_plan_is_needed_after(plan, frame->index, solved_window, s->total);
        if (!frame->vert_unit || is_needed) {
            i++;
            continue;
        }
        npg_chunk *chunk;
        NPG_TRY(npg_chunk_open(&chunk, 1));
        npg_chunk_add(chunk, frame);
        memmove(frame, frame + 1, (--s->count - i) * sizeof *frame);
        memset(&s->held[s->count], 0, sizeof *frame);
        npg_status status = npg_worker_push(worker, &chunk);
        npg_chunk_close(&chunk);
        NPG_TRY(status);
    }
    return NPG_OK;
}

static npg_status solve_complete(npg_worker *worker)
{
    windower_state *s = npg_worker_state(worker);
    const npg_plan *plan = &npg_worker_facts(worker)->plan;
    while (s->window_at < npg_plan_window_count(plan, s->total)) {
        npg_window window = npg_plan_window(plan, s->window_at, s->total);
        for (int64_t t = window.first; t <= window.last; t++)
            if (!held_at(s, t)) return NPG_OK;
        NPG_TRY(solve(worker, &window));
        NPG_TRY(pass_on(worker, s->window_at++));
    }
    return NPG_OK;
}

static npg_status windower_process(npg_worker *worker, npg_chunk **chunk)
{
    windower_state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    s->total = -1;
    if (!facts->reference) NPG_TRY(open_reference(test_facts(worker)));
    for (size_t i = 0; i < npg_chunk_count(*chunk); i++) {
        if (s->count == sizeof s->held / sizeof *s->held)
            return npg_error(NPG_FAILED, "more frames than two windows and a look-ahead");
        s->held[s->count++] = *npg_chunk_frame(*chunk, i);
        *npg_chunk_frame(*chunk, i) = (npg_frame){0};
    }
    if (s->count > atomic_load(&held_max)) atomic_store(&held_max, s->count);
    npg_chunk_close(chunk);
    return solve_complete(worker);
}

static npg_status windower_flush(npg_worker *worker)
{
    windower_state *s = npg_worker_state(worker);
    s->total = npg_worker_facts(worker)->frame_count;
    NPG_TRY(solve_complete(worker));
    NPG_TRY(pass_on(worker, s->window_at - 1));
    return s->count ? npg_error(NPG_FAILED, "%zu frames are left over", s->count) : NPG_OK;
}

static void windower_uninit(npg_worker *worker)
{
    windower_state *s = npg_worker_state(worker);
    for (size_t i = 0; i < s->count; i++) npg_frame_clear(&s->held[i]);
}

static const npg_stage windower = {.name = "windower",
                                   .help = "",
                                   .state_size = sizeof(windower_state),
                                   .passes = NPG_PASS_SOLVE,
                                   .needs = NPG_FIELD_KEY,
                                   .gives = NPG_FIELD_VERTICES,
                                   .process = windower_process,
                                   .flush = windower_flush,
                                   .uninit = windower_uninit};
static const npg_stage *const live_chain[] = {&npg_stage_ingest, &npg_stage_keyframe, &windower, &test_sink,
                                              NULL};

/* ---- a producer ---- */

typedef struct producer {
    npg_run *run;
    int64_t frame_count;
    double leap; /* added to x of the last frame */
    atomic_llong pushed;
    npg_status status;
} producer;

static npg_status push_frame(npg_run *run, int64_t number, double leap)
{
    double points[3 * POINTS];
    for (int i = 0; i < 3 * POINTS; i++)
        points[i] = sin(7.0 * i) + 0.001 * (double)number + (i % 3 ? 0 : leap);
    npg_cloud cloud = {sizeof cloud, number, POINTS, points, NULL, NULL};
    return npg_run_push(run, &cloud);
}

static void *produce(void *argument)
{
    producer *p = argument;
    for (int64_t i = 0; i < p->frame_count && !p->status; i++) {
        p->status = push_frame(p->run, i, i == p->frame_count - 1 ? p->leap : 0);
        if (!p->status) atomic_fetch_add(&p->pushed, 1);
    }
    if (!p->status) p->status = npg_run_finish(p->run);
    return NULL;
}

static npg_run *open_run(int64_t ring, const npg_hooks *hooks)
{
    char ring_text[16], number[16];
    npg_options *options;
    npg_run *run;
    snprintf(ring_text, sizeof ring_text, "%d", (int)ring);
    assert_int_equal(npg_options_open_chain(&options, live_chain), NPG_OK);
    npg_options_set(options, "pull", "yes");
    npg_options_set(options, "ring", ring_text);
    snprintf(number, sizeof number, "%d", LOOK_AHEAD);
    npg_options_set(options, "look-ahead", number);
    snprintf(number, sizeof number, "%d", WINDOW);
    npg_options_set(options, "window", number);
    snprintf(number, sizeof number, "%d", OVERLAP);
    npg_options_set(options, "overlap", number);
    assert_int_equal(npg_run_open_chain(&run, options, hooks, live_chain), NPG_OK);
    npg_options_close(&options);
    return run;
}

static void sleep_ms(long ms)
{
    nanosleep(&(struct timespec){ms / 1000, ms % 1000 * 1000000}, NULL);
}

/* Frames that may be between push and pull: the look-ahead and the one behind it, two windows, five rings of
 * chunks of one frame, and one in the hands of each of six threads. */
static int64_t most_under_way(int64_t ring)
{
    return LOOK_AHEAD + 1 + 2 * WINDOW + 5 * ring + 6;
}

/* Pull one; each frame may come once.  false at the end. */
static bool pull_one(npg_run *run, double *first_x, bool *came)
{
    npg_result *result;
    npg_status status = npg_run_pull(run, &result);
    if (status == NPG_END) return false;
    assert_int_equal(status, NPG_OK);
    assert_true(result->index >= 0 && result->index < FRAMES && !came[result->index]);
    came[result->index] = true;
    first_x[result->index] = result->vertices[0];
    npg_result_close(&result);
    return true;
}

/* ---- tests ---- */

static void run_with_stalls(int64_t ring, double *first_x)
{
    bool came[FRAMES] = {false};
    producer p = {.run = open_run(ring, NULL), .frame_count = FRAMES};
    pthread_t thread;
    int64_t pulled = 0;
    assert_int_equal(pthread_create(&thread, NULL, produce, &p), 0);
    for (;;) {
        if (pulled % 40 == 0) sleep_ms(30); /* long enough for everything to fill up, on most machines */
        assert_true((int64_t)atomic_load(&p.pushed) - pulled <= most_under_way(ring));
        if (!pull_one(p.run, first_x, came)) break;
        pulled++;
    }
    pthread_join(thread, NULL);
    assert_int_equal(p.status, NPG_OK);
    assert_int_equal(pulled, FRAMES);
    assert_int_equal(npg_run_wait(p.run), NPG_OK);
    npg_run_close(&p.run);
}

static void a_stalled_consumer_stalls_the_producer(void **state)
{
    (void)state;
    static const int64_t rings[] = {1, 2, 8};
    double first[FRAMES], x[FRAMES];
    size_t before = npg_memory_used();
    for (size_t i = 0; i < 3; i++) {
        atomic_store(&held_max, 0);
        run_with_stalls(rings[i], i ? x : first);
        if (i) assert_memory_equal(x, first, sizeof first);
        assert_true(atomic_load(&held_max) <= 2 * WINDOW);
        assert_int_equal(npg_memory_used(), before);
    }
}

static void a_stalled_run_does_not_hinder_another(void **state)
{
    (void)state;
    double x[FRAMES];
    bool came[FRAMES] = {false};
    pthread_t thread;
    producer stalled = {.run = open_run(1, NULL), .frame_count = FRAMES};
    assert_int_equal(pthread_create(&thread, NULL, produce, &stalled), 0);
    run_with_stalls(2, x); /* from beginning to end while nobody pulls from the first */
    assert_true((int64_t)atomic_load(&stalled.pushed) <= most_under_way(1));
    while (pull_one(stalled.run, x, came)) continue;
    pthread_join(thread, NULL);
    assert_int_equal(npg_run_wait(stalled.run), NPG_OK);
    npg_run_close(&stalled.run);
}

static void a_stalled_run_can_be_stopped(void **state)
{
    (void)state;
    static const int64_t rings[] = {1, 2, 8};
    size_t before = npg_memory_used();
    for (size_t i = 0; i < 3; i++) {
        pthread_t thread;
        producer p = {.run = open_run(rings[i], NULL), .frame_count = FRAMES};
        assert_int_equal(pthread_create(&thread, NULL, produce, &p), 0);
        while (atomic_load(&p.pushed) <= LOOK_AHEAD) sleep_ms(1);
        npg_run_stop(p.run);
        pthread_join(thread, NULL); /* the blocked push came back */
        assert_int_equal(p.status, NPG_STOPPED);
        assert_int_equal(npg_run_wait(p.run), NPG_STOPPED);
        npg_run_close(&p.run);
        assert_int_equal(npg_memory_used(), before);
    }
}

/* Nothing more is pushed while these are pulled: they were finished with the frames that had come. */
static void finished_frames_come_before_the_next_window_is_read(void **state)
{
    (void)state;
    double x[FRAMES];
    bool came[FRAMES] = {false};
    npg_run *run = open_run(1, NULL);
    int64_t pushed = 0;
    for (; pushed < LOOK_AHEAD + 1; pushed++) assert_int_equal(push_frame(run, pushed, 0), NPG_OK);
    assert_true(pushed < LOOK_AHEAD + WINDOW + OVERLAP);
    for (int i = 0; i < WINDOW - 2 * OVERLAP; i++) assert_true(pull_one(run, x, came));
    npg_run_close(&run);
}

static atomic_int outside_count, last_words;

static void count_outside(void *user, const npg_log_record *record)
{
    (void)user;
    if (record->level != NPG_LOG_WARNING || !strstr(record->message, "the box that the look-ahead gave"))
        return;
    if (strstr(record->message, "this one by most")) {
        assert_int_equal(record->frame, FRAMES - 1);
        atomic_fetch_add(&last_words, 1);
    } else {
        assert_non_null(strstr(record->message, "% of its longest side"));
        atomic_fetch_add(&outside_count, 1);
    }
}

static void frames_that_leave_the_box_are_said(void **state)
{
    (void)state;
    double x[FRAMES];
    bool came[FRAMES] = {false};
    const npg_hooks hooks = {.struct_size = sizeof hooks, .log = count_outside};
    pthread_t thread;
    producer p = {.run = open_run(2, &hooks), .frame_count = FRAMES, .leap = 5};
    assert_int_equal(pthread_create(&thread, NULL, produce, &p), 0);
    while (pull_one(p.run, x, came)) continue;
    pthread_join(thread, NULL);
    assert_int_equal(npg_run_wait(p.run), NPG_OK);
    assert_int_equal(atomic_load(&outside_count), 1);
    assert_int_equal(atomic_load(&last_words), 1);
    assert_true(fabs(x[FRAMES - 1] - x[FRAMES - 2] - 5.001) < 1e-4); /* not clamped */
    npg_run_close(&p.run);
}

/* Everything fits into the rings and the look-ahead, so that one thread can push first and pull then. */
static npg_status push_then_pull(uint64_t fail_at)
{
    npg_run *run = open_run(8, NULL);
    npg_result *result;
    npg_status status = NPG_OK;
    npg_memory_fail_at(fail_at, false);
    for (int64_t i = 0; i < LOOK_AHEAD + WINDOW && !status; i++) status = push_frame(run, i, 0);
    if (!status) status = npg_run_finish(run);
    while (!status && (status = npg_run_pull(run, &result)) == NPG_OK) npg_result_close(&result);
    npg_memory_fail_at(0, false);
    npg_status push_status = status;
    npg_run_stop(run); /* after a push that failed by itself the run would wait for ever */
    status = npg_run_wait(run);
    npg_run_close(&run);
    return push_status < 0 ? push_status : status;
}

static void no_memory_is_said(void **state)
{
    (void)state;
    size_t before = npg_memory_used();
    npg_status status = NPG_MEMORY;
    for (uint64_t n = 1; n < 2000 && status != NPG_OK; n += 5) {
        status = push_then_pull(n);
        assert_true(status == NPG_OK || status == NPG_MEMORY);
        assert_int_equal(npg_memory_used(), before);
    }
    assert_int_equal(status, NPG_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_stalled_consumer_stalls_the_producer),
        cmocka_unit_test(a_stalled_run_does_not_hinder_another),
        cmocka_unit_test(a_stalled_run_can_be_stopped),
        cmocka_unit_test(finished_frames_come_before_the_next_window_is_read),
        cmocka_unit_test(frames_that_leave_the_box_are_said),
        cmocka_unit_test(no_memory_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
