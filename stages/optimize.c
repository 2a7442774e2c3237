/* optimize: slides windows over time and finds the deformation of the reference in every frame (paper,
 * method).
 *
 * Holds the frames of one window, fits them jointly on the OpenCL device, writes vertices into each frame and
 * passes on what no later window needs. */
#include <math.h>
#include <string.h>

#include "fit.h"
#include "kernels.h"
#include "stage.h"

typedef struct state {
    npg_fit_settings fit_settings;
    npg_device *device;
    npg_fit *fit;
    npg_frame *held; /* owned, with what they own; in order of arrival */
    size_t held_count, held_capacity;
    npg_window window;
    int64_t window_at, window_count;
    double last_chamfer, last_isometry;
    int64_t emitted;
} state;

/* ---- options ---- */

#define AT(field)     offsetof(state, fit_settings.field)
#define INT_OPTION    NPG_OPTION_INT
#define REAL_OPTION   NPG_OPTION_REAL
#define CHOICE_OPTION NPG_OPTION_CHOICE

static const npg_option options[] = {
    {"epochs", "steps of each window's joint fit", INT_OPTION, AT(epochs), "250", 1, 1e6, NULL, "N"},
    {"rotation", "how the decoder's output becomes a rotation", CHOICE_OPTION, AT(rotation), "quaternion", 0,
     0, "quaternion|cayley|exponential", NULL},
    {"time-code", "what the decoder is told about time", CHOICE_OPTION, AT(time_code), "fourier", 0, 0,
     "fourier|polynomial|gaussian|learned", NULL},
    {"time-frequencies", "frequencies of the time code; it has twice as many values", INT_OPTION,
     AT(frequencies), "4", 1, 16, NULL, "M"},
    {"encoding", "features: a hierarchy of grids, its finest grid alone, or a hash table", CHOICE_OPTION,
     AT(encoding), "grid", 0, 0, "grid|single|hash", NULL},
    {"grid-levels", "levels of the position grid", INT_OPTION, AT(grid_levels), "8", 1, 16, NULL, "L"},
    {"grid-base", "nodes per axis of the coarsest level", INT_OPTION, AT(grid_base), "2", 2, 64, NULL, "N"},
    {"grid-step", "nodes per axis that each level adds", INT_OPTION, AT(grid_step), "3", 0, 16, NULL, "N"},
    {"grid-rate", "learning rate of the coarsest level", REAL_OPTION, AT(grid_rate), "0.005", 0, 10, NULL,
     NULL},
    {"grid-rate-growth", "its growth per level", REAL_OPTION, AT(grid_rate_growth), "2.5", 0.1, 10, NULL,
     NULL},
    {"lambda", "smoothing of the coarsest level, 0 for none", REAL_OPTION, AT(lambda), "0.4", 0, 1e4, NULL,
     NULL},
    {"lambda-growth", "its growth per level", REAL_OPTION, AT(lambda_growth), "1.5", 0.1, 10, NULL, NULL},
    {"smoothing", "matrix of the smoothing: I + lambda (D - A), or with 6 lambda on the diagonal",
     CHOICE_OPTION, AT(smoothing), "screened", 0, 0, "graph|screened", NULL},
    {"normal-grid", "features by normal direction beside those by position", NPG_OPTION_FLAG, AT(normal_grid),
     "yes", 0, 0, NULL, NULL},
    {"normal-nodes", "nodes per axis of the normal grid", INT_OPTION, AT(normal_nodes), "4", 2, 32, NULL,
     "N"},
    {"width-1", "units of the first hidden layer", INT_OPTION, AT(width_1), "512", 32, 4096, NULL, "N"},
    {"width-2", "units of the second hidden layer", INT_OPTION, AT(width_2), "512", 32, 4096, NULL, "N"},
    {"mlp-rate", "learning rate of the decoder", REAL_OPTION, AT(mlp_rate), "0.001", 0, 1, NULL, NULL},
    {"slope", "slope of the leaky rectifier below 0", REAL_OPTION, AT(slope), "0.01", 0, 1, NULL, NULL},
    {"isometry", "weight of the change of edge lengths", REAL_OPTION, AT(isometry), "100", 0, 1e6, NULL,
     NULL},
    {"welsch", "width of the robust weight on squared unit distances, 0 for none", REAL_OPTION, AT(alpha),
     "0.3", 0, 1e3, NULL, NULL},
    {"confidence", "weight of a frame by how well it and those nearer the key fit", CHOICE_OPTION,
     AT(confidence), "cumulative", 0, 0, "cumulative|single|delta|constant", NULL},
    {"catch-up", "how the confidence opens with the epochs", CHOICE_OPTION, AT(catch_up), "root", 0, 0,
     "root|constant|linear|exponential|interpolated", NULL},
    {"fit-batch", "frames whose hidden layer is kept at a time", INT_OPTION, AT(batch), "4", 1, 64, NULL,
     "N"},
    {0}};

