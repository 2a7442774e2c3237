/* Grids: the energy's least over fields: latent grids and decoder give the ways of few vertices of the surface
 * from the smoothed poses, and these carry the others.
 *
 *     d(v, .) = a(v, .) + c sum_i b_i(v) (D_i + lambda_i B)^-1 D_i f(i, .)
 *     E(s + d) = E(s) + d^T A d - 2 r^T d
 *
 * a: what poses and motion still ask of each vertex alone, points and edges holding against it: steps
 * (D + lambda B)^-1 times their part of -gradient / 2 (npg_energy_even()), as long as E falls.
 * c: the noise of the points, so that the field's values are of one size; D_i + lambda_i B: what A has of vertex i
 * alone, so that ways are as even in time as its motion is, whatever frequencies the field has (as the latent
 * grids are in space).  A window starts at a: the decoder's head is zero, and what the layers
 * before it and the grids learnt in the window before stays.  The state of least energy is kept, and goes as far
 * along its way as is best. */
#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "job/vdb_file.h"
#include "optimize/carry.h"
#include "optimize/grids/fit.h"
#include "optimize/grids/vdb_grids.h"
#include "pipeline/parallel.h"

#define SAMPLES       1500 /* vertices that the field moves */
#define FEATURE_START 3
#define NOISE_USUAL   0.01 /* units: of a capture that the learning rates were found with */
#define THREADS_MAX   64

typedef struct grids {
    const npg_facts *facts; /* loan */
    int64_t epochs;
    npg_proxy *samples;      /* S vertices of the surface; owned */
    size_t vert_count;       /* W                                */
    npg_surface_hit *places; /* W: on these; owned             */
    npg_fit *fit;            /* over the samples                 */
    /* of the window at work */
    npg_energy_system *system; /* loan                                           */
    double at_start, least;    /* E(s), and the least so far                     */
    float scale;               /* of ways to the field's values: rates are for those of the usual noise */
    size_t threads;
    float *diagonal;            /* T x W: D                                       */
    float *base;                /* T x W x 3: a                                   */
    float *gradient;            /* T x S x 3; scratch until it is there; loan     */
    const float *from;          /* T x S x 3: f, or the gradient by d; loan       */
    float *ways, *image, *best; /* T x W x 3: d, A d, and the best d so far      */
    double *sums;               /* T x 2: d A d, r d                              */
    npg_arena window;           /* holds these                                    */
    npg_solver_watch *watch;
    void *user;
} grids;

static void grids_close(void **slot)
{
    grids *g = *slot;
    npg_arena_release(&g->window);
    npg_fit_close(&g->fit);
    npg_proxy_close(&g->samples);
    npg_release(&g->places);
    npg_release(slot);
}

static npg_fit_settings settings_of(const npg_solver_settings *settings)
{
    return (npg_fit_settings){.grid = settings->grid,
                              .is_of_ways = true,
                              .rate_end = NPG_GRIDS_RATE_END,
                              .feature_start = FEATURE_START};
}

static npg_status grids_open(void **out, const npg_solver_setup *setup)
{
    grids *g;
    const npg_fit_settings settings = settings_of(setup->settings);
    const npg_mesh *surface = setup->surface;
    NPG_TRY(npg_alloc(&g, NPG_FOR_FIT, sizeof *g));
    *out = g;
    g->facts = setup->facts;
    g->epochs = setup->settings->epochs;
    g->window.purpose = NPG_FOR_FIT;
    g->vert_count = surface->vert_count;
    NPG_TRY(npg_proxy_open(&g->samples, surface, SAMPLES));
    NPG_TRY(npg_alloc_array(&g->places, NPG_FOR_FIT, g->vert_count, sizeof *g->places));
    NPG_TRY(npg_mesh_closest(g->places, g->samples->mesh, surface->vert_pos, g->vert_count));
    return npg_fit_open(&g->fit, setup->device, &settings, g->samples->mesh, setup->seed);
}

/* ---- the energy ---- */

