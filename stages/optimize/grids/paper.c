/* Paper: the field from the reference itself, by the paper's robust Chamfer distance over all vertices.
 *
 * The window around the keyframe is solved as in the paper.  Beyond, the paper has nothing: a window starts from
 * what the field knew after the one it borders on.  Its new frames are brought near their pose first, one by one
 * outward from those that are solved, with few vertices, and some of the known frames held in place, so that the
 * field forgets none of them.  Then all frames are fitted, those that are solved tied to where they are: such
 * frames need no gate.  With more than one window rates fall. */
#include <string.h>

#include "geometry/geometry.h"
#include "optimize/grids/fit.h"

/* By trial (tests/bed/decisions.md, "Warm starts"). */
#define SAMPLES     1500 /* vertices that new frames are brought near their pose with    */
#define OPEN_EPOCHS 60   /* of each                                                      */
#define BESIDE      3 /* solved frames beside a new one, which hold the field in place, and others by turns */
#define RATE_FACTOR 2 /* of that fit's rates to those over all vertices               */

/* Adam's steps keep their length, and what the last one leaves is one draw of many: the result is the state of
 * least loss. */
typedef struct progress {
    int64_t next; /* epoch, 0 at the beginning */
    npg_solved least;
    double loss; /* of that state, without the confidence */
} progress;

typedef struct paper {
    npg_device *device;     /* loan */
    const npg_facts *facts; /* loan */
    npg_solver_settings settings;
    uint64_t seed;
    bool is_alone; /* one window over all frames */
    npg_fit *fit;  /* over all vertices */
    progress at;   /* of the window at work, or that a resumed run goes on from inside its own */
    float *best;   /* T x V x 3: where that state had the frames, owned                         */
    size_t best_size;
    /* of the window at work */
    const npg_problem *problem; /* loan */
    npg_solver_watch *watch;
    void *user;
    int64_t steps, opened; /* epochs of all kinds; those that opening took */
    bool is_opened;        /* the fit over all vertices is at work          */
} paper;

static void paper_close(void **slot)
{
    paper *p = *slot;
    npg_fit_close(&p->fit);
    npg_release(&p->best);
    npg_release(slot);
}

static npg_fit_settings settings_of(const npg_solver_settings *s)
{
    return (npg_fit_settings){.grid = s->grid, .paper = s->paper, .rate_end = 1};
}

static npg_status paper_open(void **out, const npg_solver_setup *setup)
{
    paper *p;
    const npg_fit_settings settings = settings_of(setup->settings);
    const npg_plan *plan = &setup->facts->plan;
    NPG_TRY(npg_alloc(&p, NPG_FOR_FIT, sizeof *p));
    *out = p;
    p->device = setup->device;
    p->facts = setup->facts;
    p->settings = *setup->settings;
    p->seed = setup->seed;
    p->is_alone = plan->window >= plan->frame_count;
    return npg_fit_open(&p->fit, p->device, &settings, setup->surface, p->seed);
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
    p->at.least = (npg_solved){p->steps, 1, step->chamfer, step->isometry};
    return take_positions(p);
}

static npg_status watch_epoch(void *user, const npg_fit_step *step)
{
    paper *p = user;
    const npg_solver_step at = {p->opened + step->epoch, p->steps, step->loss};
    if (p->is_opened) NPG_TRY(offer(p, step));
    return p->watch ? p->watch(p->user, &at) : NPG_OK;
}

static npg_fit_frame frame_of(const paper *p, size_t t)
{
    const npg_solver_frame *from = &p->problem->frames[t];
    return (npg_fit_frame){.index = from->index,
                           .time =
                               npg_grids_time(&p->facts->plan, p->is_alone ? 1 : NPG_GRIDS_SPAN, from->index),
                           .points = from->points,
                           .count = from->point_count,
                           .tie = from->solved};
}

/* ---- new frames, brought near their pose ---- */

/* A window's new frames lie at its one end or the other. */
typedef struct opening {
    paper *p;
    npg_proxy *samples;
    npg_fit *probe; /* over the samples                           */
    float *poses;   /* T x S x 3: of frames that are known        */
    size_t known;   /* how many of them there are, from the solved end on */
    npg_arena arena;
} opening;

/* The k-th frame outward from the solved end. */
static size_t place_of(const opening *o, size_t k)
{
    return o->p->problem->window->direction < 0 ? o->p->problem->count - 1 - k : k;
}

