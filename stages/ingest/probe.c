/* Probe: what a capture holds, and what a run of it would take. */
#include "ingest/ingest_internal.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "geometry/limits.h"
#include "pipeline/clock.h"
#include "pipeline/cost.h"
#include "pipeline/order.h"

void npg_probe_warn(npg_probe *probe, const char *format, ...)
{
    char text[1200];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    json_array_append_new(probe->attention, json_string(text));
}

/* ---- frames ---- */

/* When a frame is worth a warning; set by trial. */
#define JUMP_MOST     0.25 /* of the box's middle from frame to frame, in diagonals */
#define GROWTH_MOST   1.5  /* of the box's diagonal from frame to frame, up or down */
#define COUNTS_DIFFER 10   /* times between the least and the most points of a frame */

typedef struct cloud_facts {
    size_t not_finite, zero_normals;
    npg_bounds bounds;
} cloud_facts;

static cloud_facts measure_cloud(const npg_frame *frame)
{
    cloud_facts facts = {.bounds = npg_bounds_empty()};
    for (size_t i = 0; i < frame->point_count; i++) {
        const float *p = frame->pos_local + 3 * i, *n = frame->normals ? frame->normals + 3 * i : NULL;
        if (isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]))
            npg_bounds_add_points(&facts.bounds, p, 1);
        else
            facts.not_finite++;
        /* readers give unit length, or 0 where there is no direction */
        if (n && !(fabsf(n[0]) + fabsf(n[1]) + fabsf(n[2]) > 0.5f)) facts.zero_normals++;
    }
    return facts;
}

static bool is_empty(const npg_bounds *bounds)
{
    return !(bounds->lo[0] <= bounds->hi[0]);
}

static void warn_of_frame(npg_probe *probe, const cloud_facts *facts, const npg_frame *frame, int64_t number)
{
    size_t usable = frame->point_count - facts->not_finite;
    if (usable < NPG_PATCH)
        npg_probe_warn(probe, "frame %lld has only %zu usable points, fewer than %d: --keep-going skips it",
                       (long long)number, usable, NPG_PATCH);
    if (is_empty(&facts->bounds)) return;
    double size = npg_bounds_diagonal(&facts->bounds);
    if (usable >= NPG_PATCH && !(size > 0))
        npg_probe_warn(probe, "frame %lld: all points are equal", (long long)number);
    if (!is_empty(&probe->last)) {
        double before = npg_bounds_diagonal(&probe->last), moved_sq = 0;
        for (int k = 0; k < 3; k++) {
            double moved =
                0.5 * (facts->bounds.lo[k] + facts->bounds.hi[k] - probe->last.lo[k] - probe->last.hi[k]);
            moved_sq += moved * moved;
        }
        if (sqrt(moved_sq) > JUMP_MOST * fmax(before, size))
            npg_probe_warn(probe, "frame %lld: the box's middle jumps by %.0f %% of its diagonal",
                           (long long)number, 100 * sqrt(moved_sq) / fmax(before, size));
        if (fmax(before, size) > GROWTH_MOST * fmin(before, size))
            npg_probe_warn(probe, "frame %lld: the box's diagonal changes from %.4g to %.4g",
                           (long long)number, before, size);
    }
    probe->last = facts->bounds;
}

static npg_status add_frame(npg_probe *probe, const npg_frame *frame, const char *format, int64_t number)
{
    cloud_facts facts = measure_cloud(frame);
    npg_capture_facts *all = probe->facts;
    NPG_TRY(npg_grow(&probe->counts, &probe->count_room, all->frames - all->unreadable + 1,
                     sizeof *probe->counts, NPG_FOR_FILES));
    probe->counts[all->frames++ - all->unreadable] = (int64_t)frame->point_count;
    all->with_normals += frame->normals != NULL;
    all->points_total += frame->point_count;
    all->not_finite += facts.not_finite;
    probe->zero_normals += facts.zero_normals;
    if (!is_empty(&facts.bounds)) npg_bounds_add(&probe->bounds, &facts.bounds);
    json_int_t seen = json_integer_value(json_object_get(probe->formats, format));
    json_object_set_new(probe->formats, format, json_integer(seen + 1));
    warn_of_frame(probe, &facts, frame, number);
    json_array_append_new(probe->per_frame,
                          json_pack("{s:I,s:I,s:I,s:b}", "number", (json_int_t)number, "points",
                                    (json_int_t)frame->point_count, "not_finite",
                                    (json_int_t)facts.not_finite, "normals", frame->normals != NULL));
    return NPG_OK;
}

