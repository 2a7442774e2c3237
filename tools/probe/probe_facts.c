/* Probe: what a capture holds, frame by frame and as a whole. */
#include "tools/probe/probe_facts.h"

#include <math.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/clock.h"

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

/* ---- what a run would take ---- */

enum { LANES = 128, BURST = 20000 };

/* A burst of multiply-adds with enough independent sums that the widest registers are filled. */
#define MULTIPLY_ADDS                                                                                        \
    for (int burst = 0; burst < BURST; burst++)                                                              \
        for (int i = 0; i < LANES; i++) sums[i] = __builtin_fmaf(sums[i], 0.9999f, 0.25f);

#ifdef __x86_64__
__attribute__((target("avx512f"))) static void burst_avx512(float *restrict sums)
{
    MULTIPLY_ADDS
}
__attribute__((target("avx2,fma"))) static void burst_avx2(float *restrict sums)
{
    MULTIPLY_ADDS
}
#endif
static void burst_plain(float *restrict sums)
{
    for (int burst = 0; burst < BURST; burst++)
        for (int i = 0; i < LANES; i++) sums[i] = sums[i] * 0.9999f + 0.25f;
}

static void do_burst(float *sums)
{
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx512f")) {
        burst_avx512(sums);
        return;
    }
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
        burst_avx2(sums);
        return;
    }
#endif
    burst_plain(sums);
}

/* Multiply-adds of one thread for about 30 ms of its processor time. */
static void *multiply_add(void *flops)
{
    float sums[LANES];
    double begin_s = npg_clock_thread_s(), elapsed_s = 0, count = 0;
    for (int i = 0; i < LANES; i++) sums[i] = (float)i;
    while (elapsed_s < 0.03) {
        do_burst(sums);
        count += 2.0 * LANES * BURST;
        elapsed_s = npg_clock_thread_s() - begin_s;
    }
    volatile float keep = 0;
    for (int i = 0; i < LANES; i++) keep = keep + sums[i];
    *(double *)flops = count / elapsed_s;
    return NULL;
}

static double measure_flops(void)
{
    enum { THREADS_MAX = 256 };
    pthread_t threads[THREADS_MAX];
    double flops[THREADS_MAX], sum = 0;
    long cores = sysconf(_SC_NPROCESSORS_ONLN), started = 0;
    for (; started < cores && started < THREADS_MAX; started++)
        if (pthread_create(&threads[started], NULL, multiply_add, &flops[started])) break;
    for (long i = 0; i < started; i++) {
        pthread_join(threads[i], NULL);
        sum += flops[i];
    }
    return sum;
}

/* The network costs 1.72 MFLOP for a vertex, a frame and an epoch, forward and backward, and is nearly all
 * there is to do; kernels reach about as much of a wide machine's peak as this measurement without wide
 * registers does. */
static double network_s(const npg_probe *probe, size_t vertices, size_t epochs, double flops)
{
    const double flop_per_vertex = 1.72e6;
    return flop_per_vertex * (double)probe->frames * (double)vertices * (double)epochs / fmax(0.5 * flops, 1);
}

/* Aligned frames: processor seconds of one core, brought to this machine's by its multiply-adds.  Taken by hand
 * from one run of a clean dancer (17 frames of 5000 points) on a loaded machine, and tested on no other: noise
 * and lost frames, which nothing here can see, make alignment take longer. */
static double aligned_s(const npg_probe *probe, size_t most, double flops)
{
    const double per_run = 5, per_frame = 0.65, per_point = 4e-6, per_surface_point = 130e-6,
                 core_flops = 130e9;
    double points = (double)probe->point_total, cores = (double)sysconf(_SC_NPROCESSORS_ONLN);
    double surfaces =
        fmin((double)most, 40000) + fmin(points, 50000); /* the keyframe's, and that of all frames */
    double work_s =
        per_run + per_frame * (double)probe->frames + per_point * points + per_surface_point * surfaces;
    double busy = fmin(fmax(cores, 1), 2) * 0.75; /* cores that there is work for, on the average */
    return work_s * core_flops / fmax(flops / fmax(cores, 1), 1) / busy;
}

void npg_probe_estimate(npg_estimate *e, const npg_probe *probe, size_t vertices, size_t epochs,
                        size_t window, bool aligned)
{
    /* Set so that the estimates fit within a factor of two, as the verb says of them. */
    const double fit_bytes_per_vertex = 2400, fixed_bytes = 320e6, decoder_bytes = 1.4e6;
    double frames = (double)probe->frames, in_window = fmin(frames, (double)window);
    size_t most = 0;
    for (size_t i = 0; i + probe->unreadable < probe->frames; i++)
        if (probe->counts[i] > most) most = probe->counts[i];
    *e = (npg_estimate){.vertices = vertices, .epochs = epochs, .window = window, .flops = measure_flops()};
    e->time_s = aligned ? probe->read_s + aligned_s(probe, most, e->flops)
                        : 3 * probe->read_s + network_s(probe, vertices, epochs, e->flops);
    e->memory_bytes = fixed_bytes +
                      in_window * ((double)vertices * fit_bytes_per_vertex + 48 * (double)most) +
                      40 * 24 * (double)most;
    /* a mesh, and in job/ the alignment, of every frame; the decoder of every window */
    e->disk_bytes = frames * (double)vertices * (24 + 2 * 13 + 12) + frames / in_window * decoder_bytes;
}
