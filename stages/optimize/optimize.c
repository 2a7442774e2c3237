/* optimize: slides windows over time and finds the deformation of the reference in every
 * frame (paper, method).
 *
 * Holds the frames of one window, has them fitted by the run's solver (solver.h), writes vertices into each
 * frame and passes on what no later window needs. */
#include <string.h>

#include "geometry/limits.h"
#include "kernels/kernels.h"
#include "kernels/layout.h"
#include "kernels/runtime/device.h"
#include "optimize/window.h"
#include "pipeline/clock.h"
#include "pipeline/cost.h"
#include "pipeline/json_file.h"
#include "pipeline/options.h"
#include "pipeline/plan.h"

typedef struct state {
    npg_solver_settings settings;
    int named; /* option solver */
    const npg_solver *row;
    npg_device *device;
    npg_window_solver *solver;
    npg_hand hand; /* held frames in order of arrival; window_at: the one at work */
    npg_window window;
    int64_t window_count;
    npg_window_result result;
    npg_solver_step last_step; /* of the window at work */
    double saved_s, saving_s;  /* when the last state was written, and how long that took */
} state;

/* ---- options ---- */

#define SETTING(member) offsetof(state, settings.member)
#define GRID(member)    SETTING(grid.member)

/* clang-format off */
static const npg_option options[] = {
    /* type         name                 place                   default     least most  shown as or words */
    NPG_KEY(CHOICE, "solver",            offsetof(state, named), "joint",    "joint|grids",
        "of aligned frames: their vertices, or the paper's grids and decoder over their poses; without alignment "
        "it is the paper's method"),
    NPG_KEY(INT,    "epochs",            SETTING(epochs),        "60",       0,    1e6,  "N",
        "steps of each window's joint fit, at most; 0 leaves the frames as the alignment put them"),
    NPG_KEY(INT,    "joint-points",      SETTING(energy.points), "5000",     10,   1e7,  "N",
        "most points of an aligned frame that pull at the surface"),
    NPG_KEY(REAL,   "joint-shape",       SETTING(energy.shape),  "0.5",      0,    1e6,  NULL,
        "weight of the change of the surface's edges against the distance of a point, of aligned frames"),
    NPG_KEY(INT,    "time-frequencies",  GRID(frequencies),      "4",        1,    16,   "M",
        "frequencies of the time code; it has twice as many values"),
    NPG_KEY(INT,    "grid-levels",       GRID(grid_levels),      "8",        1,    16,   "L",
        "levels of the position grid"),
    NPG_KEY(INT,    "grid-base",         GRID(grid_base),        "2",        2,    64,   "N",
        "nodes per axis of the coarsest level"),
    NPG_KEY(INT,    "grid-step",         GRID(grid_step),        "3",        0,    16,   "N",
        "nodes per axis that each level adds"),
    NPG_KEY(REAL,   "grid-rate",         GRID(grid_rate),        "0.005",    0,    10,   NULL,
        "learning rate of the coarsest level"),
    NPG_KEY(REAL,   "grid-rate-growth",  GRID(grid_rate_growth), "2.5",      0.1,  10,   NULL,
        "its growth per level"),
    NPG_KEY(REAL,   "lambda",            GRID(lambda),           "0.4",      0,    1e4,  NULL,
        "smoothing of the coarsest level, 0 for none"),
    NPG_KEY(REAL,   "lambda-growth",     GRID(lambda_growth),    "1.5",      0.1,  10,   NULL,
        "its growth per level"),
    NPG_KEY(INT,    "position-channels", GRID(position_channels), "30",      2,    31,   "N",
        "features that the position grids give the decoder"),
    NPG_KEY(INT,    "normal-channels",   GRID(normal_channels),  "2",        0,    30,   "N",
        "features that the grid over normal directions gives it, 0: no such grid; both together are 32 at most"),
    NPG_KEY(INT,    "width-1",           GRID(width_1),          "512",      32,   4096, "N",
        "units of the first hidden layer"),
    NPG_KEY(INT,    "width-2",           GRID(width_2),          "512",      32,   4096, "N",
        "units of the second"),
    NPG_KEY(REAL,   "mlp-rate",          GRID(mlp_rate),         "0.001",    0,    1,    NULL,
        "learning rate of the decoder"),
    NPG_KEY(REAL,   "isometry",          SETTING(paper.isometry), "100",     0,    1e6,  NULL,
        "weight of the change of edge lengths"),
    NPG_KEY(REAL,   "welsch",            SETTING(paper.welsch),  "0.3",      0,    1e3,  NULL,
        "width of the robust weight on squared unit distances, 0 for none"),
    NPG_KEY(CHOICE, "confidence",        SETTING(paper.confidence), "cumulative", "cumulative|constant",
        "weight of a frame by how well it and those nearer the key fit, or of all alike"),
    {0}};
