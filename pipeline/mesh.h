/* Mesh: vertices and triangles as plain arrays, shared by counted references and never
 * changed once shared. */
#ifndef NPG_MESH_H
#define NPG_MESH_H

#include <stdbool.h>

#include "pipeline/memory.h"

typedef struct npg_mesh {
    size_t vert_count, face_count; /* V, F                                                               */
    float *vert_pos;               /* V x 3, owned; the unit is its user's (local or unit, see the name) */
    float *vert_normals;           /* V x 3, owned, unit length, or NULL                                 */
    uint32_t *faces;               /* F x 3, owned; counter-clockwise seen from outside                  */
    uint8_t *vert_colours;         /* V x 4 RGBA, owned, or NULL                                         */
    uint8_t *vert_unseen; /* V, owned, or NULL; 1: no point that the mesh was made or judged from is near */
    float *vert_uvs;      /* V x 2, owned, or NULL                                              */
    float *corner_uvs;    /* F x 3 x 2, owned, or NULL: where vertices have more than one uv    */
    int references;       /* for npg_mesh_ref / unref alone                                     */
} npg_mesh;

/* A mesh with zeroed vertices and faces and one reference. */
npg_status npg_mesh_open(npg_mesh **mesh, size_t vert_count, size_t face_count);
npg_mesh *npg_mesh_ref(npg_mesh *mesh);
void npg_mesh_unref(npg_mesh **mesh);

/* A copy with its own arrays and one reference. */
npg_status npg_mesh_copy(npg_mesh **out, const npg_mesh *mesh);

#endif
