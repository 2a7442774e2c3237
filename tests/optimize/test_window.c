/* Window: fields that follow a loss and ties, the warm start, exact on the overlap, what two windows share of a frame,
 * and that both solvers find the same wherever the surface is. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>
#include <math.h>

#include "geometry/geometry.h"
#include "optimize/grids/fit.h"
#include "optimize/window.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/group_device.h"

enum { RINGS = 14, SPOKES = 20, VERTS = RINGS * SPOKES + 2, FRAMES = 3 };

static npg_mesh *ball;

static int open_all(void **state)
{
    ball = ball_mesh(RINGS, SPOKES);
    return open_device(state);
}

static int close_all(void **state)
{
    npg_mesh_unref(&ball);
    npg_mesh_unref(&ball);
    return close_device(state);
}

/* ---- fields that follow a loss of the caller's ---- */

static const npg_grid_settings small_grid = {.grid_base = 2,
                                             .grid_step = 3,
                                             .grid_levels = 3,
                                             .position_channels = 30,
                                             .normal_channels = 2,
                                             .lambda = 0.4,
                                             .lambda_growth = 1.5,
                                             .grid_rate = 0.005,
                                             .grid_rate_growth = 2.5,
                                             .width_1 = 32,
                                             .width_2 = 32,
                                             .mlp_rate = 1e-3,
                                             .frequencies = 4};

/* Squares of the ways' distances from targets, and a tie of each to the frame after it. */
static npg_status measure_ways(void *user, double *loss, float *gradient, const float *now)
{
    const float *targets = user;
    const size_t size = 3 * VERTS;
    *loss = 0;
    for (size_t i = 0; i < FRAMES * size; i++) gradient[i] = 0;
    for (size_t i = 0; i < FRAMES * size; i++) {
        float off = now[i] - targets[i], tie = i + size < FRAMES * size ? now[i + size] - now[i] : 0;
        *loss += (double)(off * off + tie * tie);
        gradient[i] += 2 * off - 2 * tie;
        if (i + size < FRAMES * size) gradient[i + size] += 2 * tie;
    }
    return NPG_OK;
}

static npg_status first_and_last(void *user, const npg_fit_step *step)
{
    double *losses = user;
    losses[step->epoch > 0] = step->loss;
    return NPG_OK;
}

/* A field goes where a loss of the caller's draws it, frames and vertices in the caller's order. */
static void ways_follow_a_loss_of_the_callers(void **state)
{
    static float targets[FRAMES * 3 * VERTS];
    const npg_fit_settings settings = {
        .grid = small_grid, .is_of_ways = true, .rate_end = 0.1, .feature_start = 3};
    npg_fit_frame frames[FRAMES];
    npg_fit *fit;
    float way[3 * VERTS], worst = 0;
    double losses[2];
    (void)state;
    for (int t = 0; t < FRAMES; t++) {
        frames[t] = (npg_fit_frame){.index = 7 - t, .time = 0.3 * t};
        for (int i = 0; i < 3 * VERTS; i++)
            targets[t * 3 * VERTS + i] = 0.02f * (float)(t + 1) * ball->vert_pos[i - i % 3 + (i + 1) % 3];
    }
    assert_int_equal(npg_fit_open(&fit, device, &settings, ball, 3), 0);
    assert_int_equal(npg_fit_begin(fit, frames, FRAMES, 0, measure_ways, targets), 0);
    assert_int_equal(npg_fit_run(fit, 0, 300, first_and_last, losses), 0);
    for (size_t t = 0; t < FRAMES; t++) {
        assert_int_equal(npg_fit_vertices(fit, way, t), 0);
        for (size_t i = 0; i < 3 * VERTS; i++)
            worst = fmaxf(worst, fabsf(way[i] - targets[t * 3 * VERTS + i]));
    }
    print_message("loss %.4g, then %.4g; a way off by %.4f at most\n", losses[0], losses[1], (double)worst);
    assert_true(worst < 0.03f && losses[1] < 0.5 * losses[0]);
    npg_fit_close(&fit);
}

