/* Window: solving one, from aligned frames or as in the paper. */
#include "optimize/window.h"

#include <math.h>
#include <string.h>

#include "pipeline/parallel.h"

#define MATCHERS_MAX 8

struct npg_window_solver {
    npg_window_settings settings;
    const npg_facts *facts; /* loan */
    bool is_aligned;
    npg_fit *fit;
    npg_warm *warm; /* of windows without alignment, or NULL */
    npg_carry *carry;
    npg_matcher *matchers[MATCHERS_MAX]; /* each for a frame at a time */
    size_t matcher_count;
    float *surfaces;   /* per matcher W x 3 */
    npg_figure figure; /* of the reference  */
    /* of the window at work, owned */
    float *points;       /* all frames' points in units     */
    size_t *point_start; /* count + 1                       */
    float *bases, *now;  /* count x S x 3                   */
    float *fit_bases;    /* the bases in figure coordinates */
    npg_figure *figures; /* of the frames                   */
    float *dense;        /* V x 3                           */
    npg_pull *pulls;
    size_t *pull_start;
    npg_fit_frame *frames;
    size_t count;
};

size_t npg_window_sample_count(const npg_window_solver *solver)
{
    return solver->carry ? solver->carry->samples->mesh->vert_count : solver->facts->reference->vert_count;
}

npg_fit *npg_window_fit(npg_window_solver *solver)
{
    return solver->fit;
}

const npg_carry *npg_window_carry(const npg_window_solver *solver)
{
    return solver->carry;
}

npg_warm *npg_window_warm(npg_window_solver *solver)
{
    return solver->warm;
}

static void close_frames(npg_window_solver *s)
{
    void *all[] = {&s->points, &s->point_start, &s->bases,  &s->now,       &s->dense,
                   &s->pulls,  &s->pull_start,  &s->frames, &s->fit_bases, &s->figures};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) npg_release(all[i]);
}

void npg_window_solver_close(npg_window_solver **slot)
{
    if (!slot || !*slot) return;
    close_frames(*slot);
    npg_fit_close(&(*slot)->fit);
    npg_warm_close(&(*slot)->warm);
    for (size_t m = 0; m < MATCHERS_MAX; m++) npg_matcher_close(&(*slot)->matchers[m]);
    npg_release(&(*slot)->surfaces);
    npg_carry_close(&(*slot)->carry);
    npg_release(slot);
}

npg_figure npg_window_figure(const npg_window_solver *solver)
{
    return solver->figure;
}

/* ---- figure coordinates ---- */

void npg_figure_centre(double centre[3], const float *samples, size_t count)
{
    memset(centre, 0, 3 * sizeof *centre);
    for (size_t i = 0; i < 3 * count; i++) centre[i % 3] += (double)samples[i] / (double)count;
}

void npg_figure_from_unit(const npg_figure *figure, float *out, const float *unit, size_t count)
{
    for (size_t i = 0; i < 3 * count; i++)
        out[i] = (float)(((double)unit[i] - figure->centre[i % 3]) * figure->scale);
}

void npg_figure_to_unit(const npg_figure *figure, float *out, const float *points, size_t count)
{
    for (size_t i = 0; i < 3 * count; i++)
        out[i] = (float)((double)points[i] / figure->scale + figure->centre[i % 3]);
}

static npg_figure figure_of(const npg_mesh *mesh)
{
    npg_figure figure = {.scale = 1};
    npg_bounds bounds = npg_bounds_empty();
    npg_bounds_add_points(&bounds, mesh->vert_pos, mesh->vert_count);
    double longest = npg_bounds_longest(&bounds);
    for (int a = 0; a < 3; a++) figure.centre[a] = 0.5 * (bounds.lo[a] + bounds.hi[a]);
    if (longest > 0) figure.scale = 2 * NPG_UNIT_EXTENT / longest;
    return figure;
}

/* A fit over the samples, moved into figure coordinates. */
static npg_status open_aligned_fit(npg_window_solver *s, npg_device *device, uint64_t seed)
{
    npg_mesh *mesh;
    const npg_mesh *samples = s->carry->samples->mesh;
    s->figure = figure_of(samples);
    NPG_TRY(npg_mesh_copy(&mesh, samples));
    npg_figure_from_unit(&s->figure, mesh->vert_pos, samples->vert_pos, samples->vert_count);
    npg_status status = npg_fit_open(&s->fit, device, &s->settings.fit, mesh, seed);
    npg_mesh_unref(&mesh);
    return status;
}

static size_t matcher_count(void)
{
    return npg_parallel_parts(MATCHERS_MAX, 1, MATCHERS_MAX);
}

