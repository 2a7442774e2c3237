/* Flatten: surface that no point saw, drawn tight between what was seen.
 *
 * Poisson closes what it does not know with a balloon: under the soles of feet, below a skirt.  The least
 * surface is the better guess: every unseen vertex goes to the mean of its neighbours,
 *
 *     x_v = sum_{w ~ v} x_w / |{w ~ v}|,
 *
 * while the seen ones stay, and pieces of the mesh without any.  What then lies in space that sensors saw to
 * be empty is pushed inward between the sweeps, out of it.  Not in the paper. */
#ifndef NPG_FLATTEN_H
#define NPG_FLATTEN_H

#include "geometry/cube_set.h"
#include "pipeline/mesh.h"

typedef struct npg_flattened {
    size_t moved;  /* vertices */
    size_t pushed; /* those of them that were in empty space */
} npg_flattened;

/* Move the vertices of the mesh that are farther than seen_dist from all N points (N x 3), in place; its
 * normals are left as they are.  empty (or NULL): space that sensors saw to be empty.  NPG_MEMORY. */
npg_status npg_mesh_flatten(npg_mesh *mesh, npg_flattened *done, const float *points, size_t point_count,
                            double seen_dist, const npg_cube_set *empty);

/* Share of the area, by the middles of faces, that lies in the cubes and not at their border. */
double npg_mesh_share_in(const npg_mesh *mesh, const npg_cube_set *cubes);

#endif
