/* Denoise: how noisy a cloud is, and a smoother version of an oriented one.  N x 3 arrays; NPG_MEMORY. */
#ifndef NPG_DENOISE_H
#define NPG_DENOISE_H

#include "pipeline/status.h"

/* Standard deviation of the points across their surface.  Residuals to planes through 8 and through 24
 * neighbours are noise plus curvature, and only curvature grows with the neighbourhood (with its area): the
 * difference tells them apart.  normals (outward) or NULL: with them, points of thin parts, which have another
 * side among those neighbours, are not asked, unless nine in ten are; how far that side is is no noise. */
npg_status npg_cloud_noise(double *sigma, const float *points, const float *normals, size_t point_count);

/* Move every point onto the quadric z = a + bx + cy + dx^2 + exy + fy^2 fitted over its tangent plane to its
 * `neighbours` nearest points of the same side, weighted by distance; normals follow.  In place.  Points
 * without enough neighbours of their side stay.  Based on: F. Cazals, M. Pouget, Estimating Differential
 * Quantities Using Polynomial Fitting of Osculating Jets, 2005. */
npg_status npg_cloud_smooth(float *points, float *normals, size_t point_count, int neighbours);

#endif
