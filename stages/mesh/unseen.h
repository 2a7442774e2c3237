/* Unseen: which vertices of the finished reference no point supports that it was made from. */
#ifndef NPG_UNSEEN_H
#define NPG_UNSEEN_H

#include "geometry/patch.h"

/* Set mesh->vert_unseen: the vertices that are farther than dist_max from all N points (N x 3).
 * *largest: the largest connected part of them.  NPG_MEMORY. */
npg_status npg_mesh_mark_unseen(npg_mesh *mesh, npg_patch *largest, const float *points, size_t point_count,
                                double dist_max);

#endif
