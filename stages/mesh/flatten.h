/* Flatten: surface that no point saw, drawn tight between what was seen.
 *
 * Poisson closes what it does not know with a balloon: under the soles of feet, below a skirt.  The least
 * surface is the better guess: every unseen vertex goes to the mean of its neighbours,
 *
 *     x_v = sum_{w ~ v} x_w / |{w ~ v}|,
 *
 * while the seen ones stay, and pieces of the mesh without any.  Not in the paper. */
#ifndef NPG_FLATTEN_H
#define NPG_FLATTEN_H

#include "pipeline/mesh.h"

/* Move the vertices of the mesh that are farther than seen_dist from all N points (N x 3), in place; its
 * normals are left as they are.  *moved: how many did.  NPG_MEMORY. */
npg_status npg_mesh_flatten(npg_mesh *mesh, size_t *moved, const float *points, size_t point_count,
                            double seen_dist);

#endif
