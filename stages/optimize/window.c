/* Window: its frames to a solver's problem, and the solution back. */
#include "optimize/window.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "optimize/carry.h"

struct npg_window_solver {
    const npg_solver *row;
    void *solver; /* of the row, owned */
    npg_solver_settings settings;
    const npg_facts *facts; /* loan */
    size_t vert_count;      /* V    */
    /* with poses */
    npg_proxy *surface;      /* W vertices; owned */
    npg_surface_hit *places; /* V: on these; owned */
    npg_energy *energy;      /* owned             */
    /* of the window at work */
    npg_arena window;         /* holds these                                         */
    size_t count, size;       /* T, and floats of a frame's result: 3 W or 3 V       */
    npg_solver_frame *frames; /* T                                                   */
    npg_energy_frame *posed;  /* T                                                   */
    float *before, *result;   /* T x W x 3 aligned poses; the problem's result       */
};

void npg_window_solver_close(npg_window_solver **slot)
{
    if (!slot || !*slot) return;
    npg_window_solver *s = *slot;
    npg_arena_release(&s->window);
    if (s->solver) s->row->close(&s->solver);
    npg_energy_close(&s->energy);
    npg_proxy_close(&s->surface);
    npg_release(&s->places);
    npg_release(slot);
}

static npg_status open_surface(npg_window_solver *s)
{
    const npg_mesh *reference = s->facts->reference;
    NPG_TRY(npg_proxy_open(&s->surface, reference, NPG_PROXY_SURFACE));
    NPG_TRY(npg_energy_open(&s->energy, s->surface->mesh, &s->settings.energy));
    NPG_TRY(npg_alloc_array(&s->places, NPG_FOR_FIT, s->vert_count, sizeof *s->places));
    return npg_mesh_closest(s->places, s->surface->mesh, reference->vert_pos, s->vert_count);
}

npg_status npg_window_solver_open(npg_window_solver **out, const npg_solver *row, struct npg_device *device,
                                  const npg_solver_settings *settings, const npg_facts *facts, uint64_t seed)
{
    npg_window_solver *s;
    *out = NULL;
    NPG_TRY(npg_alloc(&s, NPG_FOR_FIT, sizeof *s));
    s->row = row;
    s->settings = *settings;
    s->facts = facts;
    s->vert_count = facts->reference->vert_count;
    s->window.purpose = NPG_FOR_FIT;
    npg_status status = row->needs_poses ? open_surface(s) : NPG_OK;
    const npg_solver_setup setup = {&s->settings, facts, s->surface ? s->surface->mesh : facts->reference,
                                    device, seed};
    if (!status && row->open) status = row->open(&s->solver, &setup);
    if (status) npg_window_solver_close(&s);
    *out = s;
    return status;
}

size_t npg_window_memory(const npg_solver *row, const npg_solver_settings *settings, size_t vert_count,
                         size_t frames, size_t points)
{
    const size_t vector = 3 * sizeof(float);
    size_t surface = vert_count < 2 * NPG_PROXY_SURFACE ? vert_count : NPG_PROXY_SURFACE;
    size_t solved = frames * vert_count * vector, clouds = frames * points * vector;
    if (!row->needs_poses) return 2 * solved + clouds + row->memory(settings, vert_count, frames, points);
    return solved + clouds + 2 * frames * surface * vector + vert_count * sizeof(npg_surface_hit) +
           npg_energy_memory(&settings->energy, surface, frames) +
           row->memory(settings, surface, frames, points);
}

/* ---- the window's frames ---- */

static npg_status take_frames(npg_window_solver *s, npg_held *const *held)
{
    size_t points = 0;
    for (size_t t = 0; t < s->count; t++) points += held[t]->frame.point_count;
    float *at = npg_arena_take(&s->window, points + 1, 3 * sizeof *at);
    s->frames = npg_arena_take(&s->window, s->count, sizeof *s->frames);
    s->posed = npg_arena_take(&s->window, s->count, sizeof *s->posed);
    s->before = npg_arena_take(&s->window, s->energy ? s->count * s->size : 1, sizeof(float));
    s->result = npg_arena_take(&s->window, s->count * s->size, sizeof(float));
    NPG_TRY(npg_arena_status(&s->window));
    for (size_t t = 0; t < s->count; t++) {
        const npg_frame *frame = &held[t]->frame;
        npg_box_local_to_unit(&s->facts->box, at, frame->pos_local, frame->point_count);
        s->frames[t] =
            (npg_solver_frame){frame->index, at, frame->normals, held[t]->solved, frame->point_count};
        at += 3 * frame->point_count;
    }
    return NPG_OK;
}

/* The thinned surface in the aligned poses, and the energy from there. */
static npg_status set_energy(npg_window_solver *s, npg_held *const *held)
{
    for (size_t t = 0; t < s->count; t++) {
        const npg_solver_frame *frame = &s->frames[t];
        float *before = s->before + t * s->size;
        npg_proxy_gather(s->surface, before, frame->solved ? frame->solved : held[t]->frame.vert_unit);
        s->posed[t] = (npg_energy_frame){before,
                                         frame->points,
                                         frame->normals,
                                         frame->point_count,
                                         frame->solved != NULL,
                                         held[t]->frame.sensor_count > 0};
    }
    return npg_energy_set(s->energy, s->posed, s->count);
}