static npg_status open_matchers(npg_window_solver *s)
{
    size_t count = matcher_count();
    NPG_TRY(npg_alloc_array(&s->surfaces, NPG_FOR_FIT, count * s->carry->surface->mesh->vert_count,
                            3 * sizeof(float)));
    for (; s->matcher_count < count; s->matcher_count++)
        NPG_TRY(npg_matcher_open(&s->matchers[s->matcher_count], s->carry, &s->settings.match));
    return NPG_OK;
}

npg_status npg_window_solver_open(npg_window_solver **out, npg_device *device,
                                  const npg_window_settings *settings, const npg_facts *facts, uint64_t seed,
                                  bool is_aligned)
{
    npg_window_solver *s;
    *out = NULL;
    NPG_TRY(npg_alloc(&s, NPG_FOR_FIT, sizeof *s));
    s->settings = *settings;
    s->facts = facts;
    s->is_aligned = is_aligned;
    if (is_aligned) {
        s->settings.fit.grid_rate *= settings->aligned_rate;
        s->settings.fit.mlp_rate *= settings->aligned_rate;
    }
    npg_status status = NPG_OK;
    if (is_aligned)
        status = npg_carry_open(&s->carry, facts->reference, (size_t)settings->samples, NPG_THIN_SURFACE);
    if (is_aligned && !status) status = open_matchers(s);
    s->figure = (npg_figure){.scale = 1};
    if (!status)
        status = is_aligned ? open_aligned_fit(s, device, seed)
                            : npg_fit_open(&s->fit, device, &s->settings.fit, facts->reference, seed);
    if (!status && !is_aligned)
        status = npg_warm_open(&s->warm, device, &s->settings.warm, &s->settings.fit, &s->settings.match,
                               (size_t)settings->samples, settings->rounds, facts, seed);
    if (status) npg_window_solver_close(&s);
    *out = s;
    return status;
}

#define UNITS 2 /* of the device, whose scratch memory counts: on more the drivers' own counts more */

/* A surface's copy, its search tree and what a matcher keeps per vertex. */
#define SURFACE_BYTES 400

size_t npg_window_memory(const npg_window_settings *settings, bool is_aligned, size_t vert_count,
                         size_t frames, size_t points)
{
    const size_t vector = 3 * sizeof(float);
    size_t all = (size_t)settings->samples ? (size_t)settings->samples : vert_count;
    size_t samples = all + all / 10 + 16, looked_at = (size_t)settings->match.points;
    size_t solved = frames * vert_count * vector, clouds = frames * points * vector;
    if (!is_aligned)
        return npg_fit_memory(&settings->fit, vert_count, frames, points, UNITS) + solved + clouds +
               npg_warm_memory(&settings->warm, &settings->fit, &settings->match, (size_t)settings->samples,
                               vert_count, frames);
    if (samples > vert_count) samples = vert_count;
    size_t surface = vert_count < 2 * NPG_THIN_SURFACE ? vert_count : NPG_THIN_SURFACE;
    size_t pulls = frames * (looked_at + 2 * samples) * sizeof(npg_pull);
    return npg_fit_memory(&settings->fit, samples, frames, looked_at, UNITS) + solved + clouds + 2 * pulls +
           4 * frames * samples * vector + vert_count * (sizeof(npg_carrier) + vector) +
           (1 + matcher_count()) * surface * SURFACE_BYTES;
}

/* ---- the window's frames ---- */

static npg_status take_points(npg_window_solver *s, npg_held *const *held)
{
    NPG_TRY(npg_alloc_array(&s->point_start, NPG_FOR_FIT, s->count + 1, sizeof *s->point_start));
    for (size_t i = 0; i < s->count; i++)
        s->point_start[i + 1] = s->point_start[i] + held[i]->frame.point_count;
    NPG_TRY(npg_alloc_array(&s->points, NPG_FOR_FIT, s->point_start[s->count] + 1, 3 * sizeof(float)));
    for (size_t i = 0; i < s->count; i++)
        npg_box_local_to_unit(&s->facts->box, s->points + 3 * s->point_start[i], held[i]->frame.pos_local,
                              held[i]->frame.point_count);
    return NPG_OK;
}

double npg_window_time(const npg_plan *plan, double index)
{
    npg_window first = npg_plan_key_window(plan);
    int64_t length = first.last - first.first;
    return length ? (index - (double)first.first) / (double)length : 0;
}

