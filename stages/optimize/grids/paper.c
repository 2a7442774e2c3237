/* Paper: the field from the reference itself, by the paper's robust Chamfer distance over all vertices.
 *
 * All frames at once are solved as in the paper.  For more it has nothing, and windows start from poses: the tracker
 * follows the surface outward from the keyframe, or from the last frame that the window before has solved, and in
 * each frame the field turns and moves the surface as that has it, not the reference.  It is at rest in the
 * beginning, its grids and layers being those of the window before; frames that are solved are tied to where they
 * are.  Such frames need no gate, and rates fall. */
#include <string.h>

#include "geometry/geometry.h"
#include "optimize/grids/fit.h"
#include "track/track.h"

/* As stage align has them. */
static const npg_tracker_settings tracking = {
    .nodes = 1600, .samples = 5000, .steps = 12, .stiffness = 0.006, .along = 0.001};

/* Adam's steps keep their length, and what the last one leaves is one draw of many: the result is the state of
 * least loss. */
typedef struct progress {
    int64_t next; /* epoch, 0 at the beginning */
    npg_solved least;
    double loss; /* of that state, without the confidence */
} progress;

typedef struct paper {
    const npg_facts *facts; /* loan */
    npg_solver_settings settings;
    npg_fit *fit; /* over all vertices */
    progress at;  /* of the window at work, or that a resumed run goes on from inside its own */
    float *best;  /* T x V x 3: where that state had the frames, owned                         */
    float *poses; /* T x V x 3: where the tracker has them, owned; NULL of a window alone      */
    size_t best_size;
    npg_follower follower; /* over the reference, unless a window is alone */
    /* of the window at work */
    const npg_problem *problem; /* loan */
    npg_solver_watch *watch;
    void *user;
} paper;

static void paper_close(void **slot)
{
    paper *p = *slot;
    npg_fit_close(&p->fit);
    npg_release(&p->best);
    npg_release(&p->poses);
    npg_follower_close(&p->follower);
    npg_release(slot);
}

static npg_fit_settings settings_of(const npg_solver_settings *s)
{
    return (npg_fit_settings){.grid = s->grid, .paper = s->paper, .rate_end = 1};
}

/* Where frames start near, more epochs lower the loss, and go away from the truth: tests/bed/decisions.md, "The paper's
 * fit beyond one window". */
#define SHARE_OF_EPOCHS 10

static bool is_whole(const npg_plan *plan)
{
    return plan->window >= plan->frame_count;
}

int64_t npg_paper_epochs(const npg_solver_settings *settings, const npg_plan *plan)
{
    return is_whole(plan) ? settings->epochs : (settings->epochs + SHARE_OF_EPOCHS - 1) / SHARE_OF_EPOCHS;
}

static npg_status paper_open(void **out, const npg_solver_setup *setup)
{
    paper *p;
    npg_fit_settings settings = settings_of(setup->settings);
    NPG_TRY(npg_alloc(&p, NPG_FOR_FIT, sizeof *p));
    *out = p;
    p->facts = setup->facts;
    p->settings = *setup->settings;
    if (!is_whole(&p->facts->plan)) {
        settings.paper.confidence = NPG_CONFIDENCE_CONSTANT;
        settings.rate_end = NPG_GRIDS_RATE_END;
        NPG_TRY(npg_follower_open(&p->follower, p->facts->reference, &tracking));
    }
    return npg_fit_open(&p->fit, setup->device, &settings, setup->surface, setup->seed);
}

/* The field's positions are those that the epoch measured. */
static npg_status take_positions(paper *p)
{
    size_t row = 3 * p->facts->reference->vert_count;
    for (size_t t = 0; t < p->problem->count; t++) NPG_TRY(npg_fit_vertices(p->fit, p->best + t * row, t));
    return NPG_OK;
}

static npg_status offer(paper *p, const npg_fit_step *step)
{
    double loss = step->chamfer + p->settings.paper.isometry * step->isometry;
    bool is_least = !p->at.next || loss < p->at.loss;
    p->at.next = step->epoch + 1;
    if (!is_least) return NPG_OK;
    p->at.loss = loss;
    p->at.least = (npg_solved){step->epochs, 1, step->chamfer, step->isometry};
    return take_positions(p);
}

static npg_status watch_epoch(void *user, const npg_fit_step *step)
{
    paper *p = user;
    const npg_solver_step at = {step->epoch, step->epochs, step->loss};
    NPG_TRY(offer(p, step));
    return p->watch ? p->watch(p->user, &at) : NPG_OK;
}

static npg_fit_frame frame_of(const paper *p, size_t t)
{
    const npg_plan *plan = &p->facts->plan;
    const npg_solver_frame *from = &p->problem->frames[t];
    return (npg_fit_frame){.index = from->index,
                           .time = npg_grids_time(plan, is_whole(plan) ? 1 : NPG_GRIDS_SPAN, from->index),
                           .points = from->points,
                           .count = from->point_count,
                           .tie = from->solved,
                           .base = p->poses ? p->poses + t * 3 * p->facts->reference->vert_count : NULL};
}

/* ---- poses to start from ---- */

