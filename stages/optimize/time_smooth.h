/* Time smooth: positions over time, each frame's own error taken out, as far as the motion itself allows.
 *
 *     sum_t share_t |x_t - y_t|^2 + lambda sum_t |x_(t-1) - 2 x_t + x_(t+1)|^2
 *
 * is least at x = S y (Whittaker's smoother; five diagonals).  How much is too much says the motion: a frame
 * left out must be predicted by the others.  The error of that prediction is (y_t - x_t) / (1 - S_tt), so no
 * fit is repeated (leave-one-out cross-validation).  Its sum over the frames and over a neighbourhood on the
 * surface chooses lambda for each vertex: still parts are smoothed far, fast ones hardly, clean captures
 * hardly at all.  Motion that is too fast for the frames can't be predicted with any lambda, so the points
 * have the last word: no lambda that moves the surface away from them by more than a fit to their noise had
 * brought it nearer.  A fit to few points follows each of them, and had brought it nearer by more.
 *
 * Based on: Paul Eilers, A perfect smoother, 2003. */
#ifndef NPG_TIME_SMOOTH_H
#define NPG_TIME_SMOOTH_H

#include <stdbool.h>

#include "pipeline/mesh.h"

#define NPG_TIME_SMOOTH_LEAST 5 /* frames; of fewer the motion is not known */

/* Frames of positions: T x W x 3, and what each frame's are worth. */
typedef struct npg_time_frames {
    size_t frame_count, vert_count; /* T, W */
    float *positions;               /* T x W x 3 */
    const float *shares;            /* T: 0 for a frame that says nothing, 1 for an ordinary one     */
    const bool *is_known;           /* T: already smooth, so left out of the judgement               */
    double points;                  /* of a frame that has some, in the mean                         */
} npg_time_frames;

/* What a frame's points say of a vertex' way d from where the frame has it: the mean square of their
 * distances is (d^T A d - 2 b^T d + c) / weight, A = sum w n n^T, b = sum w r n, c = sum w r^2, over the
 * points that are nearest to the faces around it; n: normal, r: signed distance. */
typedef struct npg_time_quadric {
    float a[6], b[3], c; /* A: xx, xy, xz, yy, yz, zz */
} npg_time_quadric;

void npg_time_quadric_add(npg_time_quadric *quadric, float weight, const float normal[3], float distance);

/* lambda (W) by cross-validation over neighbourhoods of the mesh's edges (E pairs of its W vertices); 0 where
 * there are fewer than NPG_TIME_SMOOTH_LEAST frames.  quadrics: T x W.  NPG_MEMORY. */
npg_status npg_time_smooth_choose(float *lambda, const npg_time_frames *frames,
                                  const npg_time_quadric *quadrics, const uint32_t (*edges)[2],
                                  size_t edge_count);

/* Replace the positions by smoothed ones. */
npg_status npg_time_smooth_apply(const npg_time_frames *frames, const float *lambda);

/* ---- five diagonals ---- */

/* A symmetric matrix of five diagonals of n rows: main[i], near[i] = (i, i + 1), far[i] = (i, i + 2).
 * Factored in place as L D L^T. */
typedef struct npg_band {
    size_t count;
    double *main, *near, *far;
} npg_band;

/* Add lambda D^T D, D the second differences. */
void npg_band_add_bend(npg_band *band, double lambda);
void npg_band_factor(npg_band *band);

/* x (every `stride`-th of n values) = the factored matrix's inverse times x. */
void npg_band_solve(const npg_band *band, double *x, size_t stride);

#endif
