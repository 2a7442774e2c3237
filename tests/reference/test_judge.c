/* Judge: held-out points tell a surface that fits from one that does not, and hidden surface is not asked. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "pipeline/random.h"
#include "reference/reference.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/image_space.h"

enum { FRAMES = 7, POINTS = 1500 };
#define STEP 0.02f /* along x, from frame to frame */

/* The flattened ball of ball_mesh.h, which moves along x; a sensor, where there is one, stands far off on z. */
static npg_status fill(npg_frame *frame, int64_t index, bool with_sensor)
{
    static const double radius[3] = {0.5, 0.4, 0.5};
    npg_random random = {.state = 5 + (uint64_t)index};
    *frame = (npg_frame){.index = index, .number = 10 + index, .sensor_count = with_sensor};
    NPG_TRY(npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, POINTS, 3 * sizeof(float)));
    if (with_sensor) {
        NPG_TRY(npg_alloc_array(&frame->sensor_local, NPG_FOR_FRAMES, 1, 3 * sizeof(float)));
        frame->sensor_local[2] = 50;
    }
    while (frame->point_count < POINTS) {
        double p[3], length = 0;
        for (int a = 0; a < 3; a++) {
            p[a] = 2 * npg_random_real(&random) - 1;
            length += p[a] * p[a];
        }
        if (length > 1 || length < 0.01 || (with_sensor && p[2] < 0)) continue;
        for (int a = 0; a < 3; a++)
            frame->pos_local[3 * frame->point_count + (size_t)a] = (float)(radius[a] * p[a] / sqrt(length));
        frame->pos_local[3 * frame->point_count++] += STEP * (float)index;
    }
    return NPG_OK;
}

static npg_candidate_clouds *sample(bool with_sensor)
{
    npg_candidate_clouds *clouds;
    const npg_frame_box box = {.scale = 1, .diagonal = 3};
    assert_int_equal(npg_candidate_clouds_open(&clouds), NPG_OK);
    for (int64_t i = 0; i < FRAMES; i++) {
        npg_frame frame;
        assert_int_equal(fill(&frame, i, with_sensor), NPG_OK);
        assert_int_equal(npg_candidate_clouds_add(clouds, &frame, &box, true), NPG_OK);
        npg_frame_clear(&frame);
    }
    return clouds;
}

/* The ball of the first frame; what lies behind x = 0 is drawn out by `longer`. */
static npg_mesh *ball_of(float longer)
{
    npg_mesh *ball = ball_mesh(30, 40);
    for (size_t v = 0; v < ball->vert_count; v++)
        if (ball->vert_pos[3 * v] < 0) ball->vert_pos[3 * v] *= longer;
    npg_mesh_vertex_normals(ball->vert_normals, ball->vert_pos, ball->vert_count, ball->faces,
                            ball->face_count);
    return ball;
}

static npg_judgement judge(const npg_candidate_clouds *clouds, npg_mesh *mesh)
{
    npg_judgement judgement;
    const npg_judge_settings settings = {.spacing_unit = 0.06};
    assert_int_equal(npg_judge(&judgement, clouds, 0, mesh, &settings), NPG_OK);
    return judgement;
}

static void held_out_points_are_no_others(void **state)
{
    (void)state;
    npg_candidate_clouds *clouds = sample(false);
    for (size_t f = 0; f < clouds->count; f++) {
        const npg_candidate_cloud *c = &clouds->list[f];
        assert_int_equal(c->fit_count + c->held_count, c->point_count);
        assert_int_equal(c->point_count, POINTS);
        assert_in_range(c->held_count, POINTS / 7, POINTS / 4);
        for (size_t h = 0; h < c->held_count; h++)
            for (size_t i = 0; i < c->fit_count; i++)
                assert_memory_not_equal(c->held + 3 * h, c->fit + 3 * i, 3 * sizeof(float));
    }
    npg_candidate_clouds_close(&clouds);
}

static void the_surface_that_fits_is_better(void **state)
{
    (void)state;
    npg_candidate_clouds *clouds = sample(false);
    npg_mesh *right = ball_of(1), *wrong = ball_of(1.6f);
    npg_judgement of_right = judge(clouds, right), of_wrong = judge(clouds, wrong);
    assert_int_equal(of_right.count, FRAMES - 1); /* its own frame is not asked */
    assert_true(isnan(of_right.of_frame[0]) && isnan(of_right.of_frame[FRAMES]));
    assert_true(of_right.mean >= 0 && of_right.mean < of_wrong.mean && of_wrong.mean <= 2);
    assert_true(npg_judged_better(&of_right, &of_wrong));
    assert_false(npg_judged_better(&of_wrong, &of_right));
    assert_false(npg_judged_better(&of_right, &of_right));
    npg_mesh_unref(&right);
    npg_mesh_unref(&wrong);
    npg_candidate_clouds_close(&clouds);
}

/* Where it is told the surface to be, a step along x to each frame, and `off` steps more. */
static npg_judgement told(const npg_candidate_clouds *clouds, const npg_mesh *mesh, float off)
{
    const npg_judge_settings settings = {.spacing_unit = 0.06};
    npg_mesh *posed = ball_of(1);
    npg_judging *judging;
    assert_int_equal(npg_judging_open(&judging, clouds, 0, mesh, &settings), NPG_OK);
    for (size_t f = 0; f < clouds->count; f++) {
        for (size_t i = 0; i < 3 * mesh->vert_count; i++)
            posed->vert_pos[i] = mesh->vert_pos[i] + (i % 3 || !f ? 0 : STEP * ((float)f + off));
        assert_int_equal(npg_judging_see(judging, &clouds->list[f], posed->vert_pos), NPG_OK);
    }
    npg_judgement found = *npg_judging_found(judging);
    npg_judging_close(&judging);
    npg_mesh_unref(&posed);
    return found;
}

