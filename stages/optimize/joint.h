/* Joint: the surface of a window's frames, moved by the points of all of them at once.
 *
 *     E = sum_t sum_p w_p ((1 - a) (n_p . (x(c_p) - p))^2 + a |x(c_p) - p|^2)          points
 *       + shape sum_t sum_(i,j) |x_i - x_j - (R_i + R_j) / 2 (r_i - r_j)|^2   shape
 *       + points per vertex  sum_v lambda_v sum_t |x_(t-1) - 2 x_t + x_(t+1)|^2           motion
 *
 * c_p: the closest point of the surface to the point p, n_p its normal there; w_p: Geman and McClure's weight,
 * whose width is a few times the frame's median distance; s: the capture's noise, that median, as a standard
 * deviation; r: the reference, l its mean edge; R: each vertex's rotation from it (as rigid as possible);
 * lambda: how even a vertex' motion is, found by cross-validation (time_smooth.h).  So the points count
 * against shape and motion by how good they are.
 *
 * One step of Gauss and Newton for each time the points are matched; conjugate gradients over all frames,
 * preconditioned by each vertex' own five diagonals in time.  Based on: Olga Sorkine, Marc Alexa,
 * As-Rigid-As-Possible Surface Modeling, 2007.  Not in the paper. */
#ifndef NPG_JOINT_H
#define NPG_JOINT_H

#include "pipeline/mesh.h"

typedef struct npg_joint_settings {
    int64_t points; /* most of a frame that pull                                */
    int64_t rounds; /* times the points are matched                             */
    int64_t steps;  /* of conjugate gradients, at most                          */
    double shape;   /* weight of an edge's change against a point's distance    */
    double along;   /* share of distances along the surface                     */
} npg_joint_settings;

/* A frame: where the surface is (W x 3, owned by the caller, moved), and its points (N x 3; normals may be
 * NULL).  A fixed one stays where it is and binds the others' motion. */
typedef struct npg_joint_frame {
    float *positions;
    const float *points, *normals;
    size_t point_count;
    bool is_fixed;
} npg_joint_frame;

/* What a solve did; lengths in units. */
typedef struct npg_joint_result {
    double noise;  /* s of the formula                                   */
    double lambda; /* median of lambda                                   */
    double moved;  /* mean way of a vertex                               */
    int64_t steps; /* of conjugate gradients, all rounds                 */
} npg_joint_result;

typedef struct npg_joint npg_joint;

/* surface: W vertices at rest, with faces; counted reference kept. */
npg_status npg_joint_open(npg_joint **joint, npg_mesh *surface, const npg_joint_settings *settings);
void npg_joint_close(npg_joint **joint);

/* Move the frames' surfaces, in order of time.  Equal input gives equal bits, however many threads. */
npg_status npg_joint_solve(npg_joint *joint, npg_joint_result *result, const npg_joint_frame *frames,
                           size_t frame_count);

/* Bytes that it takes at most. */
size_t npg_joint_memory(const npg_joint_settings *settings, size_t vert_count, size_t frames);

#endif
