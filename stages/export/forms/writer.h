/* Writers: meshes into files that appear only when they are whole (file.h).  One .c file per format. */
#ifndef NPG_WRITER_H
#define NPG_WRITER_H

#include "pipeline/mesh.h"

/* What to write: V world positions with the rest of a mesh (its own vert_pos is not used).
 * normals may be NULL. */
typedef struct npg_mesh_view {
    size_t vert_count, face_count;
    const double *vert_world;    /* V x 3 */
    const float *vert_normals;   /* V x 3 or NULL */
    const uint32_t *faces;       /* F x 3; face_count 0 writes a cloud */
    const uint8_t *vert_colours; /* V x 4 or NULL */
    const float *vert_uvs;       /* V x 2 or NULL */
    bool turns_faces;            /* for npg_write_obj_like(): the faces of `like` are turned over */
} npg_mesh_view;

/* By the name's ending, .ply (binary little-endian) or .obj.  PLY positions are float when float keeps 1e-6
 * of the extent, else double.  NPG_DISK with path and cause; NPG_USAGE for another ending. */
npg_status npg_write_mesh(const char *path, const npg_mesh_view *mesh);
npg_status npg_write_ply(const char *path, const npg_mesh_view *mesh);
npg_status npg_write_obj(const char *path, const npg_mesh_view *mesh);

/* An OBJ that is the OBJ file `like` with other positions and normals (one per vertex; without, none): all
 * its other lines stay, so texture coordinates per corner, groups, polygons and materials are kept.  Of mesh
 * only vert_count, vert_world and vert_normals are used.  NPG_BAD_INPUT when `like` has another number of
 * vertices, NPG_DISK. */
npg_status npg_write_obj_like(const char *path, const char *like, const npg_mesh_view *mesh);

#endif