/* clang-format on */

/* The row that a run's options and stages ask for. */
static const npg_solver *solver_of(const npg_worker *worker)
{
    static const npg_solver *const of_poses[] = {&npg_solver_joint, &npg_solver_grids};
    const char *name = npg_options_get(npg_worker_options(worker), "solver");
    if (!npg_worker_has_field(worker, NPG_FIELD_POSE)) return &npg_solver_paper;
    return of_poses[strcmp(name, of_poses[0]->name) != 0];
}

/* ---- opening ---- */

static npg_status check_widths(const npg_grid_settings *s)
{
    if (s->width_1 % 32 || s->width_2 % 32)
        return npg_error(NPG_USAGE, "option width-%d: %lld is not a multiple of 32", s->width_1 % 32 ? 1 : 2,
                         (long long)(s->width_1 % 32 ? s->width_1 : s->width_2));
    if (s->position_channels + s->normal_channels > NPG_LATENT_CHANNELS)
        return npg_error(NPG_USAGE,
                         "options position-channels and normal-channels: %lld and %lld are more than %d",
                         (long long)s->position_channels, (long long)s->normal_channels, NPG_LATENT_CHANNELS);
    return NPG_OK;
}

/* Members of the settings lie in the order: epochs, of both solvers of poses, of both of grids, of paper's. */
static bool is_used(size_t offset, const npg_solver *row)
{
    if (offset == offsetof(state, named)) return row->needs_poses;
    if (offset < SETTING(energy)) return true;
    if (offset < SETTING(grid)) return row->needs_poses;
    return offset < SETTING(paper) ? row->needs_device : !row->needs_poses;
}

/* Whoever sets a key expects an effect. */
static npg_status refuse_unused(npg_worker *worker, const npg_solver *row)
{
    for (const npg_option *option = options; option->name; option++) {
        const char *value = npg_options_get(npg_worker_options(worker), option->name);
        if (!is_used(option->offset, row) && strcmp(value, option->default_text) != 0)
            return npg_error(
                NPG_USAGE,
                "key %s of the method has no effect: this run's solver is %s (keys solver and align)",
                option->name, row->name);
    }
    return NPG_OK;
}

/* Without poses a window starts from frames that the one before it has solved. */
static npg_status check_overlap(npg_worker *worker, const npg_solver *row)
{
    const npg_options *options_given = npg_worker_options(worker);
    bool is_whole = !strcmp(npg_options_get(options_given, "window"), "0");
    if (row->needs_poses || is_whole || strcmp(npg_options_get(options_given, "overlap"), "0") != 0)
        return NPG_OK;
    return npg_error(NPG_USAGE, "option overlap: 0: windows of the paper's method share one frame at least");
}

static npg_status resume(npg_worker *worker);

static bool is_resumed(const npg_worker *worker)
{
    return npg_worker_pass(worker) == NPG_PASS_SOLVE && npg_worker_facts(worker)->is_resumed;
}

static npg_status open_device(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    bool is_measuring = npg_worker_pass(worker) == NPG_PASS_MEASURE;
    NPG_TRY(npg_device_open(&s->device, npg_worker_settings(worker)->device, NULL));
    if (is_measuring || is_resumed(worker)) NPG_TRY(npg_kernels_self_test(s->device));
    if (is_measuring) return NPG_OK;
    const npg_device_info *info = npg_device_facts(s->device);
    npg_worker_log(worker, NPG_LOG_INFO, -1, "device %s (%s), %d units, tuning %s", info->name,
                   info->platform, info->units, npg_device_tuning(s->device)->name);
    json_object_set_new(npg_worker_report(worker), "device", json_string(info->name));
    json_object_set_new(npg_worker_report(worker), "tuning", json_string(npg_device_tuning(s->device)->name));
    return NPG_OK;
}

