/* Optimize as work to be timed: carrying a dense surface, and the fit of a window. */
#include "optimize/carry.h"
#include "optimize/fit.h"
#include "optimize/optimize.h"

enum { SAMPLES = 1500 }; /* the default of option samples */

/* ---- carrying ---- */

typedef struct dense {
    npg_carry *carry;
    float *verts, *before, *samples; /* V x 3, S x 3, S x 3 */
} dense;

static npg_status carry(void *user)
{
    dense *d = user;
    npg_carriers_move(d->carry->carriers, d->carry->vert_count, d->verts, d->before, d->samples);
    return NPG_OK;
}

static npg_status open_dense(dense *d, const npg_mesh *mesh)
{
    NPG_TRY(npg_carry_open(&d->carry, mesh, SAMPLES, NPG_THIN_SURFACE));
    size_t count = d->carry->samples->mesh->vert_count;
    NPG_TRY(npg_alloc_array(&d->verts, NPG_FOR_RUN, mesh->vert_count, 3 * sizeof(float)));
    NPG_TRY(npg_alloc_array(&d->before, NPG_FOR_RUN, count, 3 * sizeof(float)));
    return npg_alloc_array(&d->samples, NPG_FOR_RUN, count, 3 * sizeof(float));
}

static npg_status visit_carry(dense *d, npg_work_visit *visit, void *user)
{
    const double V = (double)d->carry->vert_count, S = (double)d->carry->samples->mesh->vert_count;
    /* a vertex: the weighted sum of three differences; its own data in and out, the samples once */
    npg_work work = {.name = "dense_carry",
                     .call = carry,
                     .user = d,
                     .flops = 27 * V,
                     .bytes = V * (24 + 24) + S * 24,
                     .vertex_frames = V,
                     .on_host = true};
    return visit(user, &work);
}

npg_status npg_carry_work(const npg_mesh *mesh, npg_work_visit *visit, void *user)
{
    dense d = {0};
    npg_status status = open_dense(&d, mesh);
    if (!status) status = visit_carry(&d, visit, user);
    npg_carry_close(&d.carry);
    npg_release(&d.verts);
    npg_release(&d.before);
    npg_release(&d.samples);
    return status;
}

/* ---- the fit ---- */

typedef struct watcher {
    npg_epoch_visit *visit;
    void *user;
} watcher;

static npg_status watch(void *user, const npg_fit_step *step)
{
    const watcher *w = user;
    return w->visit(w->user, step->epoch);
}

static npg_status default_settings(npg_fit_settings *settings, int64_t epochs)
{
    npg_options *options;
    NPG_TRY(npg_options_open(&options));
    npg_fit_settings_fill(settings, options);
    settings->epochs = epochs;
    npg_options_close(&options);
    return NPG_OK;
}

static void fill_frames(npg_fit_frame *frames, const float *const *points, size_t point_count, size_t count)
{
    for (size_t t = 0; t < count; t++)
        frames[t] = (npg_fit_frame){.index = (int64_t)t,
                                    .time = count > 1 ? (double)t / (double)(count - 1) : 0,
                                    .points = points[t],
                                    .count = point_count};
}

npg_status npg_fit_once(npg_device *device, const npg_mesh *mesh, const float *const *points,
                        size_t point_count, size_t frame_count, int64_t epochs, npg_epoch_visit *visit,
                        void *user)
{
    npg_fit_settings settings;
    npg_fit_frame *frames = NULL;
    npg_fit *fit = NULL;
    watcher w = {visit, user};
    NPG_TRY(default_settings(&settings, epochs));
    npg_status status = npg_alloc_array(&frames, NPG_FOR_RUN, frame_count, sizeof *frames);
    if (!status) fill_frames(frames, points, point_count, frame_count);
    if (!status) status = npg_fit_open(&fit, device, &settings, mesh, 1);
    if (!status) status = npg_fit_begin(fit, frames, frame_count, (int64_t)frame_count / 2);
    if (!status) status = visit(user, -1);
    if (!status) status = npg_fit_run(fit, 0, epochs, watch, &w);
    npg_fit_close(&fit);
    npg_release(&frames);
    return status;
}
