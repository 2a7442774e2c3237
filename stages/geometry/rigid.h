/* Rigid: the rotation and translation that take one set of points closest to another. */
#ifndef NPG_RIGID_H
#define NPG_RIGID_H

#include <stddef.h>

/* rotation (3 x 3, rows) and translation that make sum_i |R from_i + t - to_i|^2 least (N x 3 each); R is a
 * rotation also where a mirror would fit better.  Where the points leave it open (fewer than three, on one
 * line) it is one of the best.
 *
 * Based on: Berthold Horn, Closed-form solution of absolute orientation using unit quaternions, 1987:
 * the quaternion is the eigenvector of the largest eigenvalue of a symmetric 4 x 4 matrix
 * of the points' products. */
void npg_rigid_fit(double rotation[3][3], double translation[3], const float *from, const float *to,
                   size_t count);

#endif
