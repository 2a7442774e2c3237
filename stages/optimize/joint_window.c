/* Joint window: the thinned surface there, the whole one back. */
#include "optimize/window.h"

#include <string.h>

#include "geometry/geometry.h"
#include "optimize/fit.h"

struct npg_joint_window {
    npg_proxy *surface; /* W vertices; owned */
    size_t vert_count;  /* V */
    npg_joint *joint;
    npg_skin_weights *weights; /* V: corners of the surface's faces; owned */
};

/* T x W x 3: the thinned surfaces of the window at work. */
typedef struct surfaces {
    float *before, *now;
} surfaces;

void npg_joint_window_close(npg_joint_window **slot)
{
    if (!slot || !*slot) return;
    npg_joint_close(&(*slot)->joint);
    npg_proxy_close(&(*slot)->surface);
    npg_release(&(*slot)->weights);
    npg_release(slot);
}

/* Where the whole reference's vertices are on the thinned surface. */
static npg_status bind(npg_joint_window *window, const npg_mesh *reference)
{
    const npg_mesh *mesh = window->surface->mesh;
    npg_surface *rest;
    NPG_TRY(npg_alloc_array(&window->weights, NPG_FOR_FIT, window->vert_count, sizeof *window->weights));
    NPG_TRY(npg_surface_open(&rest, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count));
    npg_status status =
        npg_skin_bind(window->weights, mesh, rest, reference->vert_pos, window->vert_count, 0);
    npg_surface_close(&rest);
    return status;
}

npg_status npg_joint_window_open(npg_joint_window **out, const npg_mesh *reference,
                                 const npg_joint_settings *settings)
{
    npg_joint_window *window;
    *out = NULL;
    NPG_TRY(npg_alloc(&window, NPG_FOR_FIT, sizeof *window));
    window->vert_count = reference->vert_count;
    npg_status status = npg_proxy_open(&window->surface, reference, NPG_PROXY_SURFACE);
    if (!status) status = npg_joint_open(&window->joint, window->surface->mesh, settings);
    if (!status) status = bind(window, reference);
    if (status) npg_joint_window_close(&window);
    *out = window;
    return status;
}

void npg_joint_window_set_noise(npg_joint_window *window, double noise)
{
    npg_joint_set_noise(window->joint, noise);
}

/* What solving takes: the thinned surfaces before and after. */
static void fill_frames(npg_joint_window *window, const surfaces *s, npg_joint_frame *frames,
                        npg_held *const *held, size_t count, const npg_joint_points *points)
{
    size_t size = 3 * window->surface->mesh->vert_count;
    for (size_t t = 0; t < count; t++) {
        const npg_frame *frame = &held[t]->frame;
        const float *from = held[t]->solved ? held[t]->solved : frame->vert_unit;
        npg_proxy_gather(window->surface, s->before + t * size, from);
        frames[t] = (npg_joint_frame){s->now + t * size, points->all + 3 * points->start[t], frame->normals,
                                      frame->point_count, held[t]->solved != NULL};
    }
    memcpy(s->now, s->before, count * size * sizeof(float));
}

static void skin(npg_joint_window *window, const surfaces *s, npg_held *held, size_t t, const npg_window *at)
{
    size_t size = 3 * window->surface->mesh->vert_count;
    float *before = s->before + t * size, *now = s->now + t * size;
    float share = (float)npg_window_share(at, (double)held->frame.index);
    if (!held->solved) {
        held->solved = held->frame.vert_unit;
        held->frame.vert_unit = NULL;
    } else {
        for (size_t i = 0; i < size; i++) now[i] = before[i] + share * (now[i] - before[i]);
    }
    npg_skin_move(window->weights, window->vert_count, held->solved, before, now);
}

typedef struct watching {
    npg_fit_watch *watch;
    void *user;
} watching;

static npg_status watch_step(void *user, int64_t step, int64_t most, double residual)
{
    const watching *w = user;
    const npg_fit_step at = {.epoch = step, .epochs = most, .loss = residual};
    return w->watch ? w->watch(w->user, &at) : NPG_OK;
}

npg_status npg_joint_window_solve(npg_joint_window *window, npg_joint_result *result, npg_held *const *held,
                                  const npg_window *at, const npg_joint_points *points, npg_fit_watch *watch,
                                  void *user)
{
    size_t count = (size_t)(at->last - at->first + 1), size = 3 * window->surface->mesh->vert_count;
    watching w = {watch, user};
    npg_arena scratch = {.purpose = NPG_FOR_FIT};
    npg_joint_frame *frames = npg_arena_take(&scratch, count, sizeof *frames);
    surfaces s = {npg_arena_take(&scratch, count, size * sizeof(float)),
                  npg_arena_take(&scratch, count, size * sizeof(float))};
    npg_status status = npg_arena_status(&scratch);
    if (!status) fill_frames(window, &s, frames, held, count, points);
    if (!status) status = npg_joint_solve(window->joint, result, frames, count, watch_step, &w);
    for (size_t t = 0; t < count && !status; t++) skin(window, &s, held[t], t, at);
    npg_arena_release(&scratch);
    return status;
}

size_t npg_joint_window_memory(const npg_joint_settings *settings, size_t vert_count, size_t frames)
{
    size_t surface = vert_count < 2 * NPG_PROXY_SURFACE ? vert_count : NPG_PROXY_SURFACE;
    return npg_joint_memory(settings, surface, frames) + 2 * frames * surface * 3 * sizeof(float) +
           vert_count * sizeof(npg_skin_weights);
}
