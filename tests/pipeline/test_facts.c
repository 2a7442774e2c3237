/* What stages share through the run: facts of their own kinds, waits that a stop ends, stages left out. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "pipeline/options.h"
#include "tests/support/test_chain.h"

static int released;

static void release_number(void *value)
{
    released++;
    npg_release(&value);
}

static const npg_fact_kind number = {"number", "writer", release_number};
static const npg_fact_kind foreign = {"foreign", "somebody else", release_number};

static npg_status make_number(int **value)
{
    NPG_TRY(npg_alloc(value, NPG_FOR_RUN, sizeof **value));
    **value = 7;
    return NPG_OK;
}

/* ---- a stage that writes facts, one that reads them, one that sits out ---- */

static struct {
    bool writes_plan, writes_twice, writes_again, writes_foreign, takes, waits;
    int seen, after_taking;
    bool had_pose;
    int sat_frames;
    npg_latch *latch;
} scene;

/* Twice, with the first one taken in between; the second is 8. */
static npg_status write_again(npg_worker *worker)
{
    int *value, *taken;
    NPG_TRY(make_number(&value));
    NPG_TRY(npg_worker_publish(worker, &number, value));
    taken = npg_worker_take_fact(worker, &number);
    if (taken != value) return npg_error(NPG_FAILED, "another value was taken");
    npg_release(&taken);
    NPG_TRY(make_number(&value));
    ++*value;
    return npg_worker_publish(worker, &number, value);
}

static npg_status write_fact(npg_worker *worker, npg_chunk **chunk)
{
    int *value;
    (void)chunk;
    if (scene.writes_plan) {
        *npg_own(worker, window_asked) = 7;
        scene.seen = (int)npg_worker_facts(worker)->window_asked;
        return NPG_OK;
    }
    if (npg_worker_fact(worker, &number) && !scene.writes_twice) return NPG_OK;
    if (scene.writes_again) return write_again(worker);
    NPG_TRY(make_number(&value));
    return npg_worker_publish(worker, scene.writes_foreign ? &foreign : &number, value);
}

static npg_status read_fact(npg_worker *worker, npg_chunk **chunk)
{
    (void)chunk;
    const int *value = npg_worker_fact(worker, &number);
    scene.seen = value ? *value : -1;
    scene.had_pose = npg_worker_has_field(worker, NPG_FIELD_POSE);
    if (scene.takes) {
        void *mine = npg_worker_take_fact(worker, &number);
        npg_release(&mine);
        scene.after_taking = npg_worker_fact(worker, &number) != NULL;
        scene.takes = false;
    }
    if (!scene.waits) return NPG_OK;
    NPG_TRY(npg_worker_open_latch(worker, &scene.latch, 0));
    scene.waits = false;
    return npg_latch_wait(scene.latch, 1); /* nobody will raise it */
}

static npg_status sit(npg_worker *worker, npg_chunk **chunk)
{
    (void)worker;
    scene.sat_frames += (int)npg_chunk_count(*chunk);
    return NPG_OK;
}

typedef struct sitter_state {
    bool is_on;
} sitter_state;

static bool takes_part(const npg_worker *worker)
{
    const sitter_state *s = npg_worker_state(worker);
    return s->is_on;
}

static const npg_option sitter_options[] = {
    {.name = "sitter", .help = "", .type = NPG_OPTION_FLAG, .default_text = "no"}, {0}};

static const npg_stage writer = {
    .name = "writer", .help = "", .passes = NPG_PASS_SOLVE, .process = write_fact};
static const npg_stage sitter = {.name = "sitter",
                                 .help = "",
                                 .options = sitter_options,
                                 .state_size = sizeof(sitter_state),
                                 .passes = NPG_PASS_SOLVE,
                                 .gives = NPG_FIELD_POSE,
                                 .takes_part = takes_part,
                                 .process = sit};
static const npg_stage reader = {
    .name = "reader", .help = "", .passes = NPG_PASS_SOLVE, .process = read_fact};
static const npg_stage *const chain[] = {&test_source, &writer, &sitter, &reader, &test_sink, NULL};

static const char *const plain[][2] = {{"input", "any"}, {"output", "any"}, {"chunk", "1"}, {NULL, NULL}};
static const char *const sitting[][2] = {
    {"input", "any"}, {"output", "any"}, {"chunk", "1"}, {"sitter", "yes"}, {NULL, NULL}};

static int set_up(void **state)
{
    (void)state;
    memset(&scene, 0, sizeof scene);
    released = 0;
    script = (test_script){.frame_count = 3};
    return 0;
}

/* ---- tests ---- */

