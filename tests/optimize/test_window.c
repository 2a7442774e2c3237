/* Window: the terms that tie frames which two windows share - their gradient through the whole decoder, what
 * they hold - and the warm start, exact on the overlap. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>
#include <math.h>

#include "geometry/geometry.h"
#include "kernels/check.h"
#include "kernels/latent.h"
#include "kernels/mlp.h"
#include "optimize/fit.h"
#include "optimize/window.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/group_device.h"
#include "tests/support/slope.h"

enum { RINGS = 14, SPOKES = 20, VERTS = RINGS * SPOKES + 2, FRAMES = 3 };

/* ---- gradients through the overlap's terms ---- */

/* One frame: loss(decoder, features, code) = sum of the ties at the samples that the decoder has moved. */
typedef struct tied {
    npg_mlp_shape shape;
    size_t samples, param_count;
    npg_skinning *skinning;
    npg_matcher *matcher;
    npg_pull *pulls;
    size_t pull_count;
    float *base, *solved; /* S x 3: aligned, and where the window before has put them */
    double *params, *z, code[4], *base_wide, *x, *g, *out;
    double *grad, *dz, dcode[4];
} tied;

static double tied_loss(void *user)
{
    tied *t = user;
    for (size_t s = 0; s < t->samples; s++) {
        npg_mlp_forward_ref(t->out + 7 * s, t->z + NPG_LATENT_CHANNELS * s, t->code, t->params, &t->shape);
        npg_transform_ref(t->x + 3 * s, t->out + 7 * s, t->base_wide + 3 * s);
    }
    return npg_pull_ref(t->g, t->x, t->samples, t->pulls, t->pull_count);
}

/* By the twins' backward ways; after tied_loss(). */
static void tied_slopes(tied *t)
{
    for (size_t s = 0; s < t->samples; s++) {
        double dout[7] = {0};
        npg_transform_back_ref(dout, t->g + 3 * s, t->out + 7 * s, t->base_wide + 3 * s);
        npg_mlp_backward_ref(t->grad, t->dz + NPG_LATENT_CHANNELS * s, t->dcode, dout,
                             t->z + NPG_LATENT_CHANNELS * s, t->code, t->params, &t->shape);
    }
}

static double *wide_array(size_t count)
{
    double *values;
    assert_int_equal(npg_alloc_array(&values, NPG_FOR_RUN, count, sizeof *values), 0);
    return values;
}

static void fill(double *values, size_t count, double scale, npg_random *random)
{
    for (size_t i = 0; i < count; i++) values[i] = (double)(float)(scale * (2 * npg_random_real(random) - 1));
}

static void open_tied(tied *t, npg_mesh *ball)
{
    const npg_match_settings match = {200, 0.02, 0.5, 5000, 0.7};
    npg_random random = npg_random_stream(11, 0, 0);
    float dense[3 * VERTS], before[3 * VERTS];
    *t = (tied){.shape = {32, 64, 4}};
    assert_int_equal(npg_skinning_open(&t->skinning, ball, 60, 0), 0);
    assert_int_equal(npg_matcher_open(&t->matcher, t->skinning, &match), 0);
    size_t s = t->samples = t->skinning->samples->mesh->vert_count;
    t->param_count = npg_mlp_param_count(&t->shape);
    assert_int_equal(npg_alloc_array(&t->base, NPG_FOR_RUN, s, 3 * sizeof(float)), 0);
    assert_int_equal(npg_alloc_array(&t->solved, NPG_FOR_RUN, s, 3 * sizeof(float)), 0);
    assert_int_equal(npg_alloc_array(&t->pulls, NPG_FOR_RUN, npg_matcher_most(t->matcher), sizeof *t->pulls),
                     0);
    pose_ball(dense, ball->vert_pos, VERTS, 1);
    pose_ball(before, ball->vert_pos, VERTS, 1.5);
    npg_skinning_gather(t->skinning, t->base, dense);
    npg_skinning_gather(t->skinning, t->solved, before);
    npg_match_tie(t->matcher, t->pulls, &t->pull_count, t->solved);
    assert_int_equal(t->pull_count, s);
    t->params = wide_array(t->param_count), t->grad = wide_array(t->param_count);
    t->z = wide_array(s * NPG_LATENT_CHANNELS), t->dz = wide_array(s * NPG_LATENT_CHANNELS);
    t->base_wide = wide_array(3 * s), t->x = wide_array(3 * s), t->g = wide_array(3 * s);
    t->out = wide_array(7 * s);
    fill(t->params, t->param_count, 0.3, &random);
    fill(t->z, s * NPG_LATENT_CHANNELS, 0.9, &random);
    fill(t->code, 4, 1, &random);
    for (size_t i = 0; i < 3 * s; i++) t->base_wide[i] = (double)t->base[i];
}

