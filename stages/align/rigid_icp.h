/* Rigid ICP: how a body stands in one frame against another, as far as it moved as a whole.
 *
 * Motion recurs, but seldom in place: who walks comes back to a pose lengths away, who turns comes back to it
 * facing elsewhere.  So two frames are compared, and one is started from the pose of the other, after the
 * rigid motion that brings their points together.
 *
 * Based on: Besl and McKay, A method for registration of 3-D shapes, 1992 (iterated closest points), and
 * Chetverikov et al., The trimmed iterative closest point algorithm, 2002: the pairs that lie farthest apart,
 * of limbs that moved on their own, are left out. */
#ifndef NPG_RIGID_ICP_H
#define NPG_RIGID_ICP_H

#include "align/pose.h"
#include "geometry/kdtree.h"

#define NPG_LOOK_POINTS 500 /* of a frame, at most */

/* A few points of a frame. */
typedef struct npg_look {
    float *points; /* N x 3; owned */
    size_t count;  /* N            */
    npg_kdtree *tree;
} npg_look;

/* Spread over the points that are given, one at least.  NPG_MEMORY: what was got is to be closed. */
npg_status npg_look_open(npg_look *look, const float *points, size_t point_count);
void npg_look_close(npg_look *look);

/* motion: takes `from` onto `to`, found from where their middles meet and from `guess`; *unlike: what is left
 * between them then, the mean of squared distances, both ways.  NPG_MEMORY. */
npg_status npg_rigid_icp(npg_rigid *motion, double *unlike, const npg_look *from, const npg_look *to,
                         const npg_rigid *guess);

#endif
