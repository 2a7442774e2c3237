/* Joint: the surface of a window's frames, moved by the points of all of them at once.
 *
 *     E = sum_t sum_p w_p (n_p . (x(c_p) - p))^2                                 points
 *       + c sum_v sum_t lambda_v |x_(t-1) - 2 x_t + x_(t+1)|^2                   motion
 *       + sum_v sum_t tie_v share_t |x_t - y_t|^2                                poses
 *       + shape sum_t sum_(i,j) |(x_i - s_i) - (x_j - s_j)|^2                    shape
 *
 * y: the frames' own aligned poses; s: those, smoothed in time; lambda_v: how even a vertex's motion is,
 * found by cross-validation (time_smooth.h).  c_p: the closest point of the surface to the point p, n_p its
 * normal there; w_p: Geman and McClure's weight, as wide as a few times the frame's median distance.
 *
 *     tie_v = e (least + trust / (1 + lambda_v median(lambda) / even^2))          c = e + tie_v
 *
 * e: the points per vertex.  Where frames agree with each other already (small lambda), their poses are
 * believed; where each is off by its own noise, or has few points, the points of all frames decide, and the
 * motion is even.  share_t: small where the frame's pose is far from its points, 0 without points: its
 * neighbours in time carry it.
 *
 * The points are matched once, where the surfaces are in the smoothed poses; then E is quadratic.  Conjugate
 * gradients over all frames, preconditioned by each vertex's own five diagonals in time.  Not in the paper:
 * tests/bed/decisions.md compares. */
#ifndef NPG_JOINT_H
#define NPG_JOINT_H

#include "pipeline/mesh.h"

typedef struct npg_joint_settings {
    int64_t points; /* most of a frame that pull                                           */
    int64_t steps;  /* of conjugate gradients, at most; 0: the frames are left as they are */
    double shape;   /* weight of an edge's change against a point's distance               */
} npg_joint_settings;

/* A frame: where the surface is (W x 3, owned by the caller, moved), and its points (N x 3; normals may be
 * NULL).  A known one was part of an earlier solve: its noise is gone, so it does not speak for how much
 * there is. */
typedef struct npg_joint_frame {
    float *positions;
    const float *points, *normals;
    size_t point_count;
    bool is_known;
} npg_joint_frame;

/* What a solve did; lengths in units. */
typedef struct npg_joint_result {
    double noise;  /* median distance of points from the smoothed poses, as a standard deviation */
    double lambda; /* median of lambda                                   */
    double moved;  /* mean way of a vertex                               */
    int64_t steps; /* of conjugate gradients                             */
} npg_joint_result;

typedef struct npg_joint npg_joint;

/* surface: W vertices at rest, with faces; counted reference kept. */
npg_status npg_joint_open(npg_joint **joint, npg_mesh *surface, const npg_joint_settings *settings);
void npg_joint_close(npg_joint **joint);

/* Asked after each step of conjugate gradients: how many there were, how many there will be at most, and what
 * is left of the first residual (1 .. 0).  Anything but NPG_OK ends the solve with that status. */
typedef npg_status npg_joint_watch(void *user, int64_t step, int64_t most, double residual);

/* The noise that the window before came to (npg_joint_result): the next one first matches within it.  A solve
 * sets it; a resumed run starts with that of its state. */
void npg_joint_set_noise(npg_joint *joint, double noise);

/* Move the frames' surfaces, in order of time; those are left alone where it fails or there are no steps.
 * Equal input (that noise, too) gives equal bits, however many threads.  watch may be NULL.  NPG_MEMORY,
 * NPG_DIVERGED, the watch's. */
npg_status npg_joint_solve(npg_joint *joint, npg_joint_result *result, const npg_joint_frame *frames,
                           size_t frame_count, npg_joint_watch *watch, void *user);

/* Bytes that it takes at most. */
size_t npg_joint_memory(const npg_joint_settings *settings, size_t vert_count, size_t frames);

#endif