static void close_tied(tied *t)
{
    void *all[] = {&t->pulls, &t->base, &t->solved, &t->params, &t->z, &t->base_wide,
                   &t->x,     &t->g,    &t->out,    &t->grad,   &t->dz};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) npg_release(all[i]);
    npg_matcher_close(&t->matcher);
    npg_skinning_close(&t->skinning);
}

static void ties_are_the_squared_way_back(void **state)
{
    tied t;
    npg_mesh *ball = ball_mesh(RINGS, SPOKES);
    double sum = 0;
    (void)state;
    open_tied(&t, ball);
    for (size_t i = 0; i < 3 * t.samples; i++) {
        double off = (double)t.base[i] - (double)t.solved[i];
        sum += off * off * 0.7 * 5000 / (double)t.samples;
    }
    assert_true(sum > 1);
    assert_true(fabs(npg_pull_ref(t.g, t.base_wide, t.samples, t.pulls, t.pull_count) - sum) < 1e-4 * sum);
    for (size_t i = 0; i < 3 * t.samples; i++) t.base_wide[i] = (double)t.solved[i];
    assert_true(npg_pull_ref(t.g, t.base_wide, t.samples, t.pulls, t.pull_count) < 1e-9);
    close_tied(&t);
    npg_mesh_unref(&ball);
}

static void gradients_through_the_ties_are_slopes(void **state)
{
    tied t;
    npg_mesh *ball = ball_mesh(RINGS, SPOKES);
    double error = 0;
    (void)state;
    open_tied(&t, ball);
    assert_true(tied_loss(&t) > 1);
    tied_slopes(&t);
    check_slope(&error, t.params, t.grad, t.param_count, 7, 1e-6, tied_loss, &t);
    check_slope(&error, t.z, t.dz, t.samples * NPG_LATENT_CHANNELS, 13, 1e-6, tied_loss, &t);
    check_slope(&error, t.code, t.dcode, 4, 1, 1e-6, tied_loss, &t);
    print_message("ties: gradient off by %.2g\n", error);
    assert_true(error < 1e-5);
    close_tied(&t);
    npg_mesh_unref(&ball);
}

/* The way back of the device through the same terms, against the twins'. */
static npg_status device_slopes(tied *t, npg_mlp *mlp, npg_motion *motion)
{
    const size_t size = NPG_LATENT_CHANNELS * sizeof(float);
    const int32_t start[2] = {0, (int32_t)t->pull_count};
    const uint32_t edges[1][2] = {{0, 1}};
    const float gain = 1;
    size_t rows = npg_mlp_rows(device, t->samples);
    float row[NPG_LATENT_CHANNELS], code[4], *params;
    NPG_TRY(npg_mlp_open(mlp, device, &t->shape, rows, 1, 1));
    NPG_TRY(npg_motion_open(motion, device, t->base, t->samples, rows, edges, 1, NULL, 1));
    NPG_TRY(npg_alloc_array(&params, NPG_FOR_RUN, t->param_count, sizeof *params));
    for (size_t i = 0; i < t->param_count; i++) params[i] = (float)t->params[i];
    npg_status status = npg_buffer_write(&mlp->params, 0, params, t->param_count * sizeof *params);
    npg_release(&params);
    for (size_t r = 0; r < rows && !status; r++) {
        size_t from = r < t->samples ? r : t->samples - 1;
        for (size_t c = 0; c < NPG_LATENT_CHANNELS; c++) row[c] = (float)t->z[from * NPG_LATENT_CHANNELS + c];
        status = npg_buffer_write(&mlp->z, r * size, row, size);
    }
    for (int c = 0; c < 4; c++) code[c] = (float)t->code[c];
    if (!status) status = npg_buffer_write(&mlp->code, 0, code, sizeof code);
    if (!status) status = npg_motion_set_pulls(motion, t->pulls, start);
    if (!status) status = npg_mlp_begin(mlp);
    if (!status) status = npg_mlp_forward(mlp, 0, 1);
    if (!status) status = npg_motion_apply(motion, &mlp->out, 0, 1);
    if (!status) status = npg_motion_pull(motion, 0, 1);
    if (!status) status = npg_motion_back(motion, &mlp->dout, &mlp->out, &gain, 0, 0, 1);
    if (!status) status = npg_mlp_backward(mlp, 0, 1);
    return status ? status : npg_mlp_end(mlp);
}

