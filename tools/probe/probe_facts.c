/* Probe: what a capture holds, frame by frame and as a whole. */
#include "tools/probe/probe_facts.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void npg_probe_init(npg_probe *probe)
{
    *probe = (npg_probe){.bounds = npg_bounds_empty(),
                         .last = npg_bounds_empty(),
                         .formats = json_object(),
                         .attention = json_array(),
                         .per_frame = json_array()};
}

void npg_probe_uninit(npg_probe *probe)
{
    npg_release(&probe->counts);
    npg_probe_motion_uninit(&probe->motion);
    json_decref(probe->formats);
    json_decref(probe->attention);
    json_decref(probe->per_frame);
}

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
#define USABLE_LEAST 4    /* points: no closed surface has fewer                   */
#define JUMP_MOST    0.25 /* of the box's middle from frame to frame, in diagonals */
#define GROWTH_MOST  1.5  /* of the box's diagonal from frame to frame, up or down */

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
    if (usable < USABLE_LEAST)
        npg_probe_warn(probe, "frame %lld has only %zu usable points", (long long)number, usable);
    if (is_empty(&facts->bounds)) return;
    double size = npg_bounds_diagonal(&facts->bounds);
    if (usable >= USABLE_LEAST && !(size > 0))
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

npg_status npg_probe_add(npg_probe *probe, const npg_frame *frame, const char *format, int64_t number)
{
    cloud_facts facts = measure_cloud(frame);
    NPG_TRY(npg_grow(&probe->counts, &probe->count_room, probe->frames - probe->unreadable + 1,
                     sizeof *probe->counts, NPG_FOR_FILES));
    probe->counts[probe->frames - probe->unreadable] = frame->point_count;
    probe->frames++;
    probe->with_normals += frame->normals != NULL;
    probe->point_total += frame->point_count;
    probe->not_finite += facts.not_finite;
    probe->zero_normals += facts.zero_normals;
    if (!is_empty(&facts.bounds)) npg_bounds_add(&probe->bounds, &facts.bounds);
    json_int_t seen = json_integer_value(json_object_get(probe->formats, format));
    json_object_set_new(probe->formats, format, json_integer(seen + 1));
    warn_of_frame(probe, &facts, frame, number);
    NPG_TRY(npg_probe_motion_add(&probe->motion, frame));
    json_array_append_new(probe->per_frame,
                          json_pack("{s:I,s:I,s:I,s:b}", "number", (json_int_t)number, "points",
                                    (json_int_t)frame->point_count, "not_finite",
                                    (json_int_t)facts.not_finite, "normals", frame->normals != NULL));
    return NPG_OK;
}

void npg_probe_add_fault(npg_probe *probe, int64_t number)
{
    const char *text = npg_error_text();
    if (!probe->unreadable) snprintf(probe->first_fault, sizeof probe->first_fault, "%s", text);
    probe->frames++;
    probe->unreadable++;
    npg_probe_warn(probe, "%s", text);
    json_array_append_new(probe->per_frame,
                          json_pack("{s:I,s:s}", "number", (json_int_t)number, "error", text));
}

static int compare_sizes(const void *a, const void *b)
{
    size_t x = *(const size_t *)a, y = *(const size_t *)b;
    return (x > y) - (x < y);
}

npg_probe_spread npg_probe_counts(npg_probe *probe)
{
    size_t count = probe->frames - probe->unreadable;
    if (!count) return (npg_probe_spread){0};
    qsort(probe->counts, count, sizeof *probe->counts, compare_sizes);
    return (npg_probe_spread){probe->counts[0], probe->counts[count / 2], probe->counts[count - 1]};
}

double npg_probe_step(const npg_probe *probe)
{
    return probe->motion.pairs ? probe->motion.sum / (double)probe->motion.pairs : 0;
}