/* The keyframe, or what is solved nearest to the new frames. */
static size_t known_place(const npg_problem *problem, int64_t key)
{
    size_t at = 0;
    if (!problem->window->direction) return (size_t)(key - problem->frames[0].index);
    while (!problem->frames[at].solved) at++;
    while (problem->window->direction > 0 && at + 1 < problem->count && problem->frames[at + 1].solved) at++;
    return at;
}

/* Outward on both sides as far as nothing is solved; what has no points stays as the frame before it. */
static npg_status follow(paper *p, size_t known)
{
    const npg_solver_frame *frames = p->problem->frames;
    size_t size = 3 * p->facts->reference->vert_count;
    for (int step = -1; step <= 1; step += 2) {
        npg_follower_rest(&p->follower);
        if (frames[known].solved) NPG_TRY(npg_follower_start(&p->follower, frames[known].solved));
        for (size_t t = known + (size_t)step; t < p->problem->count && !frames[t].solved; t += (size_t)step) {
            const npg_tracker_cloud cloud = {
                .points = frames[t].points, .normals = frames[t].normals, .count = frames[t].point_count};
            if (cloud.count) NPG_TRY(npg_follower_go(&p->follower, &cloud));
            npg_follower_vertices(&p->follower, p->poses + t * size);
        }
    }
    return NPG_OK;
}

static npg_status find_poses(paper *p)
{
    const npg_mesh *reference = p->facts->reference;
    size_t known = known_place(p->problem, p->facts->plan.key), size = 3 * reference->vert_count;
    npg_release(&p->poses);
    NPG_TRY(npg_alloc_array(&p->poses, NPG_FOR_FIT, p->problem->count * size, sizeof *p->poses));
    for (size_t t = 0; t < p->problem->count; t++) {
        const float *solved = p->problem->frames[t].solved;
        memcpy(p->poses + t * size, solved ? solved : reference->vert_pos, size * sizeof *solved);
    }
    return follow(p, known);
}

/* ---- a window ---- */

static npg_status begin(paper *p)
{
    npg_fit_frame *frames;
    NPG_TRY(npg_alloc_array(&frames, NPG_FOR_FIT, p->problem->count, sizeof *frames));
    for (size_t t = 0; t < p->problem->count; t++) frames[t] = frame_of(p, t);
    npg_status status = npg_fit_begin(p->fit, frames, p->problem->count, p->facts->plan.key, NULL, NULL);
    npg_release(&frames);
    return status;
}

static npg_status take_best(paper *p)
{
    size_t size = p->problem->count * p->facts->reference->vert_count * 3 * sizeof(float);
    if (p->at.next)
        return p->best_size == size ? NPG_OK
                                    : npg_error(NPG_BAD_INPUT, "the state inside is of another window");
    npg_release(&p->best);
    p->best_size = size;
    return npg_alloc(&p->best, NPG_FOR_FIT, size);
}

static npg_status solve(paper *p)
{
    const npg_plan *plan = &p->facts->plan;
    if (!is_whole(plan)) {
        if (!p->at.next) npg_fit_rest(p->fit);
        NPG_TRY(find_poses(p));
    }
    NPG_TRY(begin(p));
    NPG_TRY(npg_fit_run(p->fit, p->at.next, npg_paper_epochs(&p->settings, plan), watch_epoch, p));
    return p->at.next ? NPG_OK : take_positions(p);
}

static npg_status paper_solve(void *solver, npg_solved *solved, const npg_problem *problem,
                              npg_solver_watch *watch, void *user)
{
    paper *p = solver;
    p->problem = problem;
    p->watch = watch;
    p->user = user;
    NPG_TRY(take_best(p));
    NPG_TRY(solve(p));
    memcpy(problem->result, p->best, p->best_size);
    *solved = p->at.least;
    p->at = (progress){0};
    return NPG_OK;
}

static size_t paper_memory(const npg_solver_settings *settings, size_t verts, size_t frames, size_t points)
{
    const npg_fit_settings fit = settings_of(settings);
    return npg_fit_memory(&fit, verts, frames, points) + 3 * frames * verts * 3 * sizeof(float) +
           npg_tracker_memory(tracking.nodes, tracking.samples, verts);
}

/* ---- states ---- */

static npg_status paper_save(void *solver, npg_store *store, const npg_solver_moment *moment)
{
    paper *p = solver;
    if (moment->is_inside) {
        NPG_TRY(npg_store_put(store, "inside", &p->at, sizeof p->at));
        NPG_TRY(npg_store_put(store, "inside.best", p->best, p->best_size));
    }
    return npg_grids_save(p->fit, p->facts, store, moment);
}

static npg_status paper_restore(void *solver, const npg_record *record)
{
    paper *p = solver;
    size_t size;
    NPG_TRY(npg_fit_restore(p->fit, record));
    if (!npg_record_find(record, "inside", &size)) return NPG_OK;
    NPG_TRY(npg_record_get(record, "inside", &p->at, sizeof p->at));
    npg_record_find(record, "inside.best", &p->best_size);
    NPG_TRY(npg_alloc(&p->best, NPG_FOR_FIT, p->best_size));
    return npg_record_get(record, "inside.best", p->best, p->best_size);
}

const npg_solver npg_solver_paper = {
    .name = "paper",
    .needs_device = true,
    .open = paper_open,
    .solve = paper_solve,
    .memory = paper_memory,
    .save = paper_save,
    .restore = paper_restore,
    .keeps_inside = true,
    .close = paper_close,
};
