/* Record: a solved window to disk. */
#include "optimize/record.h"

#include <stdio.h>

#include "kernels/latent.h"
#include "pipeline/archive.h"

static npg_record_facts facts_of(const npg_record_source *from)
{
    const npg_fit_settings *s = from->settings;
    const npg_window *w = from->window;
    return (npg_record_facts){.first = w->first,
                              .last = w->last,
                              .new_first = w->new_first,
                              .new_last = w->new_last,
                              .direction = w->direction,
                              .time_plan = from->facts->plan,
                              .is_aligned = npg_window_result(from->solver) != NULL,
                              .vert_count = (int64_t)from->facts->reference->vert_count,
                              .rotation = s->rotation,
                              .time_kind = s->time_code,
                              .frequencies = s->frequencies,
                              .width_1 = s->width_1,
                              .width_2 = s->width_2,
                              .seed = from->seed,
                              .slope = s->slope,
                              .time_span = s->time_span};
}

static npg_status put_features(npg_archive_writer *out, npg_fit *fit, size_t vert_count)
{
    float *features;
    size_t size = vert_count * NPG_LATENT_CHANNELS * sizeof *features;
    NPG_TRY(npg_alloc(&features, NPG_FOR_FILES, size));
    npg_status status = npg_fit_features(fit, features);
    if (!status) status = npg_archive_put(out, "features", features, size);
    npg_release(&features);
    return status;
}

static npg_status put_decoder(npg_archive_writer *out, npg_fit *fit, int64_t layers)
{
    npg_fit_parts parts = npg_fit_open_parts(fit);
    size_t count;
    int64_t *step;
    const double *code = npg_time_code_parts(parts.time_code, &count, &step);
    NPG_TRY(npg_archive_put(out, "decoder", parts.params, parts.param_count * sizeof *parts.params));
    if (layers != NPG_RECORD_LAYERS) NPG_TRY(npg_archive_put(out, "layers", &layers, sizeof layers));
    return npg_archive_put(out, "time", code, count * sizeof *code);
}

/* Aligned frames: where they are now. */
static npg_status put_poses(npg_archive_writer *out, const npg_record_source *from, size_t size)
{
    for (size_t i = 0; i < from->held_count; i++) {
        const npg_held *held = &from->held[i];
        int64_t index = held->frame.index;
        char name[NPG_BLOCK_NAME];
        if (index < from->window->first || index > from->window->last) continue;
        snprintf(name, sizeof name, "pose.%lld", (long long)index);
        NPG_TRY(npg_archive_put(out, name, held->solved, size));
    }
    return NPG_OK;
}

static npg_status put_all(npg_archive_writer *out, const npg_record_source *from)
{
    const npg_record_facts facts = facts_of(from);
    npg_fit *fit = npg_window_fit(from->solver);
    size_t verts = (size_t)facts.vert_count, size = verts * 3 * sizeof(float);
    NPG_TRY(npg_archive_put(out, "window", &facts, sizeof facts));
    NPG_TRY(npg_archive_put(out, "rest", from->facts->reference->vert_pos, size));
    if (facts.is_aligned) return put_poses(out, from, size);
    NPG_TRY(put_decoder(out, fit, from->settings->hidden_layers));
    return put_features(out, fit, verts);
}

npg_status npg_record_save(const char *path, const npg_record_source *source)
{
    npg_archive_writer *out;
    NPG_TRY(npg_archive_create(&out, path));
    npg_status status = put_all(out, source);
    if (!status) return npg_archive_commit(&out);
    npg_archive_discard(&out);
    return status;
}
