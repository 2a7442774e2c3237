/* optimize: slides windows over time and finds the deformation of the reference in every
 * frame (paper, method).
 *
 * Holds the frames of one window and fits them jointly - aligned ones by joint.h, others as in the paper on
 * the OpenCL device -, writes vertices into each frame and passes on what no later window needs. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "kernels/kernels.h"
#include "kernels/mlp.h"
#include "optimize/window.h"
#include "pipeline/clock.h"
#include "pipeline/cost.h"
#include "pipeline/json_file.h"
#include "pipeline/options.h"
#include "pipeline/plan.h"

typedef struct state {
    npg_window_settings window_settings;
    npg_device *device;
    npg_window_solver *solver;
    npg_held *held; /* owned, with what they own; in order of arrival */
    size_t held_count, held_capacity;
    npg_window window;
    int64_t window_at, window_count;
    bool is_aligned;
    int64_t total; /* frames of the capture, -1 until the stream has ended */
    double last_chamfer, last_isometry;
    double usual_chamfer;   /* the least that a window without alignment came to, 0 before the first */
    int64_t lost_count;     /* windows that a warm start did not bring there                         */
    npg_fit_step last_step; /* of the window at work */
    int64_t emitted, state_every_s;
    double saved_s; /* when the last state was written */
} state;

/* ---- options ---- */

#define WINDOW(member) offsetof(state, window_settings.member)
#define FIT(member)    WINDOW(fit.member)
#define MATCH(member)  WINDOW(warm.match.member)
#define JOINT(member)  WINDOW(joint.member)

