/* Bench body: a mesh and its moving targets, made up, for timing. */
#ifndef NPG_BENCH_BODY_H
#define NPG_BENCH_BODY_H

#include "pipeline/mesh.h"

typedef struct npg_bench_body {
    npg_mesh *mesh; /* an ellipsoid with normals, open at its poles; owned */
    float **points; /* T clouds, N x 3 each; owned                         */
    size_t frame_count, point_count;
} npg_bench_body;

/* At least vert_count vertices; frames bend it; the points of each lie on the ellipsoid in that pose. */
npg_status npg_bench_body_open(npg_bench_body *body, size_t vert_count, size_t point_count,
                               size_t frame_count);
void npg_bench_body_close(npg_bench_body *body);

#endif