static void the_device_has_the_same_gradient(void **state)
{
    tied t;
    npg_mesh *ball = ball_mesh(RINGS, SPOKES);
    npg_mlp mlp = {0};
    npg_motion motion = {0};
    double loss, loss_error = 0, grad_error = 0, dz_error = 0;
    (void)state;
    open_tied(&t, ball);
    loss = tied_loss(&t);
    tied_slopes(&t);
    if (device_slopes(&t, &mlp, &motion)) fail_msg("%s", npg_error_text());
    assert_int_equal(npg_check_buffer(&loss_error, &motion.cd, &loss, 1), 0);
    assert_int_equal(npg_check_buffer(&grad_error, &mlp.grad, t.grad, t.param_count), 0);
    assert_int_equal(npg_check_buffer(&dz_error, &mlp.dz, t.dz, t.samples * NPG_LATENT_CHANNELS), 0);
    print_message("ties on the device: loss off by %.2g, decoder %.2g, features %.2g\n", loss_error,
                  grad_error, dz_error);
    assert_true(loss_error < 2e-5 && grad_error < 2e-5 && dz_error < 2e-5);
    npg_mlp_close(&mlp);
    npg_motion_close(&motion);
    close_tied(&t);
    npg_mesh_unref(&ball);
}

/* ---- windows ---- */

static const npg_fit_settings small = {.epochs = 12,
                                       .frequencies = 4,
                                       .encoding = NPG_ENCODING_GRID,
                                       .confidence = NPG_CONFIDENCE_CONSTANT,
                                       .smoothing = NPG_SMOOTHING_SCREENED,
                                       .grid_base = 2,
                                       .grid_step = 3,
                                       .grid_levels = 3,
                                       .normal_nodes = 4,
                                       .position_channels = 30,
                                       .normal_channels = 2,
                                       .normal_grid = true,
                                       .lambda = 0.4,
                                       .lambda_growth = 1.5,
                                       .grid_rate = 0.005,
                                       .grid_rate_growth = 2.5,
                                       .mlp_rate = 1e-3,
                                       .isometry = 5,
                                       .alpha = 0.3,
                                       .width_1 = 32,
                                       .width_2 = 32,
                                       .rate_end = 0.1,
                                       .feature_start = 3};

