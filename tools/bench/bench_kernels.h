/* Bench kernels: every kernel and the carrying of the dense surface as work to be timed, with the operations
 * and bytes that it takes at least. */
#ifndef NPG_BENCH_KERNELS_H
#define NPG_BENCH_KERNELS_H

#include "tools/bench/bench_body.h"
#include "tools/bench/bench_meter.h"

typedef struct npg_bench_row {
    const char *name;
    double flops, bytes;  /* of one call, at least; flops 0: not counted */
    double vertex_frames; /* decoded by one call, 0: none                */
    bool on_host;         /* in this thread, not on the device           */
    npg_timing timing;
} npg_bench_row;

typedef npg_status npg_bench_take(void *user, const npg_bench_row *row);

/* Whether a name begins with one of the words of `only`, which commas part; "": always. */
bool npg_bench_wants(const char *only, const char *name);

/* Time all rows that `only` wants and hand them over one by one. */
npg_status npg_bench_kernels(npg_meter *meter, const npg_bench_body *body, const char *only,
                             npg_bench_take *take, void *user);

/* The same for what makes dense surfaces: of so many vertices, carried by samples
 * and decoded by the network. */
npg_status npg_bench_dense(npg_meter *meter, const char *only, size_t vertices, npg_bench_take *take,
                           void *user);

/* The share of the limit that binds the row: of the multiply-adds, or of the bytes, that the device does in
 * that time; *by_bytes says which. */
double npg_bench_share(const npg_bench_row *row, bool *by_bytes);

#endif