static void what_is_as_near_as_in_its_own_frame_can_not_be_beaten(void **state)
{
    (void)state;
    npg_candidate_clouds *clouds = sample(false);
    npg_mesh *right = ball_of(1), *wrong = ball_of(1.6f);
    const npg_judgement near = told(clouds, right, 0), far = told(clouds, right, 2),
                        of_wrong = told(clouds, wrong, 0);
    assert_int_equal(near.count, FRAMES);
    assert_true(near.own > 0 && near.own == far.own); /* its own frame is where it is */
    assert_true(npg_judged_least(&near));
    assert_false(npg_judged_least(&far));
    assert_true(of_wrong.own <
                of_wrong.of_frame[0]); /* what has no point there says nothing of what another has */
    assert_false(npg_judged_least(&of_wrong));
    npg_mesh_unref(&right);
    npg_mesh_unref(&wrong);
    npg_candidate_clouds_close(&clouds);
}

static void what_no_sensor_sees_needs_no_points(void **state)
{
    (void)state;
    npg_candidate_clouds *known = sample(true), *unknown = sample(true);
    for (size_t f = 0; f < unknown->count; f++) unknown->list[f].sensor_count = 0;
    npg_mesh *ball = ball_of(1);
    double seen = judge(known, ball).mean, all = judge(unknown, ball).mean;
    assert_true(seen < 0.5 * all); /* its far side has no points */
    npg_mesh_unref(&ball);
    npg_candidate_clouds_close(&known);
    npg_candidate_clouds_close(&unknown);
}

enum { SIDE = 60 }; /* cells of an image */

/* What a depth camera at z = 4 sees of the ball in frame `index`; around it is nothing. */
static void fill_cells(float cells[SIDE * SIDE], size_t index)
{
    for (size_t i = 0; i < SIDE * SIDE; i++) {
        double u = image_first(SIDE) + IMAGE_STEP * (double)(i % SIDE),
               v = image_first(SIDE) + IMAGE_STEP * (double)(i / SIDE), depth = 4, inside = 1;
        for (int step = 0; step < 20 && inside > 0; step++) {
            double x = (u * depth - (double)STEP * (double)index) / 0.5, y = v * depth / 0.4;
            inside = 1 - x * x - y * y;
            depth = 4 - 0.5 * sqrt(fmax(0, inside));
        }
        cells[i] = inside > 0 ? (float)depth : INFINITY;
    }
}

static void give_images(npg_candidate_clouds *clouds)
{
    static const double from_above[12] = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 4};
    static float cells[SIDE * SIDE];
    for (size_t f = 0; f < clouds->count; f++) {
        fill_cells(cells, f);
        clouds->list[f].sensors[2] = 4;
        clouds->list[f].space = image_space(cells, SIDE, from_above);
    }
}

/* The half of the ball behind x = 0 is drawn out by 1.6, or pressed to a fifth. */
static void before_one_depth_camera_its_images_judge(void **state)
{
    (void)state;
    npg_candidate_clouds *clouds = sample(true);
    npg_mesh *right = ball_of(1), *longer = ball_of(1.6f), *lacking = ball_of(0.2f);
    give_images(clouds);
    const npg_judgement of_right = told(clouds, right, 0), of_longer = told(clouds, longer, 0),
                        of_lacking = told(clouds, lacking, 0);
    print_message("right %.4f, longer %.4f, lacking %.4f\n", of_right.mean, of_longer.mean, of_lacking.mean);
    assert_true(of_right.mean < 0.02);
    assert_true(of_longer.mean > 0.1 && of_longer.mean < 1);
    assert_true(of_lacking.mean > 0.1 && of_lacking.mean < 0.5); /* less than half of the points are */
    assert_true(judge(clouds, right).mean < 0.02);               /* and as it is followed, too */
    npg_mesh_unref(&right);
    npg_mesh_unref(&longer);
    npg_mesh_unref(&lacking);
    npg_candidate_clouds_close(&clouds);
}

static bool stop(void *user)
{
    return ++*(int *)user > 2;
}

static void it_stops_and_says_where_memory_ends(void **state)
{
    (void)state;
    int asked = 0;
    npg_judgement judgement;
    npg_candidate_clouds *clouds = sample(true);
    npg_mesh *ball = ball_of(1);
    npg_judge_settings settings = {.spacing_unit = 0.06, .should_stop = stop, .user = &asked};
    assert_int_equal(npg_judge(&judgement, clouds, 0, ball, &settings), NPG_STOPPED);
    settings.should_stop = NULL;
    size_t before = npg_memory_used();
    npg_status status = NPG_MEMORY;
    for (uint64_t n = 1; status && n < 400; n += 2) {
        npg_memory_fail_at(n, false);
        status = npg_judge(&judgement, clouds, 0, ball, &settings);
        npg_memory_fail_at(0, false);
        assert_true(status == NPG_OK || status == NPG_MEMORY);
        assert_int_equal(npg_memory_used(), before);
    }
    assert_int_equal(status, NPG_OK);
    npg_mesh_unref(&ball);
    npg_candidate_clouds_close(&clouds);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(held_out_points_are_no_others),
        cmocka_unit_test(the_surface_that_fits_is_better),
        cmocka_unit_test(what_is_as_near_as_in_its_own_frame_can_not_be_beaten),
        cmocka_unit_test(what_no_sensor_sees_needs_no_points),
        cmocka_unit_test(before_one_depth_camera_its_images_judge),
        cmocka_unit_test(it_stops_and_says_where_memory_ends),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