static npg_status init(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    s->hand.total = -1;
    s->row = solver_of(worker);
    NPG_TRY(check_widths(&s->settings.grid));
    NPG_TRY(refuse_unused(worker, s->row));
    NPG_TRY(check_overlap(worker, s->row));
    if (s->row->needs_device) NPG_TRY(open_device(worker));
    return is_resumed(worker) ? resume(worker) : NPG_OK;
}

static void clear_held(npg_held *held)
{
    npg_frame_clear(&held->frame);
    npg_release(&held->solved);
}

static void uninit(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    npg_window_solver_close(&s->solver);
    npg_device_close(&s->device);
    for (size_t i = 0; i < s->hand.held_count; i++) clear_held(&s->hand.held[i]);
    npg_release(&s->hand.held);
}

static npg_status open_solver(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    s->window_count = npg_plan_window_count(&facts->plan, s->hand.total);
    s->window = npg_plan_window(&facts->plan, 0, s->hand.total);
    s->saved_s = npg_clock_s();
    return npg_window_solver_open(&s->solver, s->row, s->device, &s->settings, facts,
                                  (uint64_t)npg_worker_settings(worker)->seed);
}

/* ---- a window ---- */

static npg_held *held_frame(state *s, int64_t index)
{
    for (size_t i = 0; i < s->hand.held_count; i++)
        if (s->hand.held[i].frame.index == index) return &s->hand.held[i];
    return NULL;
}

static bool window_is_complete(state *s)
{
    for (int64_t t = s->window.first; t <= s->window.last; t++)
        if (!held_frame(s, t)) return false;
    return true;
}

/* Most windows settle before their last step: `of_window`, not the steps, says how much is done. */
static void report_progress(npg_worker *worker, const npg_solver_step *step, double of_window)
{
    state *s = npg_worker_state(worker);
    npg_progress progress = {.share = ((double)s->hand.window_at + of_window) / (double)s->window_count,
                             .step = step->step + 1,
                             .steps = step->steps,
                             .window = s->hand.window_at,
                             .windows = s->window_count,
                             .frames_done = s->hand.emitted,
                             .frames = npg_worker_facts(worker)->frame_count,
                             .loss = step->loss};
    npg_worker_progress(worker, &progress);
}

static npg_status keep_inside(npg_worker *worker);

static npg_status watch(void *user, const npg_solver_step *step)
{
    npg_worker *worker = user;
    state *s = npg_worker_state(worker);
    s->last_step = *step;
    report_progress(worker, step, (double)(step->step + 1) / (double)step->steps);
    if (step->step % 25 == 0 || step->step + 1 == step->steps)
        npg_worker_log(worker, NPG_LOG_DEBUG, -1, "window %lld step %lld: loss %.4g",
                       (long long)s->hand.window_at, (long long)step->step, step->loss);
    if (s->row->keeps_inside) NPG_TRY(keep_inside(worker));
    return npg_worker_stopping(worker) ? NPG_STOPPED : NPG_OK;
}

static void note_result(npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    const npg_window_result *r = &s->result;
    if (s->row->needs_poses)
        npg_worker_log(
            worker, NPG_LOG_INFO, -1,
            "window %lld: %s fit in %lld steps: points %.5f off, vertices moved by %.5f in the mean, "
            "energy %.4f of the smoothed poses'",
            (long long)s->hand.window_at, s->row->name, (long long)r->solved.steps, r->noise, r->moved,
            r->solved.energy);
    else
        npg_worker_log(worker, NPG_LOG_INFO, -1, "window %lld: Chamfer distance %.4g, edges changed by %.4g",
                       (long long)s->hand.window_at, r->solved.distance, r->solved.isometry);
    if (r->bridged > NPG_FEW)
        npg_worker_log(
            worker, NPG_LOG_INFO, -1,
            "window %lld: %.0f %% of the surface has no points in its frame: the frames around say where it is",
            (long long)s->hand.window_at, 100 * r->bridged);
}

