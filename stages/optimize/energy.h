#ifndef NPG_OPTIMIZE_ENERGY_H
#define NPG_OPTIMIZE_ENERGY_H

#include <stdbool.h>

#include "geometry/geometry.h"

/* Energy: what a window of aligned frames is moved by: the points of all of them at once.
 *
 *     E = sum_t share_t sum_p w_p (n_p . (x(c_p) - p))^2                         points
 *       + c sum_v sum_t lambda_v |x_(t-1) - 2 x_t + x_(t+1)|^2                   motion
 *       + sum_v sum_t tie_v share_t |x_t - y_t|^2                                poses
 *       + shape sum_t sum_(i,j) |(x_i - s_i) - (x_j - s_j)|^2                    shape
 *
 * y: the frames' own aligned poses, bridged over holes; s: those, smoothed in time; lambda_v: how even a vertex's
 * motion is, found by cross-validation (time_smooth.c).  c_p: the closest point of the surface to the point p, n_p its
 * normal there; w_p: Geman and McClure's weight, as wide as a few times the frame's median distance.
 *
 *     tie_v = e (least + trust / (1 + lambda_v median(lambda) / even^2))          c = e + tie_v
 *
 * e: the points per vertex.  Where frames agree with each other already (small lambda), their poses are
 * believed; where each is off by its own noise, or has few points, the points of all frames decide, and the
 * motion is even.  share_t: small where the frame's surface is far from its points, 0 without points: its
 * neighbours in time carry it, and are not drawn to points that are of something else.
 *
 * The points are matched once, where the surfaces are in the smoothed poses; then E is quadratic in the way
 * d = x - s from there: E = E(s) + d^T A d - 2 r^T d.  Not in the paper: tests/bed/decisions.md compares. */

typedef struct npg_energy_settings {
    int64_t points; /* most of a frame that pull                             */
    double shape;   /* weight of an edge's change against a point's distance */
} npg_energy_settings;

/* A frame: where the surface is (W x 3, owned by the caller, moved), and its points (N x 3; normals may be
 * NULL).  A known one was part of an earlier solve: its noise is gone, so it does not speak for how much
 * there is. */
typedef struct npg_energy_frame {
    float *positions;
    const float *points, *normals;
    size_t point_count;
    bool is_known;
    bool is_of_sensors; /* whose places are known: what has no points may be hidden, and is held already */
} npg_energy_frame;

typedef struct npg_energy npg_energy;

/* surface: W vertices at rest, with faces; counted reference kept. */
npg_status npg_energy_open(npg_energy **energy, npg_mesh *surface, const npg_energy_settings *settings);
void npg_energy_close(npg_energy **energy);

/* Median distance of points from the smoothed poses, as a standard deviation.  What the window before came to
 * is within what the next one first matches; a resumed run sets that of its state. */
double npg_energy_noise(const npg_energy *energy);
void npg_energy_set_noise(npg_energy *energy, double noise);

/* The energy of these frames (loans until the next call), in order of time; equal input (that noise, too)
 * gives equal bits, however many threads.  NPG_MEMORY. */
npg_status npg_energy_set(npg_energy *energy, const npg_energy_frame *frames, size_t frame_count);

/* Of the frames that were set: s (T x W x 3), median of lambda, and A and r. */
const float *npg_energy_smoothed(const npg_energy *energy);
double npg_energy_lambda(const npg_energy *energy);
double npg_energy_bridged(const npg_energy *energy); /* of npg_time_bridge() */
struct npg_energy_system *npg_energy_system_of(npg_energy *energy);

/* E(s). */
double npg_energy_at_start(const npg_energy *energy);

/* right (W x 3) = -gradient / 2 in frame t of poses and motion alone, a way d (T x W x 3) from s:
 *     share_t tie (y - s - d) - c lambda B (s + d), B = D^T D of second differences. */
void npg_energy_even(float *right, const npg_energy *energy, const float *d, size_t t);

/* Bytes that it takes at most. */
size_t npg_energy_memory(const npg_energy_settings *settings, size_t vert_count, size_t frames);

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

