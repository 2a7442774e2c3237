/* Joint fit: banded solutions, smoothing that knows noise from motion, and a moving ball whose poses are
 * wrong by noise, with one frame lost and one with a hole, put right by the points of all frames. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "optimize/solver.h"
#include "pipeline/random.h"
#include "tests/support/ball_mesh.h"

enum { RINGS = 14, SPOKES = 20, VERTS = RINGS * SPOKES + 2, FRAMES = 12 };

static const npg_solver_settings usual = {.epochs = 60, .energy = {.points = 1000, .shape = 0.2}};

static float noise_of(npg_random *random)
{
    double sum = -6;
    for (int i = 0; i < 12; i++) sum += npg_random_real(random);
    return (float)sum;
}

/* ---- five diagonals ---- */

static void band_solves(void **state)
{
    enum { N = 9 };
    double memory[3 * N] = {0}, x[N], wanted[N], right[N] = {0};
    npg_band band = {N, memory, memory + N, memory + 2 * N};
    (void)state;
    for (int i = 0; i < N; i++) wanted[i] = sin(i), right[i] = wanted[i] * (1 + 0.1 * i);
    for (int t = 1; t + 1 < N; t++) { /* lambda D^T D wanted, difference by difference */
        double bend = 3 * (wanted[t - 1] - 2 * wanted[t] + wanted[t + 1]);
        right[t - 1] += bend, right[t] -= 2 * bend, right[t + 1] += bend;
    }
    for (int i = 0; i < N; i++) band.main[i] = 1 + 0.1 * i;
    npg_band_add_bend(&band, 3);
    npg_band_factor(&band);
    memcpy(x, right, sizeof x);
    npg_band_solve(&band, x, 1);
    for (int i = 0; i < N; i++) assert_true(fabs(x[i] - wanted[i]) < 1e-10);
}

/* ---- a ball that moves ---- */

typedef struct capture {
    npg_mesh *ball;
    float truth[FRAMES][3 * VERTS], pose[FRAMES][3 * VERTS], points[FRAMES][3 * VERTS];
} capture;

static void make_capture(capture *c, float pose_noise, float point_noise)
{
    npg_random random = npg_random_stream(5, 0, 0);
    c->ball = ball_mesh(RINGS, SPOKES);
    for (int t = 0; t < FRAMES; t++) {
        pose_ball(c->truth[t], c->ball->vert_pos, VERTS, 2 * sin(0.25 * t));
        for (int i = 0; i < 3 * VERTS; i++) {
            c->pose[t][i] = c->truth[t][i] + pose_noise * noise_of(&random);
            c->points[t][i] = c->truth[t][i] + point_noise * noise_of(&random);
        }
    }
}

static double error_of(const capture *c, int first, int last)
{
    double sum = 0;
    for (int t = first; t <= last; t++)
        for (int i = 0; i < 3 * VERTS; i++) sum += pow((double)c->pose[t][i] - (double)c->truth[t][i], 2);
    return sqrt(sum / ((last - first + 1) * VERTS));
}

static void fill_frames(npg_energy_frame *frames, capture *c)
{
    for (int t = 0; t < FRAMES; t++)
        frames[t] = (npg_energy_frame){.positions = c->pose[t], .points = c->points[t], .point_count = VERTS};
}

/* The frames' positions become the solved ones; *lambda: how smooth the motion was found to be. */
static void solve_some(capture *c, const npg_energy_frame *frames, size_t count, double *lambda)
{
    static float ways[FRAMES * 3 * VERTS];
    npg_energy *energy;
    npg_solved solved;
    assert_int_equal(npg_energy_open(&energy, c->ball, &usual.energy), NPG_OK);
    assert_int_equal(npg_energy_set(energy, frames, count), NPG_OK);
    const npg_problem problem = {.settings = &usual, .count = count, .energy = energy, .result = ways};
    assert_int_equal(npg_solver_joint.solve(NULL, &solved, &problem, NULL, NULL), NPG_OK);
    for (size_t i = 0; i < 3 * VERTS * count; i++)
        frames[i / (3 * VERTS)].positions[i % (3 * VERTS)] = npg_energy_smoothed(energy)[i] + ways[i];
    if (lambda) *lambda = npg_energy_lambda(energy);
    npg_energy_close(&energy);
}