static npg_status solve_window(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    size_t count = (size_t)(s->window.last - s->window.first + 1);
    npg_held **frames;
    NPG_TRY(npg_alloc_array(&frames, NPG_FOR_FIT, count, sizeof *frames));
    for (size_t i = 0; i < count; i++) frames[i] = held_frame(s, s->window.first + (int64_t)i);
    memset(&s->last_step, 0, sizeof s->last_step);
    npg_status status = npg_window_solve(s->solver, &s->result, frames, &s->window, watch, worker);
    npg_release(&frames);
    if (!status) {
        note_result(worker);
        report_progress(worker, &s->last_step, 1);
    }
    return npg_error_prefix(status, "window %lld (frames %lld to %lld)", (long long)s->hand.window_at,
                            (long long)s->window.first, (long long)s->window.last);
}

/* ---- passing on ---- */

static bool is_needed_later(npg_worker *worker, int64_t index)
{
    state *s = npg_worker_state(worker);
    const npg_plan *plan = &npg_worker_facts(worker)->plan;
    return npg_plan_is_needed_after(plan, index, s->hand.window_at, s->hand.total);
}

/* Pass a solved frame on; its vertices are now the solved ones. */
static npg_status emit(npg_worker *worker, npg_held *held)
{
    state *s = npg_worker_state(worker);
    npg_chunk *chunk;
    NPG_TRY(npg_chunk_open(&chunk, 1));
    npg_release(&held->frame.vert_unit);
    held->frame.vert_unit = held->solved;
    held->frame.vert_count = npg_worker_facts(worker)->reference->vert_count;
    held->frame.fields |= NPG_FIELD_VERTICES;
    held->solved = NULL;
    npg_chunk_add(chunk, &held->frame);
    s->hand.emitted++;
    npg_status status = npg_worker_push(worker, &chunk);
    npg_chunk_close(&chunk);
    return status;
}

static npg_status emit_done(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    size_t kept = 0;
    npg_status status = NPG_OK;
    for (size_t i = 0; i < s->hand.held_count; i++) {
        npg_held *held = &s->hand.held[i];
        if (!status && held->solved && !is_needed_later(worker, held->frame.index)) {
            status = emit(worker, held);
            clear_held(held);
        } else {
            npg_held moved = *held;
            memset(held, 0, sizeof *held);
            s->hand.held[kept++] = moved;
        }
    }
    s->hand.held_count = kept;
    return status;
}

/* ---- states on disk ---- */

static npg_status save_state(npg_worker *worker, bool is_inside)
{
    state *s = npg_worker_state(worker);
    double begun_s = npg_clock_s();
    if (!npg_job_of(worker)) return NPG_OK;
    npg_hand hand = s->hand;
    hand.window_at -= is_inside;
    hand.last = s->result.solved;
    NPG_TRY(npg_checkpoint_save(worker, &hand, s->solver, is_inside));
    s->saved_s = npg_clock_s();
    s->saving_s = s->saved_s - begun_s;
    return NPG_OK;
}

/* Inside a window that takes long, for a small share of its time, and when the run is to stop. */
static npg_status keep_inside(npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    bool is_due = (npg_clock_s() - s->saved_s) * NPG_FEW >= s->saving_s || npg_worker_stopping(worker);
    return is_due ? save_state(worker, true) : NPG_OK;
}

/* Where the state on disk was taken: the window is solved, its frames are not passed on. */
static npg_status resume(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    npg_status status = npg_checkpoint_restore(worker, &s->hand);
    s->result.solved = s->hand.last;
    if (!status) status = open_solver(worker);
    if (!status) status = npg_window_restore(s->solver, npg_job_state(npg_job_of(worker)));
    if (status) return npg_error_prefix(status, "the state to resume from");
    if (s->hand.window_at >= 0) NPG_TRY(emit_done(worker));
    if (++s->hand.window_at < s->window_count)
        s->window = npg_plan_window(&facts->plan, s->hand.window_at, s->hand.total);
    return NPG_OK;
}

static npg_status solve_complete_windows(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    while (s->hand.window_at < s->window_count && window_is_complete(s)) {
        NPG_TRY(solve_window(worker));
        NPG_TRY(save_state(worker, false));
        NPG_TRY(emit_done(worker));
        if (++s->hand.window_at < s->window_count)
            s->window = npg_plan_window(&npg_worker_facts(worker)->plan, s->hand.window_at, s->hand.total);
    }
    return NPG_OK;
}

/* The last window of an open plan is as long as what came; frames that waited for one more go on. */
static npg_status solve_the_rest(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    s->hand.total = facts->frame_count;
    s->window_count = npg_plan_window_count(&facts->plan, s->hand.total);
    if (s->hand.window_at < s->window_count)
        s->window = npg_plan_window(&facts->plan, s->hand.window_at, s->hand.total);
    NPG_TRY(solve_complete_windows(worker));
    return emit_done(worker);
}