/* line (T x 3) = (D + lambda B)^-1 line, of vertex v.  band: room for T rows. */
static void even_line(const grids *g, npg_band *band, double *line, size_t v)
{
    npg_energy_band(band, g->system, v, g->diagonal + v, g->vert_count);
    for (size_t axis = 0; axis < 3; axis++) npg_band_solve(band, line + axis, 3);
}

/* `gradient` = (D + lambda B)^-1 D times the field's ways, or where it is the energy's by d the transpose. */
static npg_status even_vertices(void *user, size_t part)
{
    grids *g = user;
    size_t n = g->system->frame_count, row = 3 * g->samples->mesh->vert_count;
    double *memory;
    NPG_TRY(npg_alloc_array(&memory, NPG_FOR_FIT, 7 * n, sizeof *memory));
    npg_band band = {n, memory, memory + n, memory + 2 * n};
    double *line = memory + 3 * n, *by = line + 3 * n;
    for (size_t i = part; i < row / 3; i += g->threads) {
        const float *diagonal = g->diagonal + g->samples->vertex[i], *from = g->from + 3 * i;
        float *to = g->gradient + 3 * i;
        for (size_t t = 0; t < n; t++) by[t] = (double)(g->scale * diagonal[t * g->vert_count]);
        for (size_t k = 0; k < 3 * n; k++)
            line[k] = (to == from ? 1 : by[k / 3]) * (double)from[k / 3 * row + k % 3];
        even_line(g, &band, line, g->samples->vertex[i]);
        for (size_t k = 0; k < 3 * n; k++)
            to[k / 3 * row + k % 3] = (float)((to == from ? by[k / 3] : 1) * line[k]);
    }
    npg_release(&memory);
    return NPG_OK;
}

static npg_status carry_frames(void *user, size_t part)
{
    grids *g = user;
    size_t w = 3 * g->vert_count, s = 3 * g->samples->mesh->vert_count;
    for (size_t t = part; t < g->system->frame_count; t += g->threads) {
        memcpy(g->ways + t * w, g->base + t * w, w * sizeof(float));
        npg_carry(g->ways + t * w, g->samples->mesh, g->places, g->vert_count, g->gradient + t * s);
    }
    return NPG_OK;
}

/* image = A d, and the frames' shares of d A d and r d. */
static npg_status measure_frames(void *user, size_t part)
{
    grids *g = user;
    size_t w = 3 * g->vert_count;
    for (size_t t = part; t < g->system->frame_count; t += g->threads) {
        const float *way = g->ways + t * w, *right = g->system->right + t * w, *image = g->image + t * w;
        double *sums = g->sums + 2 * t;
        npg_energy_multiply(g->image, g->system, g->ways, t);
        sums[0] = sums[1] = 0;
        for (size_t i = 0; i < w; i++) {
            sums[0] += (double)way[i] * (double)image[i];
            sums[1] += (double)way[i] * (double)right[i];
        }
    }
    return NPG_OK;
}

static npg_status carry_back(void *user, size_t part)
{
    grids *g = user;
    size_t w = 3 * g->vert_count, s = 3 * g->samples->mesh->vert_count;
    for (size_t t = part; t < g->system->frame_count; t += g->threads) {
        const float *right = g->system->right + t * w;
        float *image = g->image + t * w;
        for (size_t i = 0; i < w; i++) image[i] = 2 * (image[i] - right[i]);
        memset(g->gradient + t * s, 0, s * sizeof(float));
        npg_carry_back(g->gradient + t * s, g->samples->mesh, g->places, g->vert_count, image);
    }
    return NPG_OK;
}

/* E(s + d); *along = r d, *bent = d A d. */
static npg_status measure_ways(grids *g, double *loss, double *bent, double *along)
{
    *bent = *along = 0;
    NPG_TRY(npg_parallel(measure_frames, g, g->threads));
    for (size_t t = 0; t < g->system->frame_count; t++) {
        *bent += g->sums[2 * t];
        *along += g->sums[2 * t + 1];
    }
    *loss = g->at_start + *bent - 2 * *along;
    return NPG_OK;
}

static void take_best(grids *g, double energy, double share)
{
    g->least = energy;
    for (size_t i = 0; i < g->system->frame_count * 3 * g->vert_count; i++)
        g->best[i] = (float)share * g->ways[i];
}

