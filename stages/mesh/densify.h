/* Densify: points between those of thin parts.
 *
 * A shin of a dozen points, an ear or a feather has the points of its other side as near as those of its own.
 * The octree of the reconstruction is as fine as the points are dense, so there both sides share its cells
 * and the part is lost.  The normals say more than the points alone do: halfway along the curved edge that
 * two neighbours on one side span lies another point of the surface,
 *
 *     m = (p_i + p_j) / 2 + ((d . n_j) n_j - (d . n_i) n_i) / 8,    d = p_j - p_i,
 *
 * with the normal n_i + n_j.  Points that have one of another side nearby get such points to their nearest
 * neighbours.  The normals must be measured ones: such as are estimated from points mix both sides.  Based
 * on: A. Vlachos et al., Curved PN Triangles, 2001 (the edge).  Not in the paper. */
#ifndef NPG_DENSIFY_H
#define NPG_DENSIFY_H

#include "pipeline/status.h"

/* points and normals (outward, unit): N x 3 each.  dense_points and dense_normals (*dense_count x 3 each, owned
 * by the caller): the given ones first, those that are added behind.  spacing: of the points, as
 * npg_cloud_spacing() gives it.  Equal input gives equal bits.  NPG_MEMORY: both are then NULL. */
npg_status npg_cloud_densify(float **dense_points, float **dense_normals, size_t *dense_count,
                             const float *points, const float *normals, size_t count, double spacing);

#endif
