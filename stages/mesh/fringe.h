/* Fringe: spikes and shreds along the border of a surface that was trimmed. */
#ifndef NPG_FRINGE_H
#define NPG_FRINGE_H

#include "pipeline/mesh.h"

/* Drop what hangs on the border and is narrower than about 2 `width`: a morphological opening.  What is
 * farther than `width` from every vertex of the border is the core; faces stay of which each vertex is
 * within 1.5 `width` of it.  Faces should be smaller than `width`.  A mesh without a border, or without a
 * core, stays as it is. *share: of the area, what went.  NPG_MEMORY. */
npg_status npg_mesh_drop_fringe(npg_mesh **mesh, double *share, double width);

#endif
