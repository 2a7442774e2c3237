/* Meter: slices of the device's peaks, and pairs with them. */
#include "tools/bench/bench_meter.h"

#include <stdlib.h>

#include "pipeline/busy.h"
#include "pipeline/order.h"

#define SLICE_S    8e-3               /* of a slice, at least; set by trial */
#define COPY_BYTES ((size_t)64 << 20) /* of each buffer: more than the caches hold */

npg_spread npg_spread_of(double *values, size_t count)
{
    qsort(values, count, sizeof *values, npg_order_double);
    return (npg_spread){values[count / 4], values[count / 2], values[count - 1 - count / 4]};
}

/* ---- clocks ---- */

typedef struct clocks {
    double wall_s, cpu_s;
} clocks;

static clocks now(void)
{
    npg_busy busy = npg_busy_now(); /* helper processes work for a row, too */
    return (clocks){busy.wall_s, busy.cpu_s + busy.children_s};
}

/* Busy and wall seconds of `calls` calls. */
static npg_status run(double *busy_s, double *wall_s, const npg_meter *m, npg_call *call, void *user,
                      size_t calls)
{
    const npg_device_info *info = npg_device_facts(m->device);
    clocks start = now();
    npg_status status = NPG_OK;
    for (size_t i = 0; i < calls && !status; i++) status = call(user);
    if (!status) status = npg_device_finish(m->device);
    clocks end = now();
    *wall_s = end.wall_s - start.wall_s;
    *busy_s = info->is_cpu ? (end.cpu_s - start.cpu_s) / info->units : *wall_s;
    if (*busy_s < 1e-9) *busy_s = 1e-9;
    return status;
}

/* ---- slices ---- */

static npg_status multiply_add(void *user)
{
    npg_meter *m = user;
    return NPG_LAUNCH_GROUPS(m->program, "peak_multiply_add", m->groups, m->local, NPG_BUF(&m->a),
                             NPG_INT(m->rounds), NPG_REAL(0.999), NPG_REAL(1e-3));
}

static npg_status copy(void *user)
{
    npg_meter *m = user;
    return NPG_LAUNCH_GROUPS(m->program, "peak_copy", m->groups, m->local, NPG_BUF(&m->a), NPG_BUF(&m->b),
                             NPG_INT(m->vectors));
}

/* So many rounds that a slice takes some milliseconds. */
static npg_status choose_rounds(npg_meter *m)
{
    double busy_s = 0, wall_s;
    m->rounds = 1;
    NPG_TRY(run(&busy_s, &wall_s, m, multiply_add, m, 1)); /* the first call builds */
    NPG_TRY(run(&busy_s, &wall_s, m, copy, m, 1));
    for (m->rounds = 1000; m->rounds < 1 << 28; m->rounds *= 2) {
        NPG_TRY(run(&busy_s, &wall_s, m, multiply_add, m, 1));
        if (busy_s > SLICE_S) return NPG_OK;
    }
    return NPG_OK;
}

npg_status npg_meter_open(npg_meter *m, npg_device *device, size_t repeat)
{
    const npg_tuning *t = npg_device_tuning(device);
    *m = (npg_meter){.device = device, .repeat = repeat, .local = (size_t)t->mlp_local};
    m->groups = (size_t)npg_device_facts(device)->units * (t->mlp_local > 1 ? 16 : 1);
    double items = (double)(m->groups * m->local), vector = t->mlp_vector;
    m->vectors = (int)((double)COPY_BYTES / (items * vector * 4));
    m->round_flops = items * 2 * vector * t->mlp_tile_rows * t->mlp_tile_vectors;
    m->vector_bytes = items * vector * 8;
    npg_status status = npg_program_open(&m->program, device, "peak", "");
    if (!status) status = npg_buffer_open(&m->a, device, COPY_BYTES);
    if (!status) status = npg_buffer_open(&m->b, device, COPY_BYTES);
    if (!status) status = choose_rounds(m);
    if (status) npg_meter_close(m);
    return status;
}

void npg_meter_close(npg_meter *m)
{
    npg_buffer_close(&m->a);
    npg_buffer_close(&m->b);
    npg_program_close(&m->program);
}

/* Operations and bytes per busy second, now. */
static npg_status slices(double *flops, double *bytes, npg_meter *m)
{
    double busy_s, wall_s;
    NPG_TRY(run(&busy_s, &wall_s, m, multiply_add, m, 1));
    *flops = m->round_flops * m->rounds / busy_s;
    NPG_TRY(run(&busy_s, &wall_s, m, copy, m, 1));
    *bytes = m->vector_bytes * m->vectors / busy_s;
    if (*flops > m->flops_per_s) m->flops_per_s = *flops;
    if (*bytes > m->bytes_per_s) m->bytes_per_s = *bytes;
    return NPG_OK;
}

/* ---- pairs ---- */

static npg_status take_pairs(double *figures[4], npg_meter *m, npg_call *call, void *user, size_t calls)
{
    for (size_t i = 0; i < m->repeat; i++) {
        double flops, bytes, busy_s, wall_s;
        NPG_TRY(slices(&flops, &bytes, m));
        NPG_TRY(run(&busy_s, &wall_s, m, call, user, calls));
        figures[0][i] = wall_s / (double)calls;
        figures[1][i] = busy_s / (double)calls;
        figures[2][i] = flops * figures[1][i];
        figures[3][i] = bytes * figures[1][i];
    }
    return NPG_OK;
}

npg_status npg_meter_time(npg_timing *timing, npg_meter *m, npg_call *call, void *user)
{
    double *all, busy_s, wall_s;
    size_t n = m->repeat;
    NPG_TRY(run(&busy_s, &wall_s, m, call, user, 1)); /* the first may build */
    NPG_TRY(run(&busy_s, &wall_s, m, call, user, 1));
    size_t calls = busy_s < SLICE_S ? (size_t)(SLICE_S / busy_s) + 1 : 1;
    if (calls > 10000) calls = 10000; /* a call too short for the clock must not run for ever */
    NPG_TRY(npg_alloc_array(&all, NPG_FOR_RUN, 4 * n, sizeof *all));
    double *figures[4] = {all, all + n, all + 2 * n, all + 3 * n};
    npg_status status = take_pairs(figures, m, call, user, calls);
    if (!status)
        *timing = (npg_timing){npg_spread_of(figures[0], n).median, npg_spread_of(figures[1], n),
                               npg_spread_of(figures[2], n), npg_spread_of(figures[3], n)};
    npg_release(&all);
    return status;
}