static npg_status open_frames(npg_window_solver *s, npg_held *const *held, size_t count)
{
    size_t size = 3 * npg_window_sample_count(s), verts = s->facts->reference->vert_count;
    close_frames(s);
    s->count = count;
    NPG_TRY(take_points(s, held));
    NPG_TRY(npg_alloc_array(&s->frames, NPG_FOR_FIT, count, sizeof *s->frames));
    NPG_TRY(npg_alloc_array(&s->now, NPG_FOR_FIT, count, size * sizeof(float)));
    NPG_TRY(npg_alloc_array(&s->dense, NPG_FOR_FIT, verts, 3 * sizeof(float)));
    if (s->is_aligned) {
        NPG_TRY(npg_alloc_array(&s->bases, NPG_FOR_FIT, count, size * sizeof(float)));
        NPG_TRY(npg_alloc_array(&s->fit_bases, NPG_FOR_FIT, count, size * sizeof(float)));
        NPG_TRY(npg_alloc_array(&s->figures, NPG_FOR_FIT, count, sizeof *s->figures));
    }
    for (size_t i = 0; i < count; i++) {
        const npg_frame *frame = &held[i]->frame;
        if (s->is_aligned) {
            float *base = s->bases + i * size;
            npg_carry_gather(s->carry, base, frame->vert_unit);
            s->figures[i].scale = s->figure.scale;
            npg_figure_centre(s->figures[i].centre, base, size / 3);
            npg_figure_from_unit(&s->figures[i], s->fit_bases + i * size, base, size / 3);
        }
        s->frames[i] = (npg_fit_frame){.index = frame->index,
                                       .time = npg_window_time(&s->facts->plan, (double)frame->index),
                                       .points = s->points + 3 * s->point_start[i],
                                       .count = frame->point_count,
                                       .base = s->is_aligned ? s->fit_bases + i * size : NULL};
    }
    return NPG_OK;
}

/* ---- aligned frames ---- */

/* Where the samples now carry the surface that points are matched with (W x 3). */
static void carry_surface(const npg_window_solver *s, float *surface, const npg_frame *frame, size_t i)
{
    size_t size = 3 * npg_window_sample_count(s);
    npg_thin_gather(s->carry->surface, surface, frame->vert_unit);
    npg_carriers_move(s->carry->surface_carriers, s->carry->surface->mesh->vert_count, surface,
                      s->bases + i * size, s->now + i * size);
}

/* Where they carry every vertex. */
static void carry_dense(npg_window_solver *s, const npg_frame *frame, size_t i)
{
    size_t size = 3 * npg_window_sample_count(s);
    memcpy(s->dense, frame->vert_unit, s->carry->vert_count * 3 * sizeof(float));
    npg_carriers_move(s->carry->carriers, s->carry->vert_count, s->dense, s->bases + i * size,
                      s->now + i * size);
}

static npg_status read_samples(npg_window_solver *s)
{
    size_t size = 3 * npg_window_sample_count(s);
    for (size_t i = 0; i < s->count; i++) {
        float *now = s->now + i * size;
        NPG_TRY(npg_fit_vertices(s->fit, now, i));
        if (s->is_aligned) npg_figure_to_unit(&s->figures[i], now, now, size / 3);
    }
    return NPG_OK;
}

/* sum share x + constant, in unit coordinates, becomes scale times that in figure coordinates; the shares of
 * a pull sum up to 1. */
static void move_pulls(const npg_figure *figure, npg_pull *pulls, size_t count)
{
    for (size_t i = 0; i < count; i++)
        for (int a = 0; a < 3; a++)
            pulls[i].constant[a] =
                (float)(((double)pulls[i].constant[a] + figure->centre[a]) * figure->scale);
}

typedef struct matching {
    npg_window_solver *s;
    npg_held *const *held;
    size_t most;    /* pulls of a frame, whose own begin at i * most */
    size_t *counts; /* of the frames' pulls                          */
} matching;

static npg_status match_frame(const matching *m, size_t i, npg_matcher *matcher, float *surface)
{
    const npg_window_solver *s = m->s;
    const npg_frame *frame = &m->held[i]->frame;
    size_t size = 3 * npg_window_sample_count(s);
    npg_pull *pulls = s->pulls + i * m->most;
    m->counts[i] = 0;
    carry_surface(s, surface, frame, i);
    NPG_TRY(npg_match_points(matcher, pulls, &m->counts[i], surface, s->now + i * size,
                             s->points + 3 * s->point_start[i], frame->normals, frame->point_count));
    if (m->held[i]->solved) {
        npg_carry_gather(s->carry, surface, m->held[i]->solved); /* no more than W */
        npg_match_tie(matcher, pulls, &m->counts[i], surface);
    }
    move_pulls(&s->figures[i], pulls, m->counts[i]);
    return NPG_OK;
}

