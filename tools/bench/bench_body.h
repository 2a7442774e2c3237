/* Bench body: a mesh and its moving targets, made up, for timing. */
#ifndef NPG_BENCH_BODY_H
#define NPG_BENCH_BODY_H

#include "optimize/fit.h"

typedef struct npg_bench_body {
    npg_mesh *mesh;        /* a closed ellipsoid with normals, owned */
    npg_fit_frame *frames; /* T of them, with points; owned          */
    size_t frame_count, point_count;
} npg_bench_body;

/* At least vert_count vertices; frames bend and turn it; the points of each are its vertices in that pose. */
npg_status npg_bench_body_open(npg_bench_body *body, size_t vert_count, size_t point_count,
                               size_t frame_count);
void npg_bench_body_close(npg_bench_body *body);

#endif