void npg_fit_settings_fill(npg_fit_settings *settings, const npg_options *from)
{
    state filled = {0};
    npg_options_fill(from, options, &filled);
    *settings = filled.fit_settings;
}

/* ---- opening ---- */

static npg_status check_widths(const npg_fit_settings *s)
{
    if (s->width_1 % 32 || s->width_2 % 32)
        return npg_error(NPG_USAGE, "option width-%d: %lld is not a multiple of 32", s->width_1 % 32 ? 1 : 2,
                         (long long)(s->width_1 % 32 ? s->width_1 : s->width_2));
    return NPG_OK;
}

static npg_status init(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    NPG_TRY(check_widths(&s->fit_settings));
    NPG_TRY(npg_device_open(&s->device, npg_worker_settings(worker)->device));
    if (npg_worker_pass(worker) == NPG_PASS_MEASURE) return npg_kernels_self_test(s->device);
    if (npg_worker_facts(worker)->is_live) NPG_TRY(npg_kernels_self_test(s->device));
    const npg_device_info *info = npg_device_facts(s->device);
    npg_worker_log(worker, NPG_LOG_INFO, -1, "device %s (%s), %d units", info->name, info->platform,
                   info->units);
    json_object_set_new(npg_worker_report(worker), "device", json_string(info->name));
    return NPG_OK;
}

static void uninit(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    npg_fit_close(&s->fit);
    npg_device_close(&s->device);
    for (size_t i = 0; i < s->held_count; i++) npg_frame_clear(&s->held[i]);
    npg_release(&s->held);
}

static npg_status open_fit(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    s->window_count = npg_plan_window_count(&facts->plan);
    s->window = npg_plan_window(&facts->plan, 0);
    return npg_fit_open(&s->fit, s->device, &s->fit_settings, facts->reference,
                        (uint64_t)npg_worker_settings(worker)->seed);
}

/* ---- a window ---- */

static npg_frame *held_frame(state *s, int64_t index)
{
    for (size_t i = 0; i < s->held_count; i++)
        if (s->held[i].index == index) return &s->held[i];
    return NULL;
}

static bool window_is_complete(state *s)
{
    for (int64_t t = s->window.first; t <= s->window.last; t++)
        if (!held_frame(s, t)) return false;
    return true;
}

static void report_epoch(npg_worker *worker, const npg_fit_step *step)
{
    state *s = npg_worker_state(worker);
    double of_window = (double)(step->epoch + 1) / (double)step->epochs;
    s->last_chamfer = step->chamfer;
    s->last_isometry = step->isometry;
    npg_progress progress = {.share = ((double)s->window_at + of_window) / (double)s->window_count,
                             .step = step->epoch + 1,
                             .steps = step->epochs,
                             .window = s->window_at,
                             .windows = s->window_count,
                             .frames_done = s->emitted,
                             .frames = npg_worker_facts(worker)->frame_count,
                             .loss = step->loss};
    npg_worker_progress(worker, &progress);
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

/* 0 for the first frame of the capture, 1 for the last. */
static double time_of(const npg_facts *facts, int64_t index)
{
    return facts->plan.frame_count > 1 ? (double)index / (double)(facts->plan.frame_count - 1) : 0;
}

static npg_status fit_frames(npg_worker *worker, npg_fit_frame *frames, float *points)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    size_t count = 0;
    for (int64_t t = s->window.first; t <= s->window.last; t++) {
        const npg_frame *frame = held_frame(s, t);
        npg_box_local_to_unit(&facts->box, points, frame->pos_local, frame->point_count);
        frames[count++] = (npg_fit_frame){t, time_of(facts, t), points, frame->point_count};
        points += 3 * frame->point_count;
    }
    return npg_fit_window(s->fit, frames, count, facts->plan.key, watch, worker);
}

static npg_status fit_window(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    size_t point_count = 0, frame_count = (size_t)(s->window.last - s->window.first + 1);
    npg_fit_frame *frames = NULL;
    float *points = NULL;
    for (int64_t t = s->window.first; t <= s->window.last; t++) point_count += held_frame(s, t)->point_count;
    npg_status status = npg_alloc_array(&frames, NPG_FOR_FIT, frame_count, sizeof *frames);
    if (!status) status = npg_alloc_array(&points, NPG_FOR_FIT, point_count + 1, 3 * sizeof *points);
    if (!status) status = fit_frames(worker, frames, points);
    npg_release(&frames);
    npg_release(&points);
    return npg_error_prefix(status, "window %lld (frames %lld to %lld)", (long long)s->window_at,
                            (long long)s->window.first, (long long)s->window.last);
}