static double solve(capture *c, const npg_energy_frame *frames)
{
    double lambda;
    solve_some(c, frames, FRAMES, &lambda);
    return lambda;
}

/* Cross-validation smooths noise far and a clean motion hardly. */
static void smoothing_follows_the_noise(void **state)
{
    static capture noisy, clean;
    npg_energy_frame frames[FRAMES];
    (void)state;
    make_capture(&noisy, 0.01f, 0.01f);
    make_capture(&clean, 1e-5f, 0);
    fill_frames(frames, &noisy);
    double before = error_of(&noisy, 0, FRAMES - 1), noisy_lambda = solve(&noisy, frames);
    double after = error_of(&noisy, 0, FRAMES - 1);
    fill_frames(frames, &clean);
    double clean_lambda = solve(&clean, frames);
    print_message("noisy: lambda %.3g, error %.4f, then %.4f; clean: lambda %.3g, error %.6f\n", noisy_lambda,
                  before, after, clean_lambda, error_of(&clean, 0, FRAMES - 1));
    assert_true(after < 0.75 * before && clean_lambda < 0.2 * noisy_lambda);
    assert_true(error_of(&clean, 0, FRAMES - 1) < 1e-3);
    npg_mesh_unref(&noisy.ball);
    npg_mesh_unref(&clean.ball);
}

/* A frame without points goes where its neighbours in time are. */
static void neighbours_carry_what_is_not_seen(void **state)
{
    static capture c;
    npg_energy_frame frames[FRAMES];
    (void)state;
    make_capture(&c, 0.003f, 0.003f);
    fill_frames(frames, &c);
    for (int i = 0; i < VERTS; i++) c.pose[6][3 * i] += 0.2f;
    frames[6].point_count = 0;
    solve(&c, frames);
    print_message("without points: %.4f, the others %.4f\n", error_of(&c, 6, 6), error_of(&c, 1, 5));
    assert_true(error_of(&c, 6, 6) < 0.02);
    npg_mesh_unref(&c.ball);
}

/* One frame has points of something else: it draws neither its neighbours nor itself to them. */
static void points_that_fit_nothing_pull_nothing(void **state)
{
    static capture c;
    npg_energy_frame frames[FRAMES];
    npg_random random = npg_random_stream(7, 0, 0);
    (void)state;
    make_capture(&c, 0.001f, 0.001f);
    fill_frames(frames, &c);
    for (int i = 0; i < 3 * VERTS; i++) {
        c.points[6][i] = c.truth[6][i % 3] + (float)(2.4 * npg_random_real(&random) - 1.2);
        c.pose[6][i] *= 0.8f;
    }
    solve(&c, frames);
    print_message("that frame: %.4f, beside it %.4f and %.4f\n", error_of(&c, 6, 6), error_of(&c, 5, 5),
                  error_of(&c, 7, 7));
    assert_true(error_of(&c, 6, 6) < 0.02 && error_of(&c, 5, 5) < 0.005 && error_of(&c, 7, 7) < 0.005);
    npg_mesh_unref(&c.ball);
}

/* Where one frame has a hole, and its pose clings to what it has points of, the frames around it say where the
 * surface is; what the frame saw stays. */
static void holes_are_bridged(void **state)
{
    static capture c;
    npg_energy_frame frames[FRAMES];
    double off[2] = {0};
    size_t kept = 0, in[2] = {0};
    (void)state;
    make_capture(&c, 0.001f, 0.001f);
    fill_frames(frames, &c);
    for (int i = 0; i < VERTS; i++) {
        bool is_hole = c.ball->vert_pos[3 * i + 2] > 0.1f;
        if (is_hole) c.pose[6][3 * i + 2] -= 0.5f * (c.ball->vert_pos[3 * i + 2] - 0.1f);
        if (!is_hole) memcpy(c.points[6] + 3 * kept++, c.points[6] + 3 * i, 3 * sizeof(float));
    }
    frames[6].point_count = kept;
    solve(&c, frames);
    for (int i = 0; i < VERTS; i++) {
        bool is_hole = c.ball->vert_pos[3 * i + 2] > 0.1f;
        off[is_hole] += npg_vec3_distance(c.pose[6] + 3 * i, c.truth[6] + 3 * i);
        in[is_hole]++;
    }
    print_message("in the hole: %.4f, beside it %.4f\n", off[1] / (double)in[1], off[0] / (double)in[0]);
    assert_true(off[1] < 0.02 * (double)in[1] && off[0] < 0.02 * (double)in[0]);
    npg_mesh_unref(&c.ball);
}

