/* Choosing the keyframe, through the stages. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "geometry/geometry.h"
#include "keyframe/keyframe_internal.h"
#include "tests/support/legs.h"
#include "tests/support/test_chain.h"

extern const npg_stage npg_stage_outlier, npg_stage_keyframe, npg_stage_mesh;
static const npg_stage *const chain[] = {&test_source,    &npg_stage_outlier, &npg_stage_keyframe,
                                         &npg_stage_mesh, &test_sink,         NULL};

typedef struct seen {
    bool has_holes; /* told */
    int64_t key, reported_key;
    int64_t euler;
    npg_manifold manifold;
    size_t frames;
} seen;

static npg_status see(npg_worker *worker, npg_frame *frame, void *user)
{
    seen *s = user;
    const npg_facts *facts = npg_worker_facts(worker);
    s->frames++;
    s->key = facts->plan.key;
    const json_t *stages = json_object_get(npg_worker_run_report(worker), "stages");
    const json_t *key = json_object_get(json_object_get(stages, "keyframe"), "key");
    s->reported_key = (int64_t)json_integer_value(json_object_get(key, "index"));
    if (!frame->is_key) return NPG_OK;
    NPG_TRY(npg_mesh_manifold(&s->manifold, facts->reference));
    s->euler = (int64_t)facts->reference->vert_count - (int64_t)s->manifold.edge_count +
               (int64_t)facts->reference->face_count;
    return NPG_OK;
}

/* The feet overlap in the frames 3 to 6 of 10. */
static double feet_at(int64_t index)
{
    return index >= 3 && index <= 6 ? 0.1
           : index < 3              ? 0.1 + 0.13 * (double)(3 - index)
                                    : 0.1 + 0.13 * (double)(index - 6);
}

static void keep_point(npg_frame *frame, size_t to, size_t from)
{
    memmove(frame->pos_local + 3 * to, frame->pos_local + 3 * from, 3 * sizeof(float));
    memmove(frame->normals + 3 * to, frame->normals + 3 * from, 3 * sizeof(float));
}

/* A hole through the right shin. */
static void cut_leg(npg_frame *frame)
{
    size_t kept = 0;
    for (size_t i = 0; i < frame->point_count; i++) {
        const float *p = frame->pos_local + 3 * i;
        if (p[0] < 0 || p[1] < -0.4F || p[1] > 0) keep_point(frame, kept++, i);
    }
    frame->point_count = kept;
}

enum { WHOLE = 8 }; /* the only frame without a hole, where there are some */

static npg_status make(npg_frame *frame, npg_facts *facts, int64_t index, void *user)
{
    const seen *s = user;
    facts->origin.known = true;
    NPG_TRY(
        legs_frame(frame, s->has_holes ? 0.3 + 0.01 * (double)index : feet_at(index), 77 + (uint64_t)index));
    if (s->has_holes && index != WHOLE) cut_leg(frame);
    if (s->has_holes && index == WHOLE) frame->point_count /= 2; /* so that its score is the least */
    return NPG_OK;
}

static seen run(const char *choice, bool has_holes)
{
    seen s = {.has_holes = has_holes};
    char text[1024];
    const char *settings[][2] = {{"keyframe-choice", choice}, {"pull", "no"},    {"output", "unused"},
                                 {"input", "unused"},         {"faces", "6000"}, {NULL, NULL}};
    script = (test_script){.frame_count = 10, .make = make, .see = see, .user = &s};
    npg_status status = run_chain(chain, settings, text);
    if (status) print_message("%s\n", text);
    assert_int_equal(status, NPG_OK);
    assert_int_equal(s.frames, 10);
    assert_int_equal(s.reported_key, s.key); /* one decision, one figure */
    return s;
}

static void the_score_alone_takes_touching_feet(void **state)
{
    (void)state;
    seen s = run("paper", false);
    assert_in_range(s.key, 3, 6);
    assert_true(s.euler < 2);
}

static void a_frame_with_feet_apart_is_chosen(void **state)
{
    (void)state;
    seen s = run("judged", false);
    assert_true(s.key < 3 || s.key > 6);
    assert_int_equal(s.euler, 2);
    assert_int_equal(s.manifold.border_edges, 0);
}

static void a_frame_whose_leg_is_cut_off_is_not_chosen(void **state)
{
    (void)state;
    assert_int_not_equal(run("paper", true).key, WHOLE);
    seen s = run("judged", true);
    assert_int_equal(s.key, WHOLE);
    assert_int_equal(s.euler, 2); /* of one piece */
}

/* A candidate whose figures in three frames scatter by `scatter` around a mean. */
static npg_candidate judged(double mean, double scatter, size_t pieces)
{
    npg_candidate one = {.is_followed = true, .pieces = pieces, .judgement = {.mean = mean, .count = 3}};
    for (size_t i = 0; i < NPG_CHOICE_FRAMES; i++)
        one.judgement.of_frame[i] = i < 3 ? mean + scatter * ((double)i - 1) : (double)NAN;
    return one;
}

static void before_one_camera_the_frame_by_score_stays_but_for_chance(void **state)
{
    (void)state;
    const npg_candidate by_chance[] = {judged(0.17, 0.2, 3), judged(0.1, 0, 1), judged(0.12, 0, 1)};
    assert_int_equal(npg_candidates_best(by_chance, 3, 0, true), 0);
    assert_int_equal(npg_candidates_best(by_chance, 3, 0, false), 1); /* of a body: clearly better */
    const npg_candidate beyond[] = {judged(0.17, 0.001, 1), judged(0.1, 0, 2), judged(0.101, 0.01, 1)};
    assert_int_equal(npg_candidates_best(beyond, 3, 0, true), 1); /* in two: something stands before it */
    assert_int_equal(npg_candidates_best(beyond, 3, 0, false), 2);
    const npg_candidate fails[] = {{.is_followed = false}, judged(0.3, 0, 1)};
    assert_int_equal(npg_candidates_best(fails, 2, 0, true), 1);
    assert_int_equal(npg_candidates_best(fails, 1, 0, true), 0);
}

/* What Poisson made of it is not compared, but a frame that can't be followed is none. */
static void a_frame_that_hides_much_stays(void **state)
{
    (void)state;
    npg_candidate list[] = {judged(0.3, 0.001, 1), judged(0.1, 0, 1)};
    list[0].unseen_share = 0.004;
    assert_int_equal(npg_candidates_best(list, 2, 0, false), 1);
    list[0].unseen_share = 0.03;
    assert_int_equal(npg_candidates_best(list, 2, 0, false), 0);
    assert_int_equal(npg_candidates_best(list, 2, 0, true), 1); /* one camera: by its images */
    list[0].is_followed = false;
    assert_int_equal(npg_candidates_best(list, 2, 0, false), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_score_alone_takes_touching_feet),
        cmocka_unit_test(a_frame_with_feet_apart_is_chosen),
        cmocka_unit_test(a_frame_whose_leg_is_cut_off_is_not_chosen),
        cmocka_unit_test(a_frame_that_hides_much_stays),
        cmocka_unit_test(before_one_camera_the_frame_by_score_stays_but_for_chance),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