/* Holes: around a vertex with less than half of the points that it has there in the median frame a pose is little more
 * than a guess, and mostly one that clings to what is seen beside the hole.  There the frames before and after say where
 * it is: the positions become
 *
 *     x_t + (1 - min(1, 2 q_t)^2) (z_t - x_t)        q_t: its points, of as many as usual
 *
 * z: the curve of least second differences through the frames of q >= 1/2; a hole at either end of the frames stays as
 * it is, and so do fewer than NPG_TIME_SMOOTH_LEAST frames.  quadrics: T x W; *share: of all positions those that were
 * bridged.  NPG_MEMORY.  Not in the paper. */
npg_status npg_time_bridge(const npg_time_frames *frames, double *share, const npg_time_quadric *quadrics,
                           const uint32_t (*edges)[2], size_t edge_count);

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

/* System: A and r of the energy. */

/* A point that pulls: at the face's corners with these weights, normal there, and its strength. */
typedef struct npg_point_pull {
    uint32_t corner[3];
    float weight[3], normal[3], offset[3]; /* offset: target less the surface's point at the start */
    float strength;
} npg_point_pull;

typedef struct npg_energy_system {
    size_t frame_count, vert_count; /* T, W */
    npg_mesh_neighbours ring;       /* loan */
    float *lambda;                  /* W: bend of the motion, times points per vertex; loan */
    double shape;                   /* weight of an edge                            */
    npg_point_pull *pulls;          /* `most` per frame; loan */
    size_t *pull_counts;            /* T; loan */
    size_t most;
    float *ties;   /* W: weight of staying where a frame's own pose is; loan */
    float *shares; /* T: of the frames' ties; loan                     */
    float *right;  /* T x W x 3: r                                     */
} npg_energy_system;

/* diagonal (W, every `stride`-th of its floats) = that of A in frame t, but for the motion's part. */
void npg_energy_diagonal(float *diagonal, size_t stride, const npg_energy_system *system, size_t t);

/* The factored band of one vertex in time: the motion of vertex v, and on its main diagonal that of its T
 * frames (every `stride`-th of `diagonal`).  band: room for T rows. */
void npg_energy_band(npg_band *band, const npg_energy_system *system, size_t v, const float *diagonal,
                     size_t stride);

/* image_t = the rows of A d that belong to frame t; d and image: T x W x 3. */
void npg_energy_multiply(float *image, const npg_energy_system *system, const float *d, size_t t);

/* image_t += the part of the ties, or of the bend in time, times sign: sum_s B_ts lambda_v x_s, B = D^T D. */
void npg_energy_tie(float *image, const npg_energy_system *system, const float *x, size_t t, float sign);
void npg_energy_bend(float *image, const npg_energy_system *system, const float *x, size_t t, float sign);

/* Match: a frame's points and the places of the surface that they pull at. */

/* Searches one frame at a time. */
typedef struct npg_point_matcher {
    const npg_mesh *mesh; /* loan */
    size_t most;
    npg_surface *surface;
    float *targets, *target_normals, *vert_normals, *dists; /* M x 3, M x 3, W x 3, M */
    npg_surface_hit *hits;                                  /* M */
    npg_arena arrays;                                       /* holds these */
} npg_point_matcher;

npg_status npg_point_matcher_open(npg_point_matcher *matcher, const npg_mesh *mesh, size_t most);
void npg_point_matcher_close(npg_point_matcher *matcher);

/* Median distance of the frame's points from the surface: as the standard deviation that it is of in a normal
 * distribution. */
npg_status npg_point_matcher_measure(npg_point_matcher *matcher, double *spread,
                                     const npg_energy_frame *frame);

/* pulls (M) of the frame, *count of them; weights fall beyond `width`.  Points whose normal is opposite to
 * the surface's do not pull. */
npg_status npg_point_matcher_match(npg_point_matcher *matcher, npg_point_pull *pulls, size_t *count,
                                   const npg_energy_frame *frame, double width);

#endif
