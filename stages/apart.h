/* Apart: keep parts of a body that nearly touch from being joined by the reconstruction.
 *
 * Poisson closes a gap that is narrower than the points are apart, and a weld once made stretches into a web
 * in every frame where the parts move away from each other.  So points that face each other across a narrow
 * gap are first moved away from it, into their own part, until the gap is wide enough to survive; the surface
 * is made; then its vertices are moved back by what the points around them were moved.  The surface ends
 * where the points are, without the weld.
 *
 *     s_i = -n_i max(0, (1.5 h - g_i) / 2), smoothed over the neighbours on the same side
 *
 * g_i: distance to the nearest point that faces point i (contact.h), h: the points' spacing.  Not in the
 * paper. */
#ifndef NPG_APART_H
#define NPG_APART_H

#include "mesh.h"

/* shift (N x 3): how far each point goes; *moved counts those that go at all.  points, normals (outward): N
 * x 3. spacing as npg_cloud_spacing() gives it.  NPG_MEMORY. */
npg_status npg_cloud_apart(float *shift, size_t *moved, const float *points, const float *normals,
                           size_t point_count, double spacing);

/* Move the vertices of a mesh made from the shifted points (N x 3) back.  NPG_MEMORY. */
npg_status npg_mesh_move_back(npg_mesh *mesh, const float *shifted, const float *shift, size_t point_count);

#endif
