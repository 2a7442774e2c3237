/* Window: solving one, from aligned frames or as in the paper. */
#include "optimize/window.h"

#include <math.h>
#include <string.h>

struct npg_window_solver {
    npg_window_settings settings;
    const npg_facts *facts;  /* loan */
    npg_fit *fit;            /* of frames without alignment, or NULL */
    npg_warm *warm;          /* of the same, or NULL                 */
    npg_joint_window *joint; /* of aligned ones, or NULL             */
    npg_joint_result result; /* of that                              */
    /* of the window at work, owned */
    float *points;       /* all frames' points in units     */
    size_t *point_start; /* count + 1                       */
    float *now;          /* count x V x 3                   */
    npg_fit_frame *frames;
    size_t count;
};

const npg_joint_result *npg_window_result(const npg_window_solver *solver)
{
    return solver->joint ? &solver->result : NULL;
}

void npg_window_set_noise(npg_window_solver *solver, double noise)
{
    if (!solver->joint) return;
    solver->result.noise = noise;
    npg_joint_window_set_noise(solver->joint, noise);
}

npg_fit *npg_window_fit(npg_window_solver *solver)
{
    return solver->fit;
}

npg_warm *npg_window_warm(npg_window_solver *solver)
{
    return solver->warm;
}

static void close_frames(npg_window_solver *s)
{
    void *all[] = {&s->points, &s->point_start, &s->now, &s->frames};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) npg_release(all[i]);
}

void npg_window_solver_close(npg_window_solver **slot)
{
    if (!slot || !*slot) return;
    close_frames(*slot);
    npg_fit_close(&(*slot)->fit);
    npg_warm_close(&(*slot)->warm);
    npg_joint_window_close(&(*slot)->joint);
    npg_release(slot);
}

npg_status npg_window_solver_open(npg_window_solver **out, npg_device *device,
                                  const npg_window_settings *settings, const npg_facts *facts, uint64_t seed,
                                  bool is_aligned)
{
    npg_window_solver *s;
    *out = NULL;
    NPG_TRY(npg_alloc(&s, NPG_FOR_FIT, sizeof *s));
    s->settings = *settings;
    s->settings.joint.steps = settings->fit.epochs;
    s->facts = facts;
    npg_status status = is_aligned ? npg_joint_window_open(&s->joint, facts->reference, &s->settings.joint)
                                   : npg_fit_open(&s->fit, device, &s->settings.fit, facts->reference, seed);
    if (!status && !is_aligned)
        status = npg_warm_open(&s->warm, device, &s->settings.warm, &s->settings.fit, facts, seed);
    if (status) npg_window_solver_close(&s);
    *out = s;
    return status;
}

#define UNITS 2 /* of the device, whose scratch memory counts: on more the drivers' own counts more */

size_t npg_window_memory(const npg_window_settings *settings, bool is_aligned, size_t vert_count,
                         size_t frames, size_t points)
{
    const size_t vector = 3 * sizeof(float);
    size_t solved = frames * vert_count * vector, clouds = frames * points * vector;
    if (is_aligned) return solved + clouds + npg_joint_window_memory(&settings->joint, vert_count, frames);
    return solved + clouds + npg_fit_memory(&settings->fit, vert_count, frames, points, UNITS) +
           npg_warm_memory(&settings->warm, &settings->fit, vert_count, frames);
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

/* What the time code is a function of: the absolute frame with a fixed period, the length of the first
 * window, so that frames which two windows share mean the same to both.  That window goes from 0 to span. */
static double time_of(const npg_plan *plan, double span, double index)
{
    npg_window first = npg_plan_key_window(plan, -1);
    int64_t length = first.last - first.first;
    return length ? span * (index - (double)first.first) / (double)length : 0;
}

static npg_status open_frames(npg_window_solver *s, npg_held *const *held)
{
    size_t verts = s->facts->reference->vert_count;
    NPG_TRY(npg_alloc_array(&s->frames, NPG_FOR_FIT, s->count, sizeof *s->frames));
    NPG_TRY(npg_alloc_array(&s->now, NPG_FOR_FIT, s->count * verts, 3 * sizeof(float)));
    for (size_t i = 0; i < s->count; i++) {
        const npg_frame *frame = &held[i]->frame;
        s->frames[i] =
            (npg_fit_frame){.index = frame->index,
                            .time = time_of(&s->facts->plan, s->settings.fit.time_span, (double)frame->index),
                            .points = s->points + 3 * s->point_start[i],
                            .count = frame->point_count};
    }
    return NPG_OK;
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

/* ---- solving ---- */

static npg_status keep_solved(npg_held *held, const float *now, size_t verts, float share)
{
    if (!held->solved) {
        NPG_TRY(npg_alloc_array(&held->solved, NPG_FOR_FRAMES, verts, 3 * sizeof(float)));
        memcpy(held->solved, now, verts * 3 * sizeof(float));
        return NPG_OK;
    }
    for (size_t i = 0; i < 3 * verts; i++) held->solved[i] += share * (now[i] - held->solved[i]);
    return NPG_OK;
}

static npg_status fit_unaligned(npg_window_solver *s, npg_held *const *held, const npg_window *window,
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

/* All vertices from the reference. */
static npg_status solve_unaligned(npg_window_solver *s, npg_held *const *held, const npg_window *window,
                                  npg_fit_watch *watch, void *user)
{
    size_t verts = s->facts->reference->vert_count;
    NPG_TRY(open_frames(s, held));
    NPG_TRY(fit_unaligned(s, held, window, watch, user));
    for (size_t i = 0; i < s->count; i++) {
        float *now = s->now + i * verts * 3;
        NPG_TRY(npg_fit_vertices(s->fit, now, i));
        NPG_TRY(
            keep_solved(held[i], now, verts, (float)npg_window_share(window, (double)held[i]->frame.index)));
    }
    return NPG_OK;
}

npg_status npg_window_solve(npg_window_solver *s, npg_held *const *held, const npg_window *window,
                            npg_fit_watch *watch, void *user)
{
    close_frames(s);
    s->count = (size_t)(window->last - window->first + 1);
    npg_status status = take_points(s, held);
    const npg_joint_points points = {s->points, s->point_start};
    if (!status)
        status = s->joint ? npg_joint_window_solve(s->joint, &s->result, held, window, &points, watch, user)
                          : solve_unaligned(s, held, window, watch, user);
    close_frames(s);
    return status;
}
