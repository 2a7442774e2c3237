/* Joint: the energy's least by conjugate gradients over all vertices of all frames, preconditioned by each
 * vertex' own five diagonals in time. */
#include <math.h>
#include <string.h>

#include "geometry/limits.h"
#include "optimize/solver.h"
#include "pipeline/parallel.h"

#define BLOCKS 64 /* of vertices: sums are made block by block, so that threads don't matter */

typedef struct work {
    const npg_energy_system *s;
    size_t threads;
    /* T x W x 3 */
    float *step, *right, *direction, *image;
    float *factors;      /* each vertex' diagonals, factored: main, near, far */
    float by;            /* what `step` and `right` move by along `direction` and `image` */
    double gained;       /* of E */
    double *frame_sums;  /* T */
    double sums[BLOCKS]; /* of vertices */
} work;

static npg_status multiply_frames(void *user, size_t part)
{
    work *w = user;
    const npg_energy_system *s = w->s;
    size_t size = 3 * s->vert_count;
    for (size_t t = part; t < s->frame_count; t += w->threads) {
        const float *image = w->image + t * size, *x = w->direction + t * size;
        npg_energy_multiply(w->image, s, w->direction, t);
        w->frame_sums[t] = 0;
        for (size_t i = 0; i < size; i++) w->frame_sums[t] += (double)image[i] * (double)x[i];
    }
    return NPG_OK;
}

/* ---- the preconditioner ---- */

static void factor_vertex(const work *w, npg_band *band, size_t v)
{
    const npg_energy_system *s = w->s;
    npg_energy_band(band, s, v, w->factors + 3 * v, 3 * s->vert_count);
    for (size_t t = 0; t < s->frame_count; t++) {
        float *to = w->factors + 3 * (t * s->vert_count + v);
        to[0] = (float)band->main[t];
        to[1] = (float)band->near[t];
        to[2] = (float)band->far[t];
    }
}

static npg_status gather_diagonals(void *user, size_t part)
{
    work *w = user;
    for (size_t t = part; t < w->s->frame_count; t += w->threads)
        npg_energy_diagonal(w->factors + 3 * t * w->s->vert_count, 3, w->s, t);
    return NPG_OK;
}

static npg_status factor_vertices(void *user, size_t part)
{
    work *w = user;
    size_t n = w->s->frame_count;
    double *memory;
    NPG_TRY(npg_alloc_array(&memory, NPG_FOR_FIT, 3 * n, sizeof *memory));
    npg_band band = {n, memory, memory + n, memory + 2 * n};
    for (size_t v = part; v < w->s->vert_count; v += w->threads) factor_vertex(w, &band, v);
    npg_release(&memory);
    return NPG_OK;
}

/* line (T x 3) = the vertex' factors' inverse times its residual. */
static void precondition(double *line, const work *w, size_t v)
{
    size_t n = w->s->frame_count, row = 3 * w->s->vert_count;
    const float *f = w->factors + 3 * v, *r = w->right + 3 * v;
    for (size_t k = 0; k < 3; k++) {
        for (size_t t = 0; t < n; t++) {
            line[3 * t + k] = (double)r[t * row + k];
            if (t > 0) line[3 * t + k] -= (double)f[(t - 1) * row + 1] * line[3 * (t - 1) + k];
            if (t > 1) line[3 * t + k] -= (double)f[(t - 2) * row + 2] * line[3 * (t - 2) + k];
        }
        for (size_t t = n; t-- > 0;) {
            line[3 * t + k] /= (double)f[t * row];
            if (t + 1 < n) line[3 * t + k] -= (double)f[t * row + 1] * line[3 * (t + 1) + k];
            if (t + 2 < n) line[3 * t + k] -= (double)f[t * row + 2] * line[3 * (t + 2) + k];
        }
    }
}

