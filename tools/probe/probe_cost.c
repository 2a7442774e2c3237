/* Cost: what a run of a capture would take in time, memory and disk. */
#include "tools/probe/probe_cost.h"

#include <math.h>
#include <pthread.h>
#include <unistd.h>

#include "pipeline/clock.h"
#include "pipeline/cost.h"

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

/* Processor seconds of a run that aligns its frames, on a machine of NPG_COST_CORE_FLOPS. */
static double aligned_work_s(const npg_probe *probe, const npg_cost_basis *basis, size_t most)
{
    const double per_read_point = 2e-6, frames = (double)probe->frames, points = (double)probe->point_total;
    double first = fmin((double)most, NPG_START_POINTS_MOST);
    double pass_s = npg_cost_pass_s(frames, points / fmax(frames, 1), npg_probe_step(probe));
    double work_s = per_read_point * points +
                    npg_cost_choice_s((double)most, probe->with_normals == probe->frames) +
                    npg_cost_surface_s(first) + pass_s;
    return basis->fused ? work_s + pass_s + npg_cost_surface_s(fmin(points, NPG_COST_FUSED_POINTS)) : work_s;
}

/* The second core waits while Poisson and the chain's serial parts run. */
static double aligned_s(const npg_probe *probe, const npg_cost_basis *basis, size_t most, double flops)
{
    double cores = fmax((double)sysconf(_SC_NPROCESSORS_ONLN), 1);
    double busy = cores < 2 ? 1 : NPG_COST_BUSY;
    return aligned_work_s(probe, basis, most) * NPG_COST_CORE_FLOPS / fmax(flops / cores, 1) / busy;
}

static double network_s(const npg_cost_basis *basis, double frames, double flops)
{
    double samples = frames * (double)basis->vertices * (double)basis->epochs;
    return npg_cost_network_s(samples * basis->decoder_flops, flops);
}

/* Of the network: all samples and activations of a window's frames.  Of aligned frames: the window, chunks in
 * the rings, and the process that Poisson runs in. */
static double memory_bytes(const npg_cost_basis *basis, double in_window, double most)
{
    double vertices = (double)basis->vertices;
    if (!basis->aligned) return 320e6 + in_window * (vertices * 2400 + 48 * most) + 40 * 24 * most;
    return 100e6 + in_window * vertices * 200 + 40 * 24 * most + 125e6 + 2e3 * NPG_COST_FUSED_POINTS;
}

void npg_probe_estimate(npg_estimate *e, const npg_probe *probe, const npg_cost_basis *basis)
{
    const double decoder_bytes = 1.4e6;
    double frames = (double)probe->frames, in_window = fmin(frames, (double)basis->window);
    size_t most = 0;
    for (size_t i = 0; i + probe->unreadable < probe->frames; i++)
        if (probe->counts[i] > most) most = probe->counts[i];
    *e = (npg_estimate){.basis = *basis, .flops = measure_flops()};
    e->time_s = basis->aligned ? probe->read_s + aligned_s(probe, basis, most, e->flops)
                               : 3 * probe->read_s + network_s(basis, frames, e->flops);
    e->memory_bytes = memory_bytes(basis, in_window, (double)most);
    /* a mesh, and in job/ the alignment, of every frame; the decoder of every window */
    e->disk_bytes =
        frames * (double)basis->vertices * (24 + 2 * 13 + 12) + frames / in_window * decoder_bytes;
}