/* clang-format off */
static const npg_option options[] = {
    /* type         name                 place                   default     least most  shown as or words */
    NPG_KEY(INT,    "epochs",            FIT(epochs),            "60",       0,    1e6,  "N",
        "steps of each window's joint fit, at most; 0 leaves the frames as the alignment put them"),
    NPG_KEY(INT,    "joint-points",      JOINT(points),          "5000",     10,   1e7,  "N",
        "most points of an aligned frame that pull at the surface"),
    NPG_KEY(REAL,   "joint-shape",       JOINT(shape),           "0.1",      0,    1e6,  NULL,
        "weight of the change of the surface's edges against the distance of a point, of aligned frames"),
    NPG_KEY(CHOICE, "time-code",         FIT(time_code),         "fourier",
        "fourier|polynomial|gaussian|learned",
        "what the decoder is told about time"),
    NPG_KEY(INT,    "time-frequencies",  FIT(frequencies),       "4",        1,    16,   "M",
        "frequencies of the time code; it has twice as many values"),
    NPG_KEY(REAL,   "time-span",         FIT(time_span),         "0.8",      0.01, 1,    NULL,
        "share of the time code's length that a window goes through: the codes of its ends are nearly alike; "
        "1 as in the paper"),
    NPG_KEY(CHOICE, "encoding",          FIT(encoding),          "grid",     "grid|single|hash",
        "features: a hierarchy of grids, its finest grid alone, or a hash table"),
    NPG_KEY(INT,    "grid-levels",       FIT(grid_levels),       "8",        1,    16,   "L",
        "levels of the position grid"),
    NPG_KEY(INT,    "grid-base",         FIT(grid_base),         "2",        2,    64,   "N",
        "nodes per axis of the coarsest level"),
    NPG_KEY(INT,    "grid-step",         FIT(grid_step),         "3",        0,    16,   "N",
        "nodes per axis that each level adds"),
    NPG_KEY(REAL,   "grid-rate",         FIT(grid_rate),         "0.005",    0,    10,   NULL,
        "learning rate of the coarsest level"),
    NPG_KEY(REAL,   "grid-rate-growth",  FIT(grid_rate_growth),  "2.5",      0.1,  10,   NULL,
        "its growth per level"),
    NPG_KEY(REAL,   "lambda",            FIT(lambda),            "0.4",      0,    1e4,  NULL,
        "smoothing of the coarsest level, 0 for none"),
    NPG_KEY(REAL,   "lambda-growth",     FIT(lambda_growth),     "1.5",      0.1,  10,   NULL,
        "its growth per level"),
    NPG_KEY(CHOICE, "smoothing",         FIT(smoothing),         "screened", "graph|screened|doubled",
        "matrix of the smoothing: I + lambda (D - A), the same with 6 lambda more on the diagonal, "
        "or I + lambda (2 D - A)"),
    NPG_KEY(FLAG,   "normal-grid",       FIT(normal_grid),       "yes",
        "features by normal direction beside those by position"),
    NPG_KEY(INT,    "normal-nodes",      FIT(normal_nodes),      "4",        2,    32,   "N",
        "nodes per axis of the normal grid"),
    NPG_KEY(INT,    "position-channels", FIT(position_channels), "30",       2,    31,   "N",
        "features that the position grids give the decoder"),
    NPG_KEY(INT,    "normal-channels",   FIT(normal_channels),   "2",        1,    30,   "N",
        "features that the normal grid gives it; both together are 32 at most"),
    NPG_KEY(INT,    "width-1",           FIT(width_1),           "512",      32,   4096, "N",
        "units of the first hidden layer"),
    NPG_KEY(INT,    "width-2",           FIT(width_2),           "512",      32,   4096, "N",
        "units of the second"),
    NPG_KEY(REAL,   "mlp-rate",          FIT(mlp_rate),          "0.001",    0,    1,    NULL,
        "learning rate of the decoder"),
    NPG_KEY(REAL,   "isometry",          FIT(isometry),          "5",        0,    1e6,  NULL,
        "weight of the change of edge lengths"),
    NPG_KEY(REAL,   "welsch",            FIT(alpha),             "0.3",      0,    1e3,  NULL,
        "width of the robust weight on squared unit distances, 0 for none"),
    NPG_KEY(CHOICE, "confidence",        FIT(confidence),        "constant",
        "cumulative|single|delta|constant",
        "weight of a frame by how well it and those nearer the key fit"),
    NPG_KEY(CHOICE, "catch-up",          FIT(catch_up),          "root",
        "root|constant|linear|exponential|interpolated",
        "how the confidence opens with the epochs"),
    NPG_KEY(REAL,   "feature-start",     FIT(feature_start),     "3",        0,    1e3,  NULL,
        "grid features begin spread over +- this; 0 as in the paper"),
    NPG_KEY(REAL,   "rate-end",          FIT(rate_end),          "0.1",      0,    1,    NULL,
        "learning rates at the last epoch as a share; they fall by half a cosine"),
    NPG_KEY(CHOICE, "distance",          WINDOW(warm.distance),  "vertices", "vertices|surface",
        "without alignment: the paper's distance between all vertices and the points, "
        "or that between points and surface, over --samples vertices"),
    NPG_KEY(INT,    "samples",           WINDOW(warm.samples),   "1500",     0,    1e6,  "N",
        "vertices that such frames are brought near their pose with, and that the distance to the surface is "
        "fitted over, 0: the usual number"),
    NPG_KEY(INT,    "rounds",            WINDOW(warm.rounds),    "2",        1,    1000, "N",
        "times that a fit by the distance to the surface is matched"),
    NPG_KEY(INT,    "match-points",      MATCH(points),          "5000",     10,   1e7,  "N",
        "most points of a frame that pull there"),
    NPG_KEY(REAL,   "match-along",       MATCH(along),           "0.02",     0,    1,    NULL,
        "share of distances along the surface there, 0 to 1"),
    NPG_KEY(REAL,   "match-reverse",     MATCH(reverse),         "0.5",      0,    100,  NULL,
        "weight of surface to points against points to surface there"),
    NPG_KEY(REAL,   "match-total",       MATCH(total),           "5000",     1,    1e9,  NULL,
        "weight of all points of a frame there"),
    NPG_KEY(REAL,   "match-tie",         MATCH(tie),             "1",        0,    1e6,  NULL,
        "weight of staying where the window before has put a frame, against its points"),
    NPG_KEY(INT,    "state-every",       offsetof(state, state_every_s), "120",      0,    1e6,  "SECONDS",
        "without alignment: a window that takes longer writes its state meanwhile, "
        "so that no more is lost when the run is killed"),
    {0}};
/* clang-format on */

/* ---- opening ---- */

static npg_status keep_inside(void *user);

static npg_status check_widths(const npg_fit_settings *s)
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

static npg_status resume(npg_worker *worker);

static bool is_resumed(const npg_worker *worker)
{
    return npg_worker_pass(worker) == NPG_PASS_SOLVE && npg_worker_facts(worker)->is_resumed;
}

/* Keys of the solver that the method does not use: whoever sets one expects an effect. */
static void say_unused(npg_worker *worker, bool is_aligned)
{
    char names[512] = "";
    for (const npg_option *option = options; option->name; option++) {
        bool is_joint = !strncmp(option->name, "joint-", 6), is_both = !strcmp(option->name, "epochs");
        size_t used = strlen(names);
        if (is_both || is_joint == is_aligned) continue;
        if (!npg_options_is_set(npg_worker_options(worker), option->name)) continue;
        snprintf(names + used, sizeof names - used, "%s%s", used ? ", " : "", option->name);
    }
    if (!names[0]) return;
    npg_worker_log(worker, NPG_LOG_INFO, -1, "without effect on fits %s alignment: %s",
                   is_aligned ? "with" : "without", names);
    json_object_set_new(npg_worker_report(worker), "keys_without_effect", npg_json_text(names));
}