static npg_status measure(void *user, double *loss, float *gradient, const float *field)
{
    grids *g = user;
    double bent, along;
    g->gradient = gradient;
    g->from = field;
    NPG_TRY(npg_parallel(even_vertices, g, g->threads));
    NPG_TRY(npg_parallel(carry_frames, g, g->threads));
    NPG_TRY(measure_ways(g, loss, &bent, &along));
    NPG_TRY(npg_parallel(carry_back, g, g->threads));
    g->from = gradient;
    NPG_TRY(npg_parallel(even_vertices, g, g->threads));
    double share = bent > 0 ? fmax(0, along / bent) : 0; /* of the way, where E is least on it */
    if (g->at_start - share * along < g->least) take_best(g, g->at_start - share * along, share);
    return NPG_OK;
}

/* ---- the base ---- */

/* d = the best so far and a step of (D + lambda B)^-1. */
static npg_status step_vertices(void *user, size_t part)
{
    grids *g = user;
    size_t n = g->system->frame_count, row = 3 * g->vert_count;
    double *memory;
    NPG_TRY(npg_alloc_array(&memory, NPG_FOR_FIT, 6 * n, sizeof *memory));
    npg_band band = {n, memory, memory + n, memory + 2 * n};
    double *line = memory + 3 * n;
    for (size_t v = part; v < g->vert_count; v += g->threads) {
        for (size_t k = 0; k < 3 * n; k++) line[k] = (double)g->image[k / 3 * row + 3 * v + k % 3];
        even_line(g, &band, line, v);
        for (size_t k = 0; k < 3 * n; k++) {
            size_t at = k / 3 * row + 3 * v + k % 3;
            g->ways[at] = g->best[at] + (float)line[k];
        }
    }
    npg_release(&memory);
    return NPG_OK;
}

static npg_status find_base(grids *g, const npg_energy *energy)
{
    size_t row = 3 * g->vert_count;
    double loss, bent, along;
    for (;;) {
        for (size_t t = 0; t < g->system->frame_count; t++)
            npg_energy_even(g->image + t * row, energy, g->best, t);
        NPG_TRY(npg_parallel(step_vertices, g, g->threads));
        NPG_TRY(measure_ways(g, &loss, &bent, &along));
        if (!(loss < g->least)) break;
        take_best(g, loss, 1);
    }
    memcpy(g->base, g->best, g->system->frame_count * row * sizeof *g->base);
    return NPG_OK;
}

/* ---- a window ---- */

static npg_status watch_epoch(void *user, const npg_fit_step *step)
{
    const grids *g = user;
    const npg_solver_step at = {step->epoch, step->epochs, step->loss};
    return g->watch ? g->watch(g->user, &at) : NPG_OK;
}

double npg_grids_time(const npg_plan *plan, double span, int64_t index)
{
    npg_window first = npg_plan_key_window(plan, -1);
    int64_t length = first.last - first.first;
    return length ? span * (double)(index - first.first) / (double)length : 0;
}

static npg_status begin(grids *g, const npg_problem *problem)
{
    npg_fit_frame *frames;
    npg_fit_rest(g->fit);
    NPG_TRY(npg_alloc_array(&frames, NPG_FOR_FIT, problem->count, sizeof *frames));
    for (size_t t = 0; t < problem->count; t++)
        frames[t] = (npg_fit_frame){
            .index = problem->frames[t].index,
            .time = npg_grids_time(&g->facts->plan, NPG_GRIDS_SPAN, problem->frames[t].index)};
    npg_status status = npg_fit_begin(g->fit, frames, problem->count, frames[0].index, measure, g);
    npg_release(&frames);
    return status;
}

