/* Joint system: the joint fit's normal equations (joint.h) and their solution. */
#ifndef NPG_JOINT_SYSTEM_H
#define NPG_JOINT_SYSTEM_H

#include "optimize/joint.h"
#include "optimize/time_smooth.h"

/* A point that pulls: at the face's corners with these weights, normal there, and its strength. */
typedef struct npg_joint_pull {
    uint32_t corner[3];
    float weight[3], normal[3], offset[3]; /* offset: target less the surface's point at the start */
    float strength;
} npg_joint_pull;

/* Neighbours of each vertex by its edges. */
typedef struct npg_joint_ring {
    uint32_t *start, *neighbour; /* W + 1, 2 E */
} npg_joint_ring;

typedef struct npg_joint_system {
    size_t frame_count, vert_count; /* T, W */
    npg_joint_ring ring;            /* loan */
    const float *lambda;            /* W: bend of the motion, times points per vertex; loan */
    double shape;                   /* weight of an edge                            */
    const npg_joint_pull *pulls;    /* `most` per frame; loan */
    const size_t *pull_counts;      /* T; loan */
    size_t most;
    const float *ties;   /* W: weight of staying where a frame's own pose is; loan */
    const float *shares; /* T: of the frames' ties; loan                     */
    /* T x W x 3 */
    float *right, *step, *precond, *direction, *image; /* precond: main, near, far of the factors */
    float *diagonal;                                   /* T x W */
} npg_joint_system;

/* Arrays for T frames of W vertices, from an arena whose status is to be asked. */
void npg_joint_system_take(npg_joint_system *system, npg_arena *arena, size_t frame_count, size_t vert_count);
size_t npg_joint_system_memory(size_t frame_count, size_t vert_count);

/* Solve for `step` from `right`; both pieces of the left side are taken from the members.  Ends when the
 * residual's preconditioned norm has fallen to `tolerance`, or after `most` steps; *taken of them.  watch may
 * be NULL. */
npg_status npg_joint_system_solve(npg_joint_system *system, double tolerance, int64_t most, int64_t *taken,
                                  npg_joint_watch *watch, void *user);

/* image_t += the part of the bend in time: sum_s B_ts lambda_v x_s, B = D^T D. */
void npg_joint_bend(float *image, const npg_joint_system *system, const float *x, size_t t, float sign);

/* image -= the shape's part: shape * sum_j (d_v - d_j), d = now - kept (W x 3 each). */
void npg_joint_keep_shape(float *image, const npg_joint_system *system, const float *kept, const float *now);

/* Rings of a mesh's edges, from an arena. */
npg_status npg_joint_ring_take(npg_joint_ring *ring, npg_arena *arena, const uint32_t (*edges)[2],
                               size_t edge_count, size_t vert_count);

#endif