static void the_warm_start_is_exact_on_the_overlap(void **state)
{
    npg_mesh *ball = ball_mesh(RINGS, SPOKES);
    npg_fit *fit;
    npg_fit_frame frames[FRAMES];
    float points[FRAMES][3 * VERTS], end[FRAMES][3 * VERTS], again[3 * VERTS], worst = 0, moved = 0;
    (void)state;
    for (int i = 0; i < FRAMES; i++) {
        pose_ball(points[i], ball->vert_pos, VERTS, i);
        frames[i] = (npg_fit_frame){i, (double)i / (FRAMES - 1), points[i], VERTS, NULL, NULL};
    }
    assert_int_equal(npg_fit_open(&fit, device, &small, ball, 3), 0);
    assert_int_equal(npg_fit_begin(fit, frames, FRAMES, 0), 0);
    assert_int_equal(npg_fit_run(fit, 0, small.epochs, NULL, NULL), 0);
    for (size_t i = 0; i < FRAMES; i++) assert_int_equal(npg_fit_vertices(fit, end[i], i), 0);
    for (int i = 0; i < FRAMES; i++) frames[i].index++, frames[i].time += 0.5; /* the next window */
    for (int i = 0; i + 1 < FRAMES; i++) frames[i].points = points[i + 1];
    assert_int_equal(npg_fit_begin(fit, frames, FRAMES, 0), 0);
    assert_int_equal(npg_fit_run(fit, 0, 0, NULL, NULL), 0);
    for (size_t i = 0; i + 1 < FRAMES; i++) {
        assert_int_equal(npg_fit_vertices(fit, again, i), 0);
        for (size_t k = 0; k < 3 * VERTS; k++) {
            worst = fmaxf(worst, fabsf(again[k] - end[i + 1][k]));
            moved = fmaxf(moved, fabsf(again[k] - ball->vert_pos[k]));
        }
    }
    print_message("moved by %.2g, another start by %.2g\n", (double)moved, (double)worst);
    assert_true(moved > 1e-3f && worst < 1e-6f);
    npg_fit_close(&fit);
    npg_mesh_unref(&ball);
}

static const npg_window_settings aligned = {.fit = {.epochs = 60}, .joint = {.points = 500, .shape = 0.1}};

/* Two windows over frames of which they share two; the second sees the points of those elsewhere.  How far
 * its solved vertices then are from the first's, in the mean. */
static void way_from_the_first(double way[2], npg_mesh *ball)
{
    npg_facts facts = {.reference = ball, .plan = {.frame_count = 8, .window = 5, .overlap = 2}};
    const npg_window first = {0, 4, -1, 0, 4, 0}, second = {3, 7, 0, 5, 7, 1};
    npg_window_solver *solver;
    npg_held held[8] = {{{0}, NULL}}, *all[8];
    float solved[2][3 * VERTS];
    npg_bounds bounds = npg_bounds_empty();
    npg_bounds_add_points(&bounds, (const float[]){-1, -1, -1, 1, 1, 1}, 2);
    assert_int_equal(npg_frame_box_set(&facts.box, &facts.origin, &bounds), 0);
    for (int i = 0; i < 8; i++) {
        npg_frame *frame = &held[i].frame;
        all[i] = &held[i];
        *frame = (npg_frame){.index = i, .number = i, .point_count = VERTS, .vert_count = VERTS};
        assert_int_equal(npg_alloc_array(&frame->pos_local, NPG_FOR_RUN, VERTS, 3 * sizeof(float)), 0);
        assert_int_equal(npg_alloc_array(&frame->vert_unit, NPG_FOR_RUN, VERTS, 3 * sizeof(float)), 0);
        pose_ball(frame->pos_local, ball->vert_pos, VERTS, 0.2 * i);
        npg_box_local_to_unit(&facts.box, frame->vert_unit, frame->pos_local, VERTS);
    }
    if (npg_window_solver_open(&solver, NULL, &aligned, &facts, 3, true)) fail_msg("%s", npg_error_text());
    if (npg_window_solve(solver, all, &first, NULL, NULL)) fail_msg("%s", npg_error_text());
    for (int i = 0; i < 2; i++) {
        memcpy(solved[i], held[3 + i].solved, sizeof solved[i]);
        for (int v = 0; v < VERTS; v++) held[3 + i].frame.pos_local[3 * v] += 0.1f;
    }
    if (npg_window_solve(solver, all + 3, &second, NULL, NULL)) fail_msg("%s", npg_error_text());
    for (int i = 0; i < 2; i++) {
        way[i] = 0;
        for (int v = 0; v < VERTS; v++) {
            const float *a = held[3 + i].solved + 3 * v, *b = solved[i] + 3 * v;
            way[i] += sqrt(pow((double)(a[0] - b[0]), 2) + pow((double)(a[1] - b[1]), 2) +
                           pow((double)(a[2] - b[2]), 2)) /
                      VERTS;
        }
    }
    npg_window_solver_close(&solver);
    for (int i = 0; i < 8; i++) {
        npg_frame_clear(&held[i].frame);
        npg_release(&held[i].solved);
    }
}