/* A frame that is tied goes to its tie, whatever its points say. */
static void tied_frames_follow_their_tie(void **state)
{
    const npg_fit_settings settings = {
        .grid = small_grid, .paper = {NPG_CONFIDENCE_CONSTANT, 5, 0.3}, .rate_end = 0.1, .feature_start = 3};
    npg_fit_frame frames[2] = {{.index = 0}, {.index = 1, .time = 0.5}};
    float tie[3 * VERTS], points[3 * VERTS], end[3 * VERTS];
    double before = 0, after = 0;
    npg_fit *fit;
    (void)state;
    pose_ball(tie, ball->vert_pos, VERTS, 2);
    pose_ball(points, ball->vert_pos, VERTS, -2);
    frames[0].tie = tie;
    for (int t = 0; t < 2; t++) frames[t].points = points, frames[t].count = VERTS;
    assert_int_equal(npg_fit_open(&fit, device, &settings, ball, 3), 0);
    assert_int_equal(npg_fit_begin(fit, frames, 2, 0, NULL, NULL), 0);
    assert_int_equal(npg_fit_run(fit, 0, 200, NULL, NULL), 0);
    assert_int_equal(npg_fit_vertices(fit, end, 0), 0);
    for (int i = 0; i < 3 * VERTS; i++) {
        before += pow((double)(ball->vert_pos[i] - tie[i]), 2);
        after += pow((double)(end[i] - tie[i]), 2);
    }
    print_message("from its tie: %.4g, then %.4g\n", sqrt(before / VERTS), sqrt(after / VERTS));
    assert_true(after < 0.01 * before);
    npg_fit_close(&fit);
}

/* What a field at rest has each frame at is its base, and what it learns comes on top. */
static void frames_start_at_their_bases(void **state)
{
    const npg_fit_settings settings = {
        .grid = small_grid, .paper = {NPG_CONFIDENCE_CONSTANT, 5, 0.3}, .rate_end = 0.1, .feature_start = 3};
    npg_fit_frame frames[FRAMES];
    float bases[FRAMES][3 * VERTS], points[FRAMES][3 * VERTS], end[3 * VERTS];
    double before = 0, after = 0;
    npg_fit *fit;
    (void)state;
    for (int t = 0; t < FRAMES; t++) {
        pose_ball(bases[t], ball->vert_pos, VERTS, 3 - t); /* outward is another order than the caller's */
        pose_ball(points[t], ball->vert_pos, VERTS, 3.5 - t);
        frames[t] = (npg_fit_frame){3 - t, 0.3 * t, points[t], VERTS, NULL, bases[t]};
    }
    assert_int_equal(npg_fit_open(&fit, device, &settings, ball, 3), 0);
    npg_fit_rest(fit);
    assert_int_equal(npg_fit_begin(fit, frames, FRAMES, 0, NULL, NULL), 0);
    assert_int_equal(npg_fit_run(fit, 0, 0, NULL, NULL), 0);
    for (size_t t = 0; t < FRAMES; t++) {
        assert_int_equal(npg_fit_vertices(fit, end, t), 0);
        for (int i = 0; i < 3 * VERTS; i++) {
            assert_true(fabsf(end[i] - bases[t][i]) < 1e-6f);
            before += pow((double)(end[i] - points[t][i]), 2);
        }
    }
    assert_int_equal(npg_fit_run(fit, 0, 200, NULL, NULL), 0);
    for (size_t t = 0; t < FRAMES; t++) {
        assert_int_equal(npg_fit_vertices(fit, end, t), 0);
        for (int i = 0; i < 3 * VERTS; i++) after += pow((double)(end[i] - points[t][i]), 2);
    }
    print_message("from the points: %.4g at the bases, then %.4g\n", sqrt(before), sqrt(after));
    assert_true(after < 0.1 * before);
    npg_fit_close(&fit);
}

/* ---- windows ---- */

static void the_warm_start_is_exact_on_the_overlap(void **state)
{
    const npg_fit_settings small = {
        .grid = small_grid, .paper = {NPG_CONFIDENCE_CONSTANT, 5, 0.3}, .rate_end = 0.1, .feature_start = 3};
    npg_fit *fit;
    npg_fit_frame frames[FRAMES];
    float points[FRAMES][3 * VERTS], end[FRAMES][3 * VERTS], again[3 * VERTS], worst = 0, moved = 0;
    (void)state;
    for (int i = 0; i < FRAMES; i++) {
        pose_ball(points[i], ball->vert_pos, VERTS, i);
        frames[i] = (npg_fit_frame){i, (double)i / (FRAMES - 1), points[i], VERTS, NULL, NULL};
    }
    assert_int_equal(npg_fit_open(&fit, device, &small, ball, 3), 0);
    assert_int_equal(npg_fit_begin(fit, frames, FRAMES, 0, NULL, NULL), 0);
    assert_int_equal(npg_fit_run(fit, 0, 12, NULL, NULL), 0);
    for (size_t i = 0; i < FRAMES; i++) assert_int_equal(npg_fit_vertices(fit, end[i], i), 0);
    for (int i = 0; i < FRAMES; i++) frames[i].index++, frames[i].time += 0.5; /* the next window */
    for (int i = 0; i + 1 < FRAMES; i++) frames[i].points = points[i + 1];
    assert_int_equal(npg_fit_begin(fit, frames, FRAMES, 0, NULL, NULL), 0);
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
}

