/* Mesh builder: what a reader collects a mesh in. */
#ifndef NPG_MESH_BUILDER_H
#define NPG_MESH_BUILDER_H

#include "pipeline/frame_box.h"
#include "pipeline/mesh.h"

typedef struct npg_mesh_builder {
    npg_origin *origin; /* loan */
    bool may_be_points; /* faces are not asked for */
    bool has_normals, has_colours, has_uvs;
    size_t vert_count, face_count;
    size_t pos_capacity, normal_capacity, colour_capacity, uv_capacity, face_capacity;
    float *vert_pos, *vert_normals, *vert_uvs; /* owned */
    uint8_t *vert_colours;                     /* owned */
    float *corner_uvs;                         /* F x 3 x 2 or NULL, owned */
    uint32_t *faces;                           /* owned */
} npg_mesh_builder;

/* Room for that many more vertices and triangles.  NPG_MEMORY. */
npg_status npg_builder_reserve(npg_mesh_builder *builder, size_t vertices, size_t triangles);

/* The next vertex, world coordinates, all else 0; room must have been reserved.  Returns its number. */
size_t npg_builder_vertex(npg_mesh_builder *builder, const double world[3]);

/* A polygon as a fan around its first corner; takes room itself.  NPG_MEMORY. */
npg_status npg_builder_polygon(npg_mesh_builder *builder, const uint32_t *corners, size_t corner_count);

/* The mesh, which then owns the builder's arrays.  NPG_BAD_INPUT (beginning with `name`) without faces
 * (unless may_be_points) or when a face uses a vertex that is not there. */
npg_status npg_builder_finish(npg_mesh **mesh, npg_mesh_builder *builder, const char *name);
void npg_builder_clear(npg_mesh_builder *builder);

#endif
