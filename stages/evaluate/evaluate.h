/* Door of the evaluate room: the meshes of a run against a ground truth, in bounded memory but for `bad`. */
#ifndef NPG_EVALUATE_H
#define NPG_EVALUATE_H

#include "geometry/geometry.h"

typedef struct npg_sequence npg_sequence;

typedef struct npg_sequence_figures {
    npg_frame_metrics mean;
    size_t frames;
    double
        diagonal;  /* of the first truth's box                                                             */
    double corr;   /* correspondence error, in diagonals; NaN without constant topology on both sides      */
    double jitter; /* mean |p(t-1) - 2 p(t) + p(t+1)| in diagonals; NaN with fewer than 3 frames           */
    double edge;   /* mean |l(t) / l(0) - 1| over edges and frames; NaN without constant topology          */
    double rigid;  /* how far a vertex and its neighbours are from having moved as one rigid piece since the
                        first frame (Kabsch alignment): root mean square of what is left, in their root mean
                        square distance; mean over vertices and frames; NaN without constant topology */
    double bad;    /* share of (face, frame) with area > 10 x or < 0.1 x the face's median                 */
    bool topology_last; /* of the predicted meshes */
} npg_sequence_figures;

/* settings: all but the diagonal.  points_only: the truth is clouds, and nothing is tied to it. */
npg_status npg_sequence_open(npg_sequence **sequence, const npg_metrics_settings *settings, bool points_only);
void npg_sequence_close(npg_sequence **sequence);

/* The next frame, the first one too, and its own figures; *corr is NaN where there is none.  The meshes are
 * loans, and finite.  NPG_BAD_INPUT, NPG_MEMORY. */
npg_status npg_sequence_add(npg_sequence *sequence, npg_frame_metrics *figures, double *corr,
                            npg_mesh *predicted, npg_mesh *truth);

/* Of all frames so far, one at least. */
npg_status npg_sequence_figures_of(npg_sequence_figures *figures, const npg_sequence *sequence);

#endif