/* How much a window says of a frame against what the windows before it have said: 1 where it is the first to
 * solve, less the farther into the overlap, 0 on the first frame outside. */
static double share_of(const npg_window *window, double index)
{
    double first = (double)window->new_first, last = (double)window->new_last;
    if (!window->direction || (index >= first && index <= last)) return 1;
    int64_t overlap =
        window->direction > 0 ? window->new_first - window->first : window->last - window->new_last;
    double away = window->direction > 0 ? first - index : index - last;
    return fmin(1, fmax(0, ((double)overlap + 1 - away) / (double)(overlap + 1)));
}

/* ---- the solution back ---- */

/* The result becomes each vertex' way from its pose; how long it is in the mean. */
static npg_status add_smoothing(npg_window_solver *s, double *moved)
{
    const float *smoothed = npg_energy_smoothed(s->energy);
    double sum = 0;
    for (size_t i = 0; i < s->count * s->size; i += 3) {
        double sq = 0;
        for (size_t k = i; k < i + 3; k++) {
            if (!isfinite(s->result[k])) return npg_error(NPG_DIVERGED, "the fit is not finite");
            s->result[k] = smoothed[k] + s->result[k] - s->before[k];
            sq += (double)s->result[k] * (double)s->result[k];
        }
        sum += sqrt(sq);
    }
    *moved = 3 * sum / (double)(s->count * s->size);
    return NPG_OK;
}

static void take_pose(npg_held *held)
{
    if (held->solved) return;
    held->solved = held->frame.vert_unit;
    held->frame.vert_unit = NULL;
}

static void keep_posed(npg_window_solver *s, npg_held *held, size_t t, float share)
{
    const float *before = s->before + t * s->size;
    float *way = s->result + t * s->size;
    for (size_t i = 0; i < s->size && held->solved; i++) way[i] = before[i] + share * way[i] - before[i];
    take_pose(held);
    npg_carry(held->solved, s->surface->mesh, s->places, s->vert_count, way);
}

static npg_status keep_unposed(npg_window_solver *s, npg_held *held, size_t t, float share)
{
    const float *now = s->result + t * s->size;
    if (!held->solved) {
        NPG_TRY(npg_alloc_array(&held->solved, NPG_FOR_FRAMES, s->vert_count, 3 * sizeof(float)));
        memcpy(held->solved, now, s->size * sizeof(float));
        return NPG_OK;
    }
    for (size_t i = 0; i < s->size; i++) held->solved[i] += share * (now[i] - held->solved[i]);
    return NPG_OK;
}

static npg_status keep(npg_window_solver *s, npg_window_result *result, npg_held *const *held,
                       const npg_window *window)
{
    if (s->energy) NPG_TRY(add_smoothing(s, &result->moved));
    for (size_t t = 0; t < s->count; t++) {
        float share = (float)share_of(window, (double)held[t]->frame.index);
        if (s->energy)
            keep_posed(s, held[t], t, share);
        else
            NPG_TRY(keep_unposed(s, held[t], t, share));
    }
    return NPG_OK;
}

/* ---- solving ---- */

npg_status npg_window_solve(npg_window_solver *s, npg_window_result *result, npg_held *const *held,
                            const npg_window *window, npg_solver_watch *watch, void *user)
{
    *result = (npg_window_result){.noise = s->energy ? npg_energy_noise(s->energy) : 0};
    s->count = (size_t)(window->last - window->first + 1);
    s->size = 3 * (s->surface ? s->surface->mesh->vert_count : s->vert_count);
    if (s->energy && !s->settings.epochs) {
        for (size_t t = 0; t < s->count; t++) take_pose(held[t]);
        return NPG_OK;
    }
    npg_status status = take_frames(s, held);
    const npg_problem problem = {&s->settings, window, s->frames, s->count, s->energy, s->result};
    if (!status && s->energy) status = set_energy(s, held);
    if (!status) status = s->row->solve(s->solver, &result->solved, &problem, watch, user);
    if (!status) status = keep(s, result, held, window);
    if (s->energy) result->noise = npg_energy_noise(s->energy);
    if (s->energy) result->bridged = npg_energy_bridged(s->energy);
    npg_arena_release(&s->window);
    return status;
}

/* ---- states ---- */

npg_status npg_window_save(npg_window_solver *s, npg_store *store, const npg_solver_moment *moment)
{
    if (s->energy) {
        double noise = npg_energy_noise(s->energy);
        NPG_TRY(npg_store_put(store, "noise", &noise, sizeof noise));
    }
    return s->row->save ? s->row->save(s->solver, store, moment) : NPG_OK;
}

npg_status npg_window_restore(npg_window_solver *s, const npg_record *record)
{
    double noise;
    if (s->energy) {
        NPG_TRY(npg_record_get(record, "noise", &noise, sizeof noise));
        npg_energy_set_noise(s->energy, noise);
    }
    return s->row->restore ? s->row->restore(s->solver, record) : NPG_OK;
}
