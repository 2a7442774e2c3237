/* Loop fill: triangles that close a hole.
 *
 * Based on: Gill Barequet, Micha Sharir, Filling Gaps in the Boundary of a Polyhedron, 1995: of all
 * triangulations of the loop, the one of least area, by dynamic programming. */
#ifndef NPG_LOOP_FILL_H
#define NPG_LOOP_FILL_H

#include "pipeline/mesh.h"

#define NPG_LOOP_MOST 400 /* vertices of a loop, at most */

/* A loop of n vertices in the order the new faces should turn (against the faces around the hole). */
typedef struct npg_loop {
    const uint32_t *verts; /* n, all different */
    size_t count;
} npg_loop;

/* n - 2 faces (3 indices each) over the loop, least area with the vertices at vert_pos (V x 3).  edges: those
 * of the mesh, as npg_mesh_edges() gives them; none of them is made a second time.  *area is that of the new
 * faces.  *is_filled is false when the loop is too long or nothing fits.  NPG_MEMORY. */
npg_status npg_loop_fill(uint32_t *faces, double *area, bool *is_filled, npg_loop loop, const float *vert_pos,
                         const uint32_t (*edges)[2], size_t edge_count);

#endif