/* Step and residual move on; image becomes the preconditioned residual. */
static npg_status move_blocks(void *user, size_t part)
{
    work *w = user;
    const npg_energy_system *s = w->s;
    size_t row = 3 * s->vert_count;
    double *line;
    NPG_TRY(npg_alloc_array(&line, NPG_FOR_FIT, 3 * s->frame_count, sizeof *line));
    for (size_t block = part; block < BLOCKS; block += w->threads) {
        size_t first = block * s->vert_count / BLOCKS, last = (block + 1) * s->vert_count / BLOCKS;
        w->sums[block] = 0;
        for (size_t v = first; v < last; v++) {
            for (size_t t = 0; t < s->frame_count; t++)
                for (size_t i = t * row + 3 * v; i < t * row + 3 * v + 3; i++) {
                    w->step[i] += w->by * w->direction[i];
                    w->right[i] -= w->by * w->image[i];
                }
            precondition(line, w, v);
            for (size_t t = 0; t < s->frame_count; t++)
                for (size_t k = 0; k < 3; k++) {
                    size_t i = t * row + 3 * v + k;
                    w->image[i] = (float)line[3 * t + k];
                    w->sums[block] += (double)w->image[i] * (double)w->right[i];
                }
        }
    }
    npg_release(&line);
    return NPG_OK;
}

static double sum_of(const double *values, size_t count)
{
    double sum = 0;
    for (size_t i = 0; i < count; i++) sum += values[i];
    return sum;
}

static npg_status iterate(work *w, npg_solved *solved, int64_t most, npg_solver_watch *watch, void *user)
{
    const npg_energy_system *s = w->s;
    size_t count = 3 * s->frame_count * s->vert_count;
    int64_t *taken = &solved->steps;
    NPG_TRY(npg_parallel(move_blocks, w, w->threads)); /* by 0: the first preconditioned residual */
    double start = sum_of(w->sums, BLOCKS), now = start, goal = NPG_SETTLED * NPG_SETTLED * start, share = 0;
    for (*taken = 0; *taken < most && now > goal; ++*taken) {
        for (size_t i = 0; i < count; i++) w->direction[i] = w->image[i] + (float)share * w->direction[i];
        NPG_TRY(npg_parallel(multiply_frames, w, w->threads));
        double along = sum_of(w->frame_sums, s->frame_count), before = now;
        if (!(along > 0)) break;
        w->by = (float)(now / along);
        w->gained += now * now / along;
        NPG_TRY(npg_parallel(move_blocks, w, w->threads));
        now = sum_of(w->sums, BLOCKS);
        share = now / before;
        const npg_solver_step step = {*taken, most, sqrt(fmax(0, now) / start)};
        if (watch) NPG_TRY(watch(user, &step));
    }
    return NPG_OK;
}

/* ---- the solver ---- */

static npg_status joint_solve(void *solver, npg_solved *solved, const npg_problem *problem,
                              npg_solver_watch *watch, void *user)
{
    (void)solver;
    const npg_energy_system *s = npg_energy_system_of(problem->energy);
    size_t count = s->frame_count * s->vert_count, vector = 3 * sizeof(float);
    npg_arena arena = {.purpose = NPG_FOR_FIT};
    work w = {.s = s,
              .threads = npg_parallel_parts(s->frame_count, 1, BLOCKS),
              .step = problem->result,
              .right = s->right,
              .factors = npg_arena_take(&arena, count, vector),
              .direction = npg_arena_take(&arena, count, vector),
              .image = npg_arena_take(&arena, count, vector),
              .frame_sums = npg_arena_take(&arena, s->frame_count, sizeof(double))};
    npg_status status = npg_arena_status(&arena);
    memset(w.step, 0, count * vector);
    if (!status) status = npg_parallel(gather_diagonals, &w, w.threads);
    if (!status) status = npg_parallel(factor_vertices, &w, w.threads);
    if (!status) status = iterate(&w, solved, problem->settings->epochs, watch, user);
    double at_start = npg_energy_at_start(problem->energy);
    solved->energy = at_start > 0 ? 1 - w.gained / at_start : 1;
    npg_arena_release(&arena);
    return status;
}

static size_t joint_memory(const npg_solver_settings *settings, size_t verts, size_t frames, size_t points)
{
    (void)settings;
    (void)points;
    return frames * verts * 9 * sizeof(float);
}

const npg_solver npg_solver_joint = {
    .name = "joint",
    .needs_poses = true,
    .solve = joint_solve,
    .memory = joint_memory,
};