static npg_status open_probe(opening *o)
{
    paper *p = o->p;
    npg_fit_settings settings = settings_of(&p->settings);
    settings.grid.grid_rate *= RATE_FACTOR;
    settings.grid.mlp_rate *= RATE_FACTOR;
    settings.paper.confidence = NPG_CONFIDENCE_CONSTANT;
    settings.rate_end = NPG_GRIDS_RATE_END;
    NPG_TRY(npg_proxy_open(&o->samples, p->facts->reference, SAMPLES));
    NPG_TRY(npg_fit_open(&o->probe, p->device, &settings, o->samples->mesh, p->seed));
    NPG_TRY(npg_fit_hand_over(o->probe, p->fit));
    size_t size = 3 * o->samples->mesh->vert_count;
    o->poses = npg_arena_take(&o->arena, p->problem->count, size * sizeof(float));
    NPG_TRY(npg_arena_status(&o->arena));
    for (; o->known < p->problem->count && p->problem->frames[place_of(o, o->known)].solved; o->known++)
        npg_proxy_gather(o->samples, o->poses + o->known * size,
                         p->problem->frames[place_of(o, o->known)].solved);
    return NPG_OK;
}

/* The next frame, and those that are held meanwhile. */
static npg_status open_frame(opening *o)
{
    size_t size = 3 * o->samples->mesh->vert_count, count = 0, places[2 * BESIDE];
    npg_fit_frame frames[2 * BESIDE + 1];
    while (count < BESIDE && count < o->known) places[count] = o->known - 1 - count, count++;
    size_t others = o->known - count, every = (others + BESIDE - 1) / BESIDE;
    for (size_t k = o->known % (every ? every : 1); k < others && count < 2 * BESIDE; k += every)
        places[count++] = k;
    for (size_t i = 0; i < count; i++) {
        frames[i] = frame_of(o->p, place_of(o, places[i]));
        frames[i].tie = o->poses + places[i] * size;
    }
    frames[count] = frame_of(o->p, place_of(o, o->known));
    NPG_TRY(npg_fit_begin(o->probe, frames, count + 1, o->p->facts->plan.key, NULL, NULL));
    NPG_TRY(npg_fit_run(o->probe, 0, OPEN_EPOCHS, watch_epoch, o->p));
    NPG_TRY(npg_fit_vertices(o->probe, o->poses + o->known * size, count));
    o->p->opened += OPEN_EPOCHS;
    o->known++;
    return NPG_OK;
}

static npg_status open_new(paper *p)
{
    opening o = {.p = p, .arena = {.purpose = NPG_FOR_FIT}};
    npg_status status = open_probe(&o);
    p->steps += (int64_t)(p->problem->count - o.known) * OPEN_EPOCHS;
    while (!status && o.known < p->problem->count) status = open_frame(&o);
    if (!status) status = npg_fit_hand_over(p->fit, o.probe);
    npg_fit_close(&o.probe);
    npg_proxy_close(&o.samples);
    npg_arena_release(&o.arena);
    return status;
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
    bool is_warm = p->problem->window->direction != 0;
    p->steps = p->settings.epochs;
    if (is_warm && !p->at.next) {
        NPG_TRY(npg_fit_recall(p->fit, p->problem->window));
        NPG_TRY(open_new(p));
    }
    if (!p->is_alone)
        npg_fit_set_pace(p->fit,
                         is_warm ? NPG_CONFIDENCE_CONSTANT : (npg_confidence)p->settings.paper.confidence,
                         NPG_GRIDS_RATE_END);
    NPG_TRY(begin(p));
    p->is_opened = true;
    NPG_TRY(npg_fit_run(p->fit, p->at.next, p->settings.epochs, watch_epoch, p));
    return p->at.next ? NPG_OK : take_positions(p);
}

static npg_status paper_solve(void *solver, npg_solved *solved, const npg_problem *problem,
                              npg_solver_watch *watch, void *user)
{
    paper *p = solver;
    p->problem = problem;
    p->watch = watch;
    p->user = user;
    p->opened = 0;
    p->is_opened = false;
    NPG_TRY(take_best(p));
    NPG_TRY(solve(p));
    memcpy(problem->result, p->best, p->best_size);
    *solved = p->at.least;
    p->at = (progress){0};
    return npg_fit_remember(p->fit, problem->window);
}

static size_t paper_memory(const npg_solver_settings *settings, size_t verts, size_t frames, size_t points)
{
    const npg_fit_settings fit = settings_of(settings);
    size_t samples = verts < 2 * SAMPLES ? verts : SAMPLES;
    return npg_fit_memory(&fit, verts, frames, points) +
           npg_fit_memory(&fit, samples, 2 * BESIDE + 1, points) +
           frames * (samples + verts) * 3 * sizeof(float);
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

/* While new frames are opened the fit over all vertices waits: nothing that could be gone on from. */
static bool paper_keeps_inside(const void *solver)
{
    const paper *p = solver;
    return p->is_opened;
}

const npg_solver npg_solver_paper = {
    .name = "paper",
    .needs_device = true,
    .open = paper_open,
    .solve = paper_solve,
    .memory = paper_memory,
    .save = paper_save,
    .restore = paper_restore,
    .keeps_inside = paper_keeps_inside,
    .close = paper_close,
};
