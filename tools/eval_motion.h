/* Motion figures of a mesh sequence of constant topology, frame after frame in bounded
 * memory but for `bad`. */
#ifndef NPG_EVAL_MOTION_H
#define NPG_EVAL_MOTION_H

#include "pipeline/mesh.h"

typedef struct npg_eval_motion {
    double diagonal;
    size_t vert_count, face_count, edge_count, frames;
    uint32_t *faces; /* of the first frame, a loan of `first` */
    npg_mesh *first;
    uint32_t (*edges)[2];
    uint32_t *star_start, *star;            /* V + 1; the neighbours of each vertex */
    float *star_rest, *star_now;            /* of the largest star, x 3             */
    float *before[2];                       /* the last frame's positions, and those before; owned */
    float *areas;                           /* frames x F, owned                                   */
    size_t area_room;                       /* rows                                                */
    double jitter_sum, edge_sum, rigid_sum; /* sums of means per frame                        */
    bool vertices_last, topology_last;      /* the same count, the same faces, so far              */
} npg_eval_motion;

typedef struct npg_eval_motion_figures {
    double jitter; /* mean |p(t-1) - 2 p(t) + p(t+1)| in diagonals; NaN with fewer than 3 frames  */
    double edge;   /* mean |l(t) / l(0) - 1| over edges and frames; NaN without constant topology */
    double rigid;  /* how far a vertex and its neighbours are from having moved as one rigid piece since the
                      first frame (Kabsch alignment): root mean square of what is left, in their root mean
                      square distance; mean over vertices and frames; NaN without constant topology */
    double bad;    /* share of (face, frame) with area > 10 x or < 0.1 x the face's median        */
} npg_eval_motion_figures;

/* Takes the first frame too.  mesh is a loan. */
npg_status npg_eval_motion_add(npg_eval_motion *motion, npg_mesh *mesh);
npg_status npg_eval_motion_end(npg_eval_motion_figures *figures, npg_eval_motion *motion);
void npg_eval_motion_close(npg_eval_motion *motion);

#endif
