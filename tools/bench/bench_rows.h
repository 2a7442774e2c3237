/* Bench rows: every kernel, and the placing of a dense surface, timed beside the peaks of the device. */
#ifndef NPG_BENCH_ROWS_H
#define NPG_BENCH_ROWS_H

#include "tools/bench/bench_body.h"
#include "tools/bench/bench_meter.h"

typedef struct npg_bench_row {
    npg_work work; /* a loan until the visit returns */
    npg_timing timing;
} npg_bench_row;

typedef npg_status npg_bench_visit(void *user, const npg_bench_row *row);

/* Whether a name begins with one of the words of `only`, separated by commas; "": always. */
bool npg_bench_wants(const char *only, const char *name);

/* Time all rows that `only` wants and hand them over one by one. */
npg_status npg_bench_kernels(npg_meter *meter, const npg_bench_body *body, const char *only,
                             npg_bench_visit *visit, void *user);

/* The same for what makes dense surfaces: so many vertices posed by the graph, carried
 * by samples and decoded by the network. */
npg_status npg_bench_dense(npg_meter *meter, const char *only, size_t vertices, npg_bench_visit *visit,
                           void *user);

/* The same for what is done to dense clouds on the host: isolated points, normals, closest points of a
 * surface, and Poisson (of 20 000 points at most). */
npg_status npg_bench_clouds(npg_meter *meter, const char *only, size_t points, npg_bench_visit *visit,
                            void *user);

/* The same for one frame of the usual size: aligned from its neighbour's pose, and its mesh written into a
 * file in the folder for temporary files.  NPG_DISK, too. */
npg_status npg_bench_frame(npg_meter *meter, const char *only, npg_bench_visit *visit, void *user);

/* The share of the limit that binds the row: of the multiply-adds, or of the bytes, that the device does in
 * that time; *by_bytes says which. */
double npg_bench_share(const npg_bench_row *row, bool *by_bytes);

#endif
