/* Patch: the largest connected part of a surface whose vertices are marked. */
#ifndef NPG_PATCH_H
#define NPG_PATCH_H

#include "pipeline/mesh.h"

typedef struct npg_patch {
    double share;  /* of the surface's area; 0 where no vertex is marked      */
    float at[3];   /* mean of its vertices, weighted by area; NaN without any */
    double radius; /* from there to its farthest vertex; 0 without any        */
} npg_patch;

/* The largest by area; marked vertices belong together where an edge of the mesh joins them.  is_marked: V;
 * vert_pos: V x 3, the mesh in any pose; vert_areas: V, of that pose (npg_vertex_areas()); position, radius
 * and areas in its unit.  NPG_MEMORY. */
npg_status npg_patch_largest(npg_patch *patch, const uint8_t *is_marked, const float *vert_pos,
                             const double *vert_areas, const npg_mesh *mesh);

#endif
