/* Pose: what is done with a pose (graph.h) as such: taken on, moved as a whole, compared with another. */
#ifndef NPG_POSE_H
#define NPG_POSE_H

#include "align/graph.h"

/* x -> rotation x + translation. */
typedef struct npg_rigid {
    double rotation[3][3], translation[3];
} npg_rigid;

/* Coordinate `row` of R x + t. */
static inline double npg_rigid_at(const npg_rigid *m, const float x[3], int row)
{
    const double *r = m->rotation[row];
    return r[0] * (double)x[0] + r[1] * (double)x[1] + r[2] * (double)x[2] + m->translation[row];
}

/* Make the rows of a matrix that is nearly a rotation orthonormal again (Gram and Schmidt). */
void npg_pose_straighten(double rotation[9]);

/* next = the pose after `now`, if the motion since `before` goes on:
 * next_k = now_k before_k^-1 now_k.  K x 12 each. */
void npg_pose_extrapolate(double *next, const double *now, const double *before, size_t node_count);

/* moved = the pose (K x 12) as it is after the whole body has moved by `motion`:
 * R_k' = R R_k,  g_k + t_k' = R (g_k + t_k) + t. */
void npg_pose_move(double *moved, const npg_graph *graph, const double *pose, const npg_rigid *motion);

/* Where the pose has the nodes (K x 3): g_k + t_k. */
void npg_pose_places(float *places, const npg_graph *graph, const double *pose);

/* The motion that takes the nodes of one pose closest to those of another, least squares.  NPG_MEMORY. */
npg_status npg_pose_between(npg_rigid *motion, const npg_graph *graph, const double *from, const double *to);

/* bend = sqrt(mean_k |R g_k + t - (g_k + t_k)|^2), in units, of the rigid motion (R, t) that makes it least:
 * how far the pose is from moving the body as one piece.  NPG_MEMORY. */
npg_status npg_pose_bend(double *bend, const npg_graph *graph, const double *pose);

#endif