static npg_status take_vertices(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_mesh *reference = npg_worker_facts(worker)->reference;
    for (int64_t t = s->window.first; t <= s->window.last; t++) {
        npg_frame *frame = held_frame(s, t);
        if (!frame->vert_unit)
            NPG_TRY(
                npg_alloc_array(&frame->vert_unit, NPG_FOR_FRAMES, reference->vert_count, 3 * sizeof(float)));
        frame->vert_count = reference->vert_count;
        frame->fields |= NPG_FIELD_VERTICES;
        NPG_TRY(npg_fit_vertices(s->fit, frame->vert_unit, (size_t)(t - s->window.first)));
    }
    return NPG_OK;
}

/* ---- passing on ---- */

static bool is_needed_later(npg_worker *worker, int64_t index)
{
    state *s = npg_worker_state(worker);
    const npg_plan *plan = &npg_worker_facts(worker)->plan;
    for (int64_t w = s->window_at + 1; w < s->window_count; w++) {
        npg_window window = npg_plan_window(plan, w);
        if (index >= window.first && index <= window.last) return true;
    }
    return false;
}

static npg_status emit(npg_worker *worker, npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    npg_chunk *chunk;
    NPG_TRY(npg_chunk_open(&chunk, 1));
    npg_chunk_add(chunk, frame);
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
        npg_frame *frame = &s->held[i];
        if (!status && (frame->fields & NPG_FIELD_VERTICES) && !is_needed_later(worker, frame->index)) {
            status = emit(worker, frame);
            npg_frame_clear(frame);
        } else {
            npg_frame moved = *frame;
            memset(frame, 0, sizeof *frame);
            s->held[kept++] = moved;
        }
    }
    s->held_count = kept;
    return status;
}

static npg_status solve_complete_windows(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    if (!s->fit) NPG_TRY(open_fit(worker));
    while (s->window_at < s->window_count && window_is_complete(s)) {
        NPG_TRY(fit_window(worker));
        NPG_TRY(take_vertices(worker));
        NPG_TRY(emit_done(worker));
        if (++s->window_at < s->window_count)
            s->window = npg_plan_window(&npg_worker_facts(worker)->plan, s->window_at);
    }
    return NPG_OK;
}

static npg_status process(npg_worker *worker, npg_chunk **chunk)
{
    state *s = npg_worker_state(worker);
    if (npg_worker_pass(worker) != NPG_PASS_SOLVE) return NPG_OK;
    size_t count = npg_chunk_count(*chunk);
    NPG_TRY(npg_grow(&s->held, &s->held_capacity, s->held_count + count, sizeof *s->held, NPG_FOR_FRAMES));
    for (size_t i = 0; i < count; i++) {
        npg_frame *frame = npg_chunk_frame(*chunk, i);
        s->held[s->held_count++] = *frame;
        memset(frame, 0, sizeof *frame);
    }
    npg_chunk_unref(chunk);
    return solve_complete_windows(worker);
}

static npg_status flush(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    if (npg_worker_pass(worker) != NPG_PASS_SOLVE) return NPG_OK;
    if (s->held_count)
        return npg_error(NPG_FAILED, "window %lld (frames %lld to %lld) did not get all its frames",
                         (long long)s->window_at, (long long)s->window.first, (long long)s->window.last);
    json_t *report = npg_worker_report(worker);
    json_object_set_new(report, "windows", json_integer(s->window_count));
    json_object_set_new(report, "epochs", json_integer(s->fit_settings.epochs));
    json_object_set_new(report, "last_chamfer", json_real(s->last_chamfer));
    json_object_set_new(report, "last_isometry", json_real(s->last_isometry));
    return NPG_OK;
}

static size_t memory(const npg_worker *worker, size_t *chunks_held)
{
    const state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_plan *plan = &facts->plan;
    npg_window window = npg_plan_window(plan, 0);
    size_t frames = (size_t)(window.last - window.first + 1) + (size_t)plan->overlap;
    size_t chunk = (size_t)npg_worker_settings(worker)->chunk_frames;
    *chunks_held = (frames + chunk - 1) / chunk + 1;
    size_t verts = facts->reference ? facts->reference->vert_count : 10000;
    return npg_fit_memory(&s->fit_settings, verts, frames, facts->point_count_max, 2) +
           frames * verts * 3 * sizeof(float);
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
};