static npg_status process(npg_worker *worker, npg_chunk **chunk)
{
    state *s = npg_worker_state(worker);
    if (npg_worker_pass(worker) != NPG_PASS_SOLVE) return NPG_OK;
    size_t count = npg_chunk_count(*chunk);
    if (count && !s->solver) NPG_TRY(open_solver(worker));
    NPG_TRY(npg_grow(&s->hand.held, &s->hand.held_capacity, s->hand.held_count + count, sizeof *s->hand.held,
                     NPG_FOR_FRAMES));
    for (size_t i = 0; i < count; i++) {
        npg_frame *frame = npg_chunk_frame(*chunk, i);
        s->hand.held[s->hand.held_count++] = (npg_held){.frame = *frame};
        memset(frame, 0, sizeof *frame);
    }
    npg_chunk_close(chunk);
    return solve_complete_windows(worker);
}

/* At most, of a window. */
static int64_t epochs_of(const npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    return solver_of(worker)->needs_poses ? s->settings.epochs
                                          : npg_paper_epochs(&s->settings, &npg_worker_facts(worker)->plan);
}

static npg_status flush(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    if (npg_worker_pass(worker) != NPG_PASS_SOLVE) return NPG_OK;
    if (npg_plan_is_open(&npg_worker_facts(worker)->plan)) NPG_TRY(solve_the_rest(worker));
    if (s->hand.held_count)
        return npg_error(NPG_FAILED, "window %lld (frames %lld to %lld) did not get all its frames",
                         (long long)s->hand.window_at, (long long)s->window.first, (long long)s->window.last);
    json_t *report = npg_worker_report(worker);
    json_object_set_new(report, "windows", json_integer(s->window_count));
    json_object_set_new(report, "epochs", json_integer(epochs_of(worker)));
    json_object_set_new(report, "solver", json_string(s->row->name));
    if (s->row->needs_poses) return NPG_OK;
    json_object_set_new(report, "last_chamfer", json_real(s->result.solved.distance));
    json_object_set_new(report, "last_isometry", json_real(s->result.solved.isometry));
    return NPG_OK;
}

static size_t memory(const npg_worker *worker, size_t *chunks_held)
{
    const state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_plan *plan = &facts->plan;
    npg_window window = npg_plan_window(plan, 0, -1);
    size_t frames = (size_t)(window.last - window.first + 1) + (size_t)plan->overlap;
    size_t chunk = (size_t)npg_worker_settings(worker)->chunk_frames;
    *chunks_held = (frames + chunk - 1) / chunk + 1;
    return npg_window_memory(solver_of(worker), &s->settings, npg_worker_verts_at_most(worker), frames,
                             facts->point_count_max);
}

/* Of aligned frames the end of the way alone; else nearly all that there is to do. */
static double expects(const npg_worker *worker, npg_pass pass)
{
    const state *s = npg_worker_state(worker);
    const double fit_s_per_frame = 0.08, cores = 2;
    double frames = (double)npg_worker_facts(worker)->frame_count;
    if (pass != NPG_PASS_SOLVE) return 0;
    if (solver_of(worker)->needs_poses) return fit_s_per_frame * frames;
    double vertices = (double)npg_worker_verts_at_most(worker);
    double sample =
        npg_cost_decoder_flops((double)s->settings.grid.width_1, (double)s->settings.grid.width_2);
    return cores * npg_cost_network_s(frames * vertices * (double)epochs_of(worker) * sample,
                                      cores * NPG_COST_CORE_FLOPS);
}

const npg_stage npg_stage_optimize = {
    .name = "optimize",
    .help = "fits the motion of the reference to all frames, window by window",
    .options = options,
    .state_size = sizeof(state),
    .passes = NPG_PASS_MEASURE | NPG_PASS_SOLVE,
    .needs = NPG_FIELD_CLEAN | NPG_FIELD_KEY | NPG_FIELD_REFERENCE,
    .gives = NPG_FIELD_VERTICES,
    .init = init,
    .process = process,
    .flush = flush,
    .uninit = uninit,
    .memory = memory,
    .expects = expects,
};