static void add_fault(npg_probe *probe, int64_t number)
{
    const char *text = npg_error_text();
    if (!probe->facts->unreadable++) snprintf(probe->first_fault, sizeof probe->first_fault, "%s", text);
    probe->facts->frames++;
    npg_probe_warn(probe, "%s", text);
    json_array_append_new(probe->per_frame,
                          json_pack("{s:I,s:s}", "number", (json_int_t)number, "error", text));
}

/* Count a frame that was read with `status`, and clear it.  Bad data goes into the list; any other failure is returned. */
static npg_status count_frame(npg_probe *probe, npg_status status, npg_frame *frame, const char *format,
                              int64_t number)
{
    if (status == NPG_BAD_INPUT) {
        add_fault(probe, number);
        status = NPG_OK;
    } else if (!status) {
        status = add_frame(probe, frame, format, number);
    }
    npg_frame_clear(frame);
    return status;
}

static npg_status add_bytes(void *user, const char *path)
{
    npg_capture_facts *facts = user;
    struct stat info;
    if (!stat(path, &info)) facts->bytes += (uint64_t)info.st_size;
    return NPG_OK;
}

npg_status npg_probe_stream(npg_probe *probe)
{
    npg_stream *stream;
    npg_status status = NPG_OK;
    bool is_broken = false; /* nothing behind it can be found again */
    double begin_s = npg_clock_s();
    NPG_TRY(npg_stream_open(&stream, STDIN_FILENO, "standard input", NULL, NULL));
    for (int64_t number = 0; !status && !is_broken; number++) {
        npg_frame frame = {0};
        status = npg_stream_next(stream, &frame, &probe->origin);
        is_broken = status == NPG_BAD_INPUT;
        if (status != NPG_END) status = count_frame(probe, status, &frame, "stream", number);
    }
    npg_stream_close(&stream);
    probe->read_s = npg_clock_s() - begin_s;
    return status == NPG_END ? NPG_OK : status;
}

npg_status npg_probe_files(npg_probe *probe, const npg_frame_files *list)
{
    double begin_s = npg_clock_s();
    for (size_t i = 0; i < list->count; i++) {
        const npg_frame_slot *slot = &list->slots[i];
        npg_frame frame = {0};
        if (!slot->path) continue;
        const char *format = list->rig ? "rig.json" : npg_reader_for(slot->path);
        NPG_TRY(npg_frame_files_each(list, i, add_bytes, probe->facts));
        npg_status status = npg_frame_files_read(list, i, &frame, &probe->origin);
        NPG_TRY(count_frame(probe, status, &frame, format ? format : "unknown", slot->number));
    }
    probe->read_s = npg_clock_s() - begin_s;
    probe->facts->missing = list->gap_count;
    if (list->gap_count) {
        char gaps[256];
        npg_frame_files_gaps(gaps, sizeof gaps, list);
        npg_probe_warn(probe, "%zu frames are missing in the numbering: %s", list->gap_count, gaps);
    }
    if (list->rig && list->rig->blank_count)
        npg_probe_warn(probe, "%zu depth images have no depth in any pixel, the first is %s",
                       list->rig->blank_count, list->rig->first_blank);
    if (list->left_out) npg_probe_warn(probe, "%zu files with other endings were left out", list->left_out);
    return NPG_OK;
}