/* Aligned frames are fitted on the host: no device is looked for. */
static npg_status init(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    s->total = -1;
    if (npg_worker_pass(worker) == NPG_PASS_SOLVE)
        say_unused(worker, npg_worker_has_field(worker, NPG_FIELD_POSE));
    NPG_TRY(check_widths(&s->window_settings.fit));
    if (npg_worker_has_field(worker, NPG_FIELD_POSE)) return is_resumed(worker) ? resume(worker) : NPG_OK;
    NPG_TRY(npg_device_open(&s->device, npg_worker_settings(worker)->device));
    if (npg_worker_pass(worker) == NPG_PASS_MEASURE) return npg_kernels_self_test(s->device);
    if (is_resumed(worker)) NPG_TRY(npg_kernels_self_test(s->device));
    const npg_device_info *info = npg_device_facts(s->device);
    npg_worker_log(worker, NPG_LOG_INFO, -1, "device %s (%s), %d units, tuning %s", info->name,
                   info->platform, info->units, npg_device_tuning(s->device)->name);
    json_object_set_new(npg_worker_report(worker), "device", json_string(info->name));
    json_object_set_new(npg_worker_report(worker), "tuning", json_string(npg_device_tuning(s->device)->name));
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
    for (size_t i = 0; i < s->held_count; i++) clear_held(&s->held[i]);
    npg_release(&s->held);
}

static npg_status open_solver(npg_worker *worker, bool is_aligned)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    s->is_aligned = is_aligned;
    s->window_count = npg_plan_window_count(&facts->plan, s->total);
    s->window = npg_plan_window(&facts->plan, 0, s->total);
    NPG_TRY(npg_window_solver_open(&s->solver, s->device, &s->window_settings, facts,
                                   (uint64_t)npg_worker_settings(worker)->seed, is_aligned));
    if (npg_window_warm(s->solver)) npg_warm_set_keep(npg_window_warm(s->solver), keep_inside);
    s->saved_s = npg_clock_s();
    return NPG_OK;
}

/* ---- a window ---- */

static npg_held *held_frame(state *s, int64_t index)
{
    for (size_t i = 0; i < s->held_count; i++)
        if (s->held[i].frame.index == index) return &s->held[i];
    return NULL;
}

static bool window_is_complete(state *s)
{
    for (int64_t t = s->window.first; t <= s->window.last; t++)
        if (!held_frame(s, t)) return false;
    return true;
}

/* Most windows settle before their last step: `of_window`, not the steps, says how much is done. */
static void report_progress(npg_worker *worker, const npg_fit_step *step, double of_window)
{
    state *s = npg_worker_state(worker);
    npg_progress progress = {.share = ((double)s->window_at + of_window) / (double)s->window_count,
                             .step = step->epoch + 1,
                             .steps = step->epochs,
                             .window = s->window_at,
                             .windows = s->window_count,
                             .frames_done = s->emitted,
                             .frames = npg_worker_facts(worker)->frame_count,
                             .loss = step->loss};
    npg_worker_progress(worker, &progress);
}

static void report_epoch(npg_worker *worker, const npg_fit_step *step)
{
    state *s = npg_worker_state(worker);
    s->last_chamfer = step->chamfer;
    s->last_isometry = step->isometry;
    s->last_step = *step;
    report_progress(worker, step, (double)(step->epoch + 1) / (double)step->epochs);
    if (step->epoch % 25 == 0 || step->epoch + 1 == step->epochs)
        npg_worker_log(
            worker, NPG_LOG_DEBUG, -1, "window %lld epoch %lld: chamfer %.4g isometry %.4g loss %.4g",
            (long long)s->window_at, (long long)step->epoch, step->chamfer, step->isometry, step->loss);
}

static npg_status watch(void *user, const npg_fit_step *step)
{
    npg_worker *worker = user;
    report_epoch(worker, step);
    return npg_worker_stopping(worker) ? NPG_STOPPED : NPG_OK;
}

static void note_result(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_joint_result *joint = npg_window_result(s->solver);
    if (joint)
        npg_worker_log(
            worker, NPG_LOG_INFO, -1,
            "window %lld: joint fit in %lld steps: points %.5f off, vertices moved by %.5f in the mean",
            (long long)s->window_at, (long long)joint->steps, joint->noise, joint->moved);
}