static const npg_solver_settings aligned = {.epochs = 60, .energy = {.points = 500, .shape = 0.1}};

/* Two windows over frames of which they share two; the second sees the points of those elsewhere.  How far
 * its solved vertices then are from the first's, in the mean. */
static void way_from_the_first(double way[2])
{
    npg_facts facts = {.reference = ball, .plan = {.frame_count = 8, .window = 5, .overlap = 2}};
    const npg_window first = {0, 4, 0, 4, 0}, second = {3, 7, 5, 7, 1};
    npg_window_solver *solver;
    npg_window_result result;
    npg_held held[8] = {{{0}, NULL}}, *all[8];
    float solved[2][3 * VERTS];
    npg_bounds bounds = npg_bounds_of((const float[]){-1, -1, -1, 1, 1, 1}, 2);
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
    if (npg_window_solver_open(&solver, &npg_solver_joint, NULL, &aligned, &facts, 3))
        fail_msg("%s", npg_error_text());
    if (npg_window_solve(solver, &result, all, &first, NULL, NULL)) fail_msg("%s", npg_error_text());
    for (int i = 0; i < 2; i++) {
        memcpy(solved[i], held[3 + i].solved, sizeof solved[i]);
        for (int v = 0; v < VERTS; v++) held[3 + i].frame.pos_local[3 * v] += 0.1f;
    }
    if (npg_window_solve(solver, &result, all + 3, &second, NULL, NULL)) fail_msg("%s", npg_error_text());
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
    double way[2];
    (void)state;
    way_from_the_first(way);
    print_message("0.1 away: the overlap's first frame went %.4f, its second %.4f\n", way[0], way[1]);
    assert_true(way[0] > 0.002 && way[1] > 1.5 * way[0] && way[1] < 0.08);
}

/* Poses come better out of both solvers, wherever in space they are. */

/* One window over frames that have all gone `way` along x: where it puts the last one's first vertices. */
static void solve_gone(float solved[3 * VERTS], const npg_solver *row, float way)
{
    npg_solver_settings settings = aligned;
    npg_facts facts = {.reference = ball, .plan = {.frame_count = 2, .window = 2}};
    settings.grid = small_grid;
    const npg_window window = {0, 1, 0, 1, 0};
    npg_window_solver *solver;
    npg_window_result result;
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
    if (npg_window_solver_open(&solver, row, device, &settings, &facts, 3)) fail_msg("%s", npg_error_text());
    if (npg_window_solve(solver, &result, in_time, &window, NULL, NULL)) fail_msg("%s", npg_error_text());
    for (int i = 0; i < 3 * VERTS; i++) solved[i] = held[1].solved[i] - (i % 3 ? 0 : way);
    npg_window_solver_close(&solver);
    for (int i = 0; i < 2; i++) {
        npg_frame_clear(&held[i].frame);
        npg_release(&held[i].solved);
    }
}

static void check_here_and_far(const npg_solver *row)
{
    float here[3 * VERTS], far[3 * VERTS], start[3 * VERTS], worst = 0, moved = 0;
    solve_gone(here, row, 0);
    solve_gone(far, row, 8);
    pose_ball(start, ball->vert_pos, VERTS, 1);
    for (int i = 0; i < 3 * VERTS; i++) {
        worst = fmaxf(worst, fabsf(far[i] - here[i]));
        moved = fmaxf(moved, fabsf(here[i] - start[i]));
    }
    print_message("%s: moved by %.2g, 8 units away another by %.2g\n", row->name, (double)moved,
                  (double)worst);
    assert_true(moved > 2e-3f && worst < 0.05f * moved);
}

static void where_the_surface_is_does_not_matter(void **state)
{
    (void)state;
    check_here_and_far(&npg_solver_joint);
    check_here_and_far(&npg_solver_grids);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ways_follow_a_loss_of_the_callers),
        cmocka_unit_test(tied_frames_follow_their_tie),
        cmocka_unit_test(frames_start_at_their_bases),
        cmocka_unit_test(the_warm_start_is_exact_on_the_overlap),
        cmocka_unit_test(a_window_has_its_share_of_solved_frames),
        cmocka_unit_test(where_the_surface_is_does_not_matter),
    };
    return cmocka_run_group_tests(tests, open_all, close_all);
}