/* What only shows when all frames have been read. */
static void finish_counts(npg_probe *probe)
{
    npg_capture_facts *all = probe->facts;
    size_t readable = all->frames - all->unreadable;
    npg_frame_box box;
    for (int a = 0; a < 3; a++) {
        all->box_low[a] = probe->origin.world[a] + probe->bounds.lo[a];
        all->box_high[a] = probe->origin.world[a] + probe->bounds.hi[a];
    }
    if (readable) {
        qsort(probe->counts, readable, sizeof *probe->counts, npg_order_int64);
        all->points_least = (size_t)probe->counts[0];
        all->points_median = (size_t)probe->counts[readable / 2];
        all->points_most = (size_t)probe->counts[readable - 1];
    }
    if (!is_empty(&probe->bounds) && npg_frame_box_set(&box, &probe->origin, &probe->bounds))
        npg_probe_warn(probe, "%s", npg_error_text());
    if (all->not_finite)
        npg_probe_warn(probe, "%zu points have coordinates that are not finite", all->not_finite);
    if (probe->zero_normals) npg_probe_warn(probe, "%zu normals have no direction", probe->zero_normals);
    if (all->with_normals && all->with_normals < readable)
        npg_probe_warn(probe, "only %zu of %zu frames have normals", all->with_normals, readable);
    if (all->points_most > COUNTS_DIFFER * all->points_least)
        npg_probe_warn(probe, "point counts differ by more than ten times: %zu to %zu", all->points_least,
                       all->points_most);
    all->attention = json_array_size(probe->attention);
}

/* ---- what a run would take ---- */

static bool is_set_to(const npg_options *options, const char *name, const char *word)
{
    const char *text = npg_options_get(options, name);
    return !text || !strcmp(text, word);
}

/* Processor seconds of a run that aligns its frames. */
static double aligned_s(const npg_capture_facts *all, const npg_options *options, double most)
{
    const double per_read_point = 2e-6, frames = (double)all->frames, points = (double)all->points_total;
    double pass_s = npg_cost_pass_s(frames, points / fmax(frames, 1));
    double work_s = per_read_point * points + npg_cost_choice_s(most, all->with_normals == all->frames) +
                    npg_cost_surface_s(fmin(most, NPG_START_POINTS_MOST)) + pass_s;
    if (!is_set_to(options, "reference-from", "all") || !is_set_to(options, "reference", "")) return work_s;
    return work_s + pass_s + npg_cost_surface_s(fmin(points, NPG_COST_FUSED_POINTS));
}

/* The same of one that fits them by the network alone. */
static double network_s(const npg_options *options, double vertex_frames, double cores)
{
    double flops = npg_cost_decoder_flops(npg_options_number(options, "width-1", 512),
                                          npg_options_number(options, "width-2", 512));
    return npg_cost_network_s(vertex_frames * npg_options_number(options, "epochs", 250) * flops,
                              cores * NPG_COST_CORE_FLOPS);
}

/* What a run with these options would take on this machine's cores, were they as fast as those of the guide's
 * figures; memory: of the process and of Poisson's together. */
static void estimate(npg_probe *probe, const npg_options *options)
{
    npg_capture_facts *all = probe->facts;
    const double decoder_bytes = 1.4e6, poisson_bytes = 125e6 + 2e3 * NPG_COST_FUSED_POINTS;
    const double frames = (double)all->frames, most = (double)all->points_most;
    const double cores = fmax((double)sysconf(_SC_NPROCESSORS_ONLN), 1);
    /* a closed mesh has half as many vertices as faces; a run makes no more than 4 faces per point */
    const double vertices = fmin(npg_options_number(options, "faces", 20000), 4 * most) / 2;
    const bool is_aligned = is_set_to(options, "align", "yes");
    double window =
        (double)npg_plan_window_asked((int64_t)npg_options_number(options, "window", 0), all->frames);
    if (!(window > 0 && window < frames)) window = frames;
    all->vertices = (size_t)vertices;
    all->window = (size_t)window;
    if (is_aligned) {
        /* the second core waits while Poisson and the chain's serial parts run */
        all->time_s = probe->read_s + aligned_s(all, options, most) / (cores < 2 ? 1 : NPG_COST_BUSY);
        all->memory_bytes = 100e6 + window * vertices * 200 + 40 * 24 * most + poisson_bytes;
    } else { /* all samples and activations of a window's frames */
        all->time_s = 3 * probe->read_s + network_s(options, frames * vertices, cores);
        all->memory_bytes = 320e6 + window * (vertices * 2400 + 48 * most) + 40 * 24 * most;
    }
    /* a mesh, and in job/ the alignment, of every frame; the decoder of every window */
    all->disk_bytes = frames * vertices * (24 + 2 * 13 + 12) + frames / window * decoder_bytes;
}

void npg_probe_finish(npg_probe *probe, const npg_options *options)
{
    finish_counts(probe);
    estimate(probe, options);
}
