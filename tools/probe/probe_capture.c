/* Probe of a capture's files, and what a run of it would take. */
#include "tools/probe/probe_capture.h"

#include <stdlib.h>
#include <string.h>

#include "ingest/ingest.h"
#include "pipeline/cost.h"
#include "pipeline/plan.h"
#include "pipeline/run_settings.h"
#include "tools/listing.h"

#define COUNTS_DIFFER                                                                                        \
    10 /* times between the least and the most points of a frame, for a warning; set by trial */

npg_status npg_probe_count(npg_probe *probe, npg_status status, npg_frame *frame, const char *format,
                           int64_t number)
{
    if (status == NPG_BAD_INPUT) {
        npg_probe_add_fault(probe, number);
        status = NPG_OK;
    } else if (!status) {
        status = npg_probe_add(probe, frame, format, number);
    }
    npg_frame_clear(frame);
    return status;
}

static npg_status add_bytes(void *user, const char *path)
{
    npg_probe *probe = user;
    probe->bytes += npg_file_bytes(path);
    return NPG_OK;
}

npg_status npg_probe_files(npg_probe *probe, const npg_frame_files *list)
{
    for (size_t i = 0; i < list->count; i++) {
        const npg_frame_slot *slot = &list->slots[i];
        npg_frame frame = {0};
        if (!slot->path) continue;
        const char *format = list->rig ? list->rig->layout : npg_reader_for(slot->path);
        NPG_TRY(npg_frame_files_each(list, i, add_bytes, probe));
        npg_status status = npg_frame_files_read(list, i, &frame, &probe->origin);
        NPG_TRY(npg_probe_count(probe, status, &frame, format ? format : "unknown", slot->number));
    }
    if (list->gap_count) {
        char gaps[256];
        npg_frame_files_gaps(gaps, sizeof gaps, list);
        npg_probe_warn(probe, "%zu frames are missing in the numbering: %s", list->gap_count, gaps);
    }
    if (list->left_out) npg_probe_warn(probe, "%zu files with other endings were left out", list->left_out);
    return NPG_OK;
}

void npg_probe_warn_of_all(npg_probe *probe)
{
    size_t readable = probe->frames - probe->unreadable;
    npg_probe_spread counts = npg_probe_counts(probe);
    npg_frame_box box;
    bool has_points = probe->bounds.lo[0] <= probe->bounds.hi[0];
    if (has_points && npg_frame_box_set(&box, &probe->origin, &probe->bounds))
        npg_probe_warn(probe, "%s", npg_error_text());
    if (probe->not_finite)
        npg_probe_warn(probe, "%zu points have coordinates that are not finite", probe->not_finite);
    if (probe->zero_normals) npg_probe_warn(probe, "%zu normals have no direction", probe->zero_normals);
    if (probe->with_normals && probe->with_normals < readable)
        npg_probe_warn(probe, "only %zu of %zu frames have normals", probe->with_normals, readable);
    if (counts.most > COUNTS_DIFFER * counts.least)
        npg_probe_warn(probe, "point counts differ by more than ten times: %zu to %zu", counts.least,
                       counts.most);
}

/* ---- what a run would take ---- */

/* The value of a run's option as a number, or `otherwise` where it is not one. */
static int64_t option_number(const npg_options *options, const char *name, int64_t otherwise)
{
    const char *text = npg_options_get(options, name);
    char *end = NULL;
    long long value = text ? strtoll(text, &end, 10) : 0;
    return text && end != text ? value : otherwise;
}

/* The same where 0 and less have no meaning. */
static size_t positive_number(const npg_options *options, const char *name, int64_t otherwise)
{
    int64_t value = option_number(options, name, otherwise);
    return (size_t)(value > 0 ? value : otherwise);
}

/* The length of the run's windows, as the keyframe stage chooses it. */
static size_t window_of(const npg_probe *probe, const npg_options *options)
{
    int64_t frames = (int64_t)probe->frames;
    int64_t window = npg_plan_window_asked(option_number(options, "window", 0), frames);
    return (size_t)(window > 0 && window < frames ? window : frames);
}

static bool is_aligned(const npg_options *options)
{
    const char *text = npg_options_get(options, "align");
    return !text || !strcmp(text, "yes");
}

static bool is_fused(const npg_options *options)
{
    const char *text = npg_options_get(options, "reference-from"),
               *given = npg_options_get(options, "reference");
    return (!text || !strcmp(text, "all")) && !(given && *given);
}

static double decoder_flops(const npg_options *options)
{
    return npg_cost_decoder_flops((double)positive_number(options, "width-1", 512),
                                  (double)positive_number(options, "width-2", 512),
                                  (double)positive_number(options, "hidden-layers", 2));
}

void npg_probe_estimate_run(npg_estimate *estimate, npg_probe *probe, const npg_options *options)
{
    /* A closed mesh has half as many vertices as faces; a run makes no more than 4 faces per point. */
    size_t faces = positive_number(options, "faces", 20000), most = npg_probe_counts(probe).most;
    npg_cost_basis basis = {.vertices = (faces < 4 * most ? faces : 4 * most) / 2,
                            .epochs = positive_number(options, "epochs", 250),
                            .window = window_of(probe, options),
                            .decoder_flops = decoder_flops(options),
                            .aligned = is_aligned(options),
                            .fused = is_fused(options)};
    npg_probe_estimate(estimate, probe, &basis);
}