/* A window that a warm start lost is no silent matter. */
static void note_warm(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    if (!npg_window_warm(s->solver)) return;
    if (npg_warm_lost_by(npg_window_warm(s->solver)) > 0) {
        s->lost_count++;
        npg_worker_log(
            worker, NPG_LOG_WARNING, -1,
            "window %lld: the warm start left it at %.3g times the distance of the others; it had all "
            "epochs and is now at %.3g times",
            (long long)s->window_at, npg_warm_lost_by(npg_window_warm(s->solver)),
            s->last_chamfer / s->usual_chamfer);
    }
    if (!s->usual_chamfer || s->last_chamfer < s->usual_chamfer) s->usual_chamfer = s->last_chamfer;
}

static npg_status solve_window(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    size_t count = (size_t)(s->window.last - s->window.first + 1);
    npg_held **frames;
    NPG_TRY(npg_alloc_array(&frames, NPG_FOR_FIT, count, sizeof *frames));
    for (size_t i = 0; i < count; i++) frames[i] = held_frame(s, s->window.first + (int64_t)i);
    memset(&s->last_step, 0, sizeof s->last_step);
    if (npg_window_warm(s->solver)) npg_warm_set_usual(npg_window_warm(s->solver), s->usual_chamfer);
    npg_status status = npg_window_solve(s->solver, frames, &s->window, watch, worker);
    npg_release(&frames);
    if (!status) {
        note_result(worker);
        note_warm(worker);
        report_progress(worker, &s->last_step, 1);
    }
    return npg_error_prefix(status, "window %lld (frames %lld to %lld)", (long long)s->window_at,
                            (long long)s->window.first, (long long)s->window.last);
}

/* ---- passing on ---- */

static bool is_needed_later(npg_worker *worker, int64_t index)
{
    state *s = npg_worker_state(worker);
    const npg_plan *plan = &npg_worker_facts(worker)->plan;
    return npg_plan_is_needed_after(plan, index, s->window_at, s->total);
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
    s->emitted++;
    npg_status status = npg_worker_push(worker, &chunk);
    npg_chunk_unref(&chunk);
    return status;
}

static npg_status emit_done(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    size_t kept = 0;
    npg_status status = NPG_OK;
    for (size_t i = 0; i < s->held_count; i++) {
        npg_held *held = &s->held[i];
        if (!status && held->solved && !is_needed_later(worker, held->frame.index)) {
            status = emit(worker, held);
            clear_held(held);
        } else {
            npg_held moved = *held;
            memset(held, 0, sizeof *held);
            s->held[kept++] = moved;
        }
    }
    s->held_count = kept;
    return status;
}

/* ---- states on disk ---- */

static npg_hand hand_of(state *s, int64_t window_at)
{
    const npg_joint_result *joint = npg_window_result(s->solver);
    return (npg_hand){s->held,          s->held_count, s->held_capacity,
                      window_at,        s->emitted,    s->last_chamfer,
                      s->last_isometry, s->is_aligned, npg_window_warm(s->solver),
                      s->usual_chamfer, s->lost_count, joint ? joint->noise : 0,
                      s->total};
}

static npg_status save_state(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    if (!npg_job_of(worker)) return NPG_OK;
    const npg_hand hand = hand_of(s, s->window_at);
    s->saved_s = npg_clock_s();
    return npg_checkpoint_save(worker, &hand, npg_window_fit(s->solver));
}

/* Inside a window that takes long, and when the run is to stop. */
static npg_status keep_inside(void *user)
{
    npg_worker *worker = user;
    state *s = npg_worker_state(worker);
    bool is_due = npg_clock_s() - s->saved_s >= (double)s->state_every_s || npg_worker_stopping(worker);
    if (!is_due || !npg_job_of(worker)) return NPG_OK;
    const npg_hand hand = hand_of(s, s->window_at - 1);
    NPG_TRY(npg_checkpoint_save_inside(worker, &hand));
    s->saved_s = npg_clock_s();
    return NPG_OK;
}

/* Where the state on disk was taken: the window is solved, its frames are not passed on. */
static npg_status resume(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    npg_hand hand = {0};
    npg_status status = npg_checkpoint_restore_hand(worker, &hand);
    s->held = hand.held;
    s->held_count = hand.held_count;
    s->held_capacity = hand.held_capacity;
    s->emitted = hand.emitted;
    s->last_chamfer = hand.last_chamfer;
    s->last_isometry = hand.last_isometry;
    s->usual_chamfer = hand.usual;
    s->lost_count = hand.lost_count;
    s->total = hand.total;
    if (!status) status = open_solver(worker, hand.is_aligned);
    if (!status && !hand.is_aligned)
        status = npg_checkpoint_restore_fit(worker, npg_window_fit(s->solver), npg_window_warm(s->solver));
    if (status) return npg_error_prefix(status, "the state to resume from");
    npg_window_set_noise(s->solver, hand.noise);
    s->window_at = hand.window_at;
    if (s->window_at >= 0) NPG_TRY(emit_done(worker));
    if (++s->window_at < s->window_count) s->window = npg_plan_window(&facts->plan, s->window_at, s->total);
    return NPG_OK;
}