static npg_status match_share(void *user, size_t part)
{
    const matching *m = user;
    npg_window_solver *s = m->s;
    float *surface = s->surfaces + 3 * part * s->carry->surface->mesh->vert_count;
    for (size_t i = part; i < s->count; i += s->matcher_count)
        NPG_TRY(match_frame(m, i, s->matchers[part], surface));
    return NPG_OK;
}

/* Pulls of all frames at the samples' present positions; several frames at a time. */
static npg_status match_all(npg_window_solver *s, npg_held *const *held)
{
    matching m = {s, held, npg_matcher_most(s->matchers[0]), NULL};
    npg_release(&s->pulls);
    npg_release(&s->pull_start);
    NPG_TRY(npg_alloc_array(&s->pulls, NPG_FOR_FIT, s->count * m.most, sizeof *s->pulls));
    NPG_TRY(npg_alloc_array(&s->pull_start, NPG_FOR_FIT, s->count + 1, sizeof *s->pull_start));
    m.counts = s->pull_start + 1;
    NPG_TRY(npg_parallel(match_share, &m, s->matcher_count));
    for (size_t i = 0; i < s->count; i++) { /* one behind the other */
        memmove(s->pulls + s->pull_start[i], s->pulls + i * m.most, m.counts[i] * sizeof *s->pulls);
        s->pull_start[i + 1] += s->pull_start[i];
    }
    return npg_fit_set_pulls(s->fit, s->pulls, s->pull_start);
}

static npg_status run_rounds(npg_window_solver *s, npg_held *const *held, npg_fit_watch *watch, void *user)
{
    int64_t epochs = s->settings.fit.epochs, rounds = s->settings.rounds;
    NPG_TRY(npg_fit_run(s->fit, 0, 0, NULL, NULL)); /* where the last window's decoder puts these frames */
    for (int64_t round = 0; round < rounds; round++) {
        NPG_TRY(read_samples(s));
        NPG_TRY(match_all(s, held));
        NPG_TRY(npg_fit_run(s->fit, round * epochs / rounds, (round + 1) * epochs / rounds, watch, user));
    }
    return read_samples(s);
}

double npg_window_share(const npg_window *window, double index)
{
    double first = (double)window->new_first, last = (double)window->new_last;
    if (!window->direction || (index >= first && index <= last)) return 1;
    int64_t overlap =
        window->direction > 0 ? window->new_first - window->first : window->last - window->new_last;
    double away = window->direction > 0 ? first - index : index - last;
    return fmin(1, fmax(0, ((double)overlap + 1 - away) / (double)(overlap + 1)));
}

static npg_status keep_solved(npg_held *held, const float *dense, size_t verts, float share)
{
    if (!held->solved) {
        NPG_TRY(npg_alloc_array(&held->solved, NPG_FOR_FRAMES, verts, 3 * sizeof(float)));
        memcpy(held->solved, dense, verts * 3 * sizeof(float));
        return NPG_OK;
    }
    for (size_t i = 0; i < 3 * verts; i++) held->solved[i] += share * (dense[i] - held->solved[i]);
    return NPG_OK;
}

/* Frames without alignment. */
static npg_status solve_unaligned(npg_window_solver *s, npg_held *const *held, const npg_window *window,
                                  npg_fit_watch *watch, void *user)
{
    const float **both;
    NPG_TRY(npg_alloc_array(&both, NPG_FOR_FIT, 2 * s->count, sizeof *both));
    for (size_t i = 0; i < s->count; i++) {
        both[i] = held[i]->frame.normals;
        both[s->count + i] = held[i]->solved;
    }
    const npg_warm_frames frames = {s->frames, both, both + s->count, s->count};
    npg_status status = npg_warm_solve(s->warm, s->fit, &frames, window, watch, user);
    npg_release(&both);
    return status;
}

npg_status npg_window_solve(npg_window_solver *s, npg_held *const *held, const npg_window *window,
                            npg_fit_watch *watch, void *user)
{
    size_t verts = s->facts->reference->vert_count, size = 3 * npg_window_sample_count(s);
    NPG_TRY(open_frames(s, held, (size_t)(window->last - window->first + 1)));
    if (s->is_aligned) {
        NPG_TRY(npg_fit_begin(s->fit, s->frames, s->count, s->facts->plan.key));
        NPG_TRY(run_rounds(s, held, watch, user));
    } else {
        NPG_TRY(solve_unaligned(s, held, window, watch, user));
        NPG_TRY(read_samples(s));
    }
    for (size_t i = 0; i < s->count; i++) {
        if (s->is_aligned) carry_dense(s, &held[i]->frame, i);
        NPG_TRY(keep_solved(held[i], s->is_aligned ? s->dense : s->now + i * size, verts,
                            (float)npg_window_share(window, (double)held[i]->frame.index)));
    }
    close_frames(s);
    return NPG_OK;
}