/* The result is the best so far from the beginning on: none. */
static npg_status take_window(grids *g, const npg_problem *problem)
{
    size_t count = problem->count, wide = count * g->vert_count;
    g->system = npg_energy_system_of(problem->energy);
    g->at_start = g->least = npg_energy_at_start(problem->energy);
    g->threads = npg_parallel_parts(count, 1, THREADS_MAX);
    g->scale = (float)(npg_energy_noise(problem->energy) / NOISE_USUAL);
    g->diagonal = npg_arena_take(&g->window, wide, sizeof(float));
    g->base = npg_arena_take(&g->window, wide, 3 * sizeof(float));
    g->ways = npg_arena_take(&g->window, wide, 3 * sizeof(float));
    g->image = npg_arena_take(&g->window, wide, 3 * sizeof(float));
    g->sums = npg_arena_take(&g->window, 2 * count, sizeof(double));
    g->best = problem->result;
    memset(g->best, 0, 3 * wide * sizeof(float));
    NPG_TRY(npg_arena_status(&g->window));
    for (size_t t = 0; t < count; t++) npg_energy_diagonal(g->diagonal + t * g->vert_count, 1, g->system, t);
    return find_base(g, problem->energy);
}

static npg_status grids_solve(void *solver, npg_solved *solved, const npg_problem *problem,
                              npg_solver_watch *watch, void *user)
{
    grids *g = solver;
    g->watch = watch;
    g->user = user;
    npg_status status = take_window(g, problem);
    if (!status) status = begin(g, problem);
    if (!status) status = npg_fit_run(g->fit, 0, g->epochs, watch_epoch, g);
    *solved = (npg_solved){.steps = g->epochs, .energy = g->at_start > 0 ? g->least / g->at_start : 1};
    npg_arena_release(&g->window);
    return status;
}

static size_t grids_memory(const npg_solver_settings *settings, size_t verts, size_t frames, size_t points)
{
    const npg_fit_settings fit = settings_of(settings);
    size_t samples = verts < 2 * SAMPLES ? verts : SAMPLES;
    (void)points;
    return npg_fit_memory(&fit, samples, frames, 0) + frames * verts * 10 * sizeof(float) +
           verts * sizeof(npg_surface_hit);
}

/* ---- states ---- */

typedef struct latent_grids {
    const npg_levels *levels;
    const float *rows;
    npg_vdb_place place;
} latent_grids;

static npg_status write_latents(void *user, const char *path)
{
    const latent_grids *g = user;
    return npg_vdb_save_levels(path, g->levels, g->rows, &g->place);
}

/* The latent grids for other programs, in a file beside the store; the state itself has them, too. */
static npg_status put_latents(npg_fit *fit, const npg_facts *facts, npg_store *store,
                              const npg_solver_moment *moment)
{
    npg_fit_parts parts = npg_fit_open_parts(fit);
    const npg_frame_box *box = &facts->box;
    float *rows;
    uint64_t hash;
    NPG_TRY(npg_alloc(&rows, NPG_FOR_FILES, parts.u->size));
    latent_grids g = {parts.levels,
                      rows,
                      {.unit_per_world = box->scale,
                       .frame_first = moment->window.first,
                       .frame_last = moment->window.last,
                       .window = moment->at}};
    for (int a = 0; a < 3; a++) g.place.world_centre[a] = box->origin[a] + box->centre[a];
    npg_status status = npg_buffer_read(parts.u, 0, rows, parts.u->size);
    if (!status) status = npg_vdb_file_write(moment->grids_path, &hash, write_latents, &g);
    if (!status) status = npg_store_put(store, "grids.hash", &hash, sizeof hash);
    npg_release(&rows);
    return status;
}

npg_status npg_grids_save(npg_fit *fit, const npg_facts *facts, npg_store *store,
                          const npg_solver_moment *moment)
{
    if (!moment->is_inside) NPG_TRY(put_latents(fit, facts, store, moment));
    return npg_fit_save(fit, store);
}

static npg_status grids_save(void *solver, npg_store *store, const npg_solver_moment *moment)
{
    grids *g = solver;
    return npg_grids_save(g->fit, g->facts, store, moment);
}

static npg_status grids_restore(void *solver, const npg_record *record)
{
    grids *g = solver;
    return npg_fit_restore(g->fit, record);
}

const npg_solver npg_solver_grids = {
    .name = "grids",
    .needs_device = true,
    .needs_poses = true,
    .open = grids_open,
    .solve = grids_solve,
    .memory = grids_memory,
    .save = grids_save,
    .restore = grids_restore,
    .close = grids_close,
};