static npg_status solve_complete_windows(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    while (s->window_at < s->window_count && window_is_complete(s)) {
        NPG_TRY(solve_window(worker));
        NPG_TRY(save_state(worker));
        NPG_TRY(emit_done(worker));
        if (++s->window_at < s->window_count)
            s->window = npg_plan_window(&npg_worker_facts(worker)->plan, s->window_at, s->total);
    }
    return NPG_OK;
}

/* The last window of an open plan is as long as what came; frames that waited for one more go on. */
static npg_status solve_the_rest(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    s->total = facts->frame_count;
    s->window_count = npg_plan_window_count(&facts->plan, s->total);
    if (s->window_at < s->window_count) s->window = npg_plan_window(&facts->plan, s->window_at, s->total);
    NPG_TRY(solve_complete_windows(worker));
    return emit_done(worker);
}

static npg_status process(npg_worker *worker, npg_chunk **chunk)
{
    state *s = npg_worker_state(worker);
    if (npg_worker_pass(worker) != NPG_PASS_SOLVE) return NPG_OK;
    size_t count = npg_chunk_count(*chunk);
    if (count && !s->solver)
        NPG_TRY(open_solver(worker, npg_chunk_frame(*chunk, 0)->fields & NPG_FIELD_POSE));
    NPG_TRY(npg_grow(&s->held, &s->held_capacity, s->held_count + count, sizeof *s->held, NPG_FOR_FRAMES));
    for (size_t i = 0; i < count; i++) {
        npg_frame *frame = npg_chunk_frame(*chunk, i);
        s->held[s->held_count++] = (npg_held){.frame = *frame};
        memset(frame, 0, sizeof *frame);
    }
    npg_chunk_unref(chunk);
    return solve_complete_windows(worker);
}

static npg_status flush(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    if (npg_worker_pass(worker) != NPG_PASS_SOLVE) return NPG_OK;
    if (npg_plan_is_open(&npg_worker_facts(worker)->plan)) NPG_TRY(solve_the_rest(worker));
    if (s->held_count)
        return npg_error(NPG_FAILED, "window %lld (frames %lld to %lld) did not get all its frames",
                         (long long)s->window_at, (long long)s->window.first, (long long)s->window.last);
    json_t *report = npg_worker_report(worker);
    json_object_set_new(report, "windows", json_integer(s->window_count));
    json_object_set_new(report, "epochs", json_integer(s->window_settings.fit.epochs));
    if (s->is_aligned) return NPG_OK;
    json_object_set_new(report, "windows_lost", json_integer(s->lost_count));
    json_object_set_new(report, "last_chamfer", json_real(s->last_chamfer));
    json_object_set_new(report, "last_isometry", json_real(s->last_isometry));
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
    return npg_window_memory(&s->window_settings, npg_worker_has_field(worker, NPG_FIELD_POSE),
                             npg_worker_verts_at_most(worker), frames, facts->point_count_max);
}

/* Of aligned frames the end of the way alone; else nearly all that there is to do. */
static double expects(const npg_worker *worker, npg_pass pass)
{
    const state *s = npg_worker_state(worker);
    const double joint_s_per_frame = 0.08, cores = 2;
    double frames = (double)npg_worker_facts(worker)->frame_count;
    if (pass != NPG_PASS_SOLVE) return 0;
    if (npg_worker_has_field(worker, NPG_FIELD_POSE)) return joint_s_per_frame * frames;
    const npg_warm_settings *warm = &s->window_settings.warm;
    bool by_samples = warm->distance == NPG_DISTANCE_SURFACE && warm->samples;
    double vertices = (double)npg_worker_verts_at_most(worker);
    if (by_samples) vertices = fmin(vertices, (double)warm->samples);
    const npg_fit_settings *fit = &s->window_settings.fit;
    double sample = npg_cost_decoder_flops((double)fit->width_1, (double)fit->width_2);
    return cores *
           npg_cost_network_s(frames * vertices * (double)fit->epochs * sample, cores * NPG_COST_CORE_FLOPS);
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