static void a_fact_is_written_once_and_released_with_the_run(void **state)
{
    (void)state;
    assert_int_equal(run_chain(chain, plain, NULL), NPG_OK);
    assert_int_equal(scene.seen, 7);
    assert_int_equal(released, 1);
    assert_int_equal(npg_memory_used(), 0);
}

static void a_second_word_is_refused(void **state)
{
    char text[1024];
    (void)state;
    scene.writes_twice = true;
    assert_int_equal(run_chain(chain, plain, text), NPG_USAGE);
    assert_non_null(strstr(text, "number"));
    assert_int_equal(npg_memory_used(), 0);
}

static void nobody_writes_for_another(void **state)
{
    char text[1024];
    (void)state;
    scene.writes_foreign = true;
    assert_int_equal(run_chain(chain, plain, text), NPG_USAGE);
    assert_non_null(strstr(text, "foreign"));
    assert_int_equal(npg_memory_used(), 0);
}

static void a_fact_of_the_run_is_its_owners(void **state)
{
    static const npg_stage keyframe = {
        .name = "keyframe", .help = "", .passes = NPG_PASS_SOLVE, .process = write_fact};
    const npg_stage *const owner[] = {&test_source, &keyframe, &test_sink, NULL};
    const npg_stage *const other[] = {&test_source, &writer, &test_sink, NULL};
    char text[1024];
    (void)state;
    scene.writes_plan = true;
    assert_int_equal(run_chain(owner, plain, NULL), NPG_OK);
    assert_int_equal(scene.seen, 7);
    assert_int_equal(run_chain(other, plain, text), NPG_USAGE);
    assert_string_equal(text, "writer: the fact window_asked is not stage writer's to write");
    assert_int_equal(scene.seen, 0);
    assert_int_equal(npg_memory_used(), 0);
}

static void what_was_taken_is_gone(void **state)
{
    (void)state;
    scene.takes = true;
    script.frame_count = 1;
    assert_int_equal(run_chain(chain, plain, NULL), NPG_OK);
    assert_int_equal(scene.after_taking, 0);
    assert_int_equal(released, 0); /* by who took it */
    assert_int_equal(npg_memory_used(), 0);
}

static void what_was_taken_can_be_written_again(void **state)
{
    (void)state;
    scene.writes_again = true;
    assert_int_equal(run_chain(chain, plain, NULL), NPG_OK);
    assert_int_equal(scene.seen, 8);
    assert_int_equal(released, 1); /* the second one, with the run */
    assert_int_equal(npg_memory_used(), 0);
}

static void what_was_written_again_is_not_written_a_third_time(void **state)
{
    char text[1024];
    (void)state;
    scene.writes_again = scene.writes_twice = true;
    assert_int_equal(run_chain(chain, plain, text), NPG_USAGE);
    assert_non_null(strstr(text, "number"));
    assert_int_equal(npg_memory_used(), 0);
}

static void a_stage_may_sit_out(void **state)
{
    (void)state;
    assert_int_equal(run_chain(chain, plain, NULL), NPG_OK);
    assert_int_equal(scene.sat_frames, 0);
    assert_false(scene.had_pose);
    set_up(NULL);
    assert_int_equal(run_chain(chain, sitting, NULL), NPG_OK);
    assert_int_equal(scene.sat_frames, 3);
    assert_true(scene.had_pose);
}

static void a_stop_ends_a_wait(void **state)
{
    npg_options *options;
    npg_run *run;
    (void)state;
    scene.waits = true;
    assert_int_equal(npg_options_open_chain(&options, chain), NPG_OK);
    npg_options_set(options, "input", "any");
    npg_options_set(options, "output", "any");
    assert_int_equal(npg_run_open_chain(&run, options, NULL, chain), NPG_OK);
    npg_run_stop(run);
    assert_int_equal(npg_run_wait(run), NPG_STOPPED);
    npg_run_close(&run);
    npg_options_close(&options);
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_fact_is_written_once_and_released_with_the_run, set_up),
        cmocka_unit_test_setup(a_second_word_is_refused, set_up),
        cmocka_unit_test_setup(nobody_writes_for_another, set_up),
        cmocka_unit_test_setup(a_fact_of_the_run_is_its_owners, set_up),
        cmocka_unit_test_setup(what_was_taken_is_gone, set_up),
        cmocka_unit_test_setup(what_was_taken_can_be_written_again, set_up),
        cmocka_unit_test_setup(what_was_written_again_is_not_written_a_third_time, set_up),
        cmocka_unit_test_setup(a_stage_may_sit_out, set_up),
        cmocka_unit_test_setup(a_stop_ends_a_wait, set_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