/* In an overlap of two, a frame goes a third of the way, then two thirds. */
static void a_window_has_its_share_of_solved_frames(void **state)
{
    npg_mesh *ball = ball_mesh(RINGS, SPOKES);
    double way[2];
    (void)state;
    way_from_the_first(way, ball);
    print_message("0.1 away: the overlap's first frame went %.4f, its second %.4f\n", way[0], way[1]);
    assert_true(way[0] > 0.002 && way[1] > 1.5 * way[0] && way[1] < 0.08);
    npg_mesh_unref(&ball);
}

/* One window over frames that have all gone `way` along x: where it puts the last one's first vertices. */
static void solve_gone(float solved[3 * VERTS], npg_mesh *ball, float way)
{
    npg_facts facts = {.reference = ball, .plan = {.frame_count = 2, .window = 2}};
    const npg_window window = {0, 1, -1, 0, 1, 0};
    npg_window_solver *solver;
    npg_held held[2] = {{{0}, NULL}};
    npg_held *in_time[] = {&held[0], &held[1]};
    facts.box.scale = 1;
    for (int i = 0; i < 2; i++) {
        npg_frame *frame = &held[i].frame;
        *frame = (npg_frame){.index = i, .number = i, .point_count = VERTS, .vert_count = VERTS};
        assert_int_equal(npg_alloc_array(&frame->pos_local, NPG_FOR_RUN, VERTS, 3 * sizeof(float)), 0);
        assert_int_equal(npg_alloc_array(&frame->vert_unit, NPG_FOR_RUN, VERTS, 3 * sizeof(float)), 0);
        pose_ball(frame->vert_unit, ball->vert_pos, VERTS, i);
        pose_ball(frame->pos_local, ball->vert_pos, VERTS, i + 0.5); /* what is left to find */
        for (int v = 0; v < VERTS; v++) frame->vert_unit[3 * v] += way, frame->pos_local[3 * v] += way;
    }
    if (npg_window_solver_open(&solver, NULL, &aligned, &facts, 3, true)) fail_msg("%s", npg_error_text());
    if (npg_window_solve(solver, in_time, &window, NULL, NULL)) fail_msg("%s", npg_error_text());
    for (int i = 0; i < 3 * VERTS; i++) solved[i] = held[1].solved[i] - (i % 3 ? 0 : way);
    npg_window_solver_close(&solver);
    for (int i = 0; i < 2; i++) {
        npg_frame_clear(&held[i].frame);
        npg_release(&held[i].solved);
    }
}

static void where_the_surface_is_does_not_matter(void **state)
{
    npg_mesh *ball = ball_mesh(RINGS, SPOKES);
    float here[3 * VERTS], far[3 * VERTS], start[3 * VERTS], worst = 0, moved = 0;
    (void)state;
    solve_gone(here, ball, 0);
    solve_gone(far, ball, 8);
    pose_ball(start, ball->vert_pos, VERTS, 1);
    for (int i = 0; i < 3 * VERTS; i++) {
        worst = fmaxf(worst, fabsf(far[i] - here[i]));
        moved = fmaxf(moved, fabsf(here[i] - start[i]));
    }
    print_message("moved by %.2g, 8 units away another by %.2g\n", (double)moved, (double)worst);
    assert_true(moved > 2e-3f && worst < 0.05f * moved);
    npg_mesh_unref(&ball);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ties_are_the_squared_way_back),
        cmocka_unit_test(gradients_through_the_ties_are_slopes),
        cmocka_unit_test(the_device_has_the_same_gradient),
        cmocka_unit_test(the_warm_start_is_exact_on_the_overlap),
        cmocka_unit_test(a_window_has_its_share_of_solved_frames),
        cmocka_unit_test(where_the_surface_is_does_not_matter),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
