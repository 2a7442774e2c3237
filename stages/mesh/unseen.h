/* Unseen: which vertices of the finished reference no point supports that it was made from. */
#ifndef NPG_UNSEEN_H
#define NPG_UNSEEN_H

#include <jansson.h>

#include "geometry/patch.h"
#include "pipeline/frame_box.h"

/* Set mesh->vert_unseen: the vertices that are farther than dist_max from all N points (N x 3).  NPG_MEMORY. */
npg_status npg_mesh_mark_unseen(npg_mesh *mesh, const float *points, size_t point_count, double dist_max);

/* Take the mark from vertices that none of the sensors (S x 3, in the mesh's coordinates) can see past the mesh
 * itself, which has its normals.  offset: surface nearer than that hides nothing.  NPG_MEMORY. */
npg_status npg_unseen_excuse(npg_mesh *mesh, const float *sensors, size_t sensor_count, double offset);

/* *share: of the mesh's area that is marked; *largest: its largest connected part.  NPG_MEMORY. */
npg_status npg_unseen_measure(double *share, npg_patch *largest, const npg_mesh *mesh);

/* Where that part lies, for the report: {share, at, radius} in world units, and in words into text; JSON null
 * and "" where it has no area. */
json_t *npg_unseen_place(const npg_patch *largest, const npg_frame_box *box, char *text, size_t size);

#endif