/* Poses and motion alone: their part of the gradient, difference by difference. */
static void even_is_of_poses_and_motion(void **state)
{
    static capture c;
    static float d[FRAMES * 3 * VERTS], right[FRAMES * 3 * VERTS];
    static double x[FRAMES * 3 * VERTS], wanted[FRAMES * 3 * VERTS];
    enum { ROW = 3 * VERTS };
    npg_energy_frame frames[FRAMES];
    npg_energy *energy;
    npg_random random = npg_random_stream(6, 0, 0);
    double off = 0, size = 0;
    (void)state;
    make_capture(&c, 0.01f, 0.005f);
    fill_frames(frames, &c);
    assert_int_equal(npg_energy_open(&energy, c.ball, &usual.energy), NPG_OK);
    assert_int_equal(npg_energy_set(energy, frames, FRAMES), NPG_OK);
    const npg_energy_system *s = npg_energy_system_of(energy);
    for (size_t i = 0; i < FRAMES * ROW; i++) {
        size_t t = i / ROW, k = i % ROW;
        d[i] = 0.01f * noise_of(&random);
        x[i] = (double)npg_energy_smoothed(energy)[i] + (double)d[i];
        wanted[i] = (double)(s->shares[t] * s->ties[k / 3]) * ((double)c.pose[t][k] - x[i]);
    }
    for (size_t i = ROW; i < (FRAMES - 1) * ROW; i++) {
        double bend = (double)s->lambda[i % ROW / 3] * (x[i - ROW] - 2 * x[i] + x[i + ROW]);
        wanted[i - ROW] -= bend, wanted[i] += 2 * bend, wanted[i + ROW] -= bend;
    }
    for (size_t t = 0; t < FRAMES; t++) npg_energy_even(right + t * ROW, energy, d, t);
    for (size_t i = 0; i < FRAMES * ROW; i++) {
        off += fabs((double)right[i] - wanted[i]);
        size += fabs(wanted[i]);
    }
    assert_true(size > 0 && off < 1e-3 * size);
    npg_energy_close(&energy);
    npg_mesh_unref(&c.ball);
}

static void equal_input_gives_equal_bits(void **state)
{
    static capture a, b;
    npg_energy_frame frames[FRAMES];
    (void)state;
    make_capture(&a, 0.01f, 0.005f);
    make_capture(&b, 0.01f, 0.005f);
    fill_frames(frames, &a);
    solve(&a, frames);
    fill_frames(frames, &b);
    solve(&b, frames);
    assert_memory_equal(a.pose, b.pose, sizeof a.pose);
    npg_mesh_unref(&a.ball);
    npg_mesh_unref(&b.ball);
}

/* A window of one frame, and one without any point, are left as they are or nearly so. */
static void short_windows_work(void **state)
{
    static capture c;
    npg_energy_frame frames[FRAMES];
    (void)state;
    make_capture(&c, 0.001f, 0);
    fill_frames(frames, &c);
    for (size_t count = 1; count <= 5; count++) solve_some(&c, frames, count, NULL);
    for (int t = 0; t < 3; t++) frames[t].point_count = 0;
    solve_some(&c, frames, 3, NULL);
    assert_true(error_of(&c, 0, 4) < 0.005);
    npg_mesh_unref(&c.ball);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(band_solves),
                                       cmocka_unit_test(smoothing_follows_the_noise),
                                       cmocka_unit_test(neighbours_carry_what_is_not_seen),
                                       cmocka_unit_test(points_that_fit_nothing_pull_nothing),
                                       cmocka_unit_test(holes_are_bridged),
                                       cmocka_unit_test(even_is_of_poses_and_motion),
                                       cmocka_unit_test(equal_input_gives_equal_bits),
                                       cmocka_unit_test(short_windows_work)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
