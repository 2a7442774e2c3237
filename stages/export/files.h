/* Files of meshes, their names and folder, and the capture's coordinates to those of the written files. */
#ifndef NPG_EXPORT_FILES_H
#define NPG_EXPORT_FILES_H

#include "pipeline/frame_box.h"
#include "pipeline/mesh.h"

/* ---- a mesh into a file that appears only when it is whole (pipeline/file.h) ---- */

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

/* An OBJ that is the OBJ file `like` with other positions and normals (one per vertex; without, none): all
 * its other lines stay, so texture coordinates per corner, groups, polygons and materials are kept.  Of mesh
 * only vert_count, vert_world and vert_normals are used.  NPG_BAD_INPUT when `like` has another number of
 * vertices, NPG_DISK. */
npg_status npg_write_obj_like(const char *path, const char *like, const npg_mesh_view *mesh);

/* ---- the capture's coordinates to those of the written files ---- */

/* written[a] = scale * sign[a] * (world - centre)[from[a]] */
typedef struct npg_placement {
    int from[3];
    double sign[3], scale, centre[3];
    bool is_mirror; /* turns a surface inside out, so faces are wound the other way */
} npg_placement;

/* axes: which axis becomes x, y and z, with signs ("xz-y"); scale 1, centre 0.  NPG_USAGE. */
npg_status npg_placement_parse(npg_placement *placement, const char *axes);

/* One point in world coordinates to written ones; out may be the input. */
void npg_place_point(const npg_placement *placement, double out[3], const double world[3]);

/* Unit coordinates (N x 3) to written ones. */
void npg_place_points(const npg_placement *placement, double *out, const npg_frame_box *box,
                      const float *unit, size_t count);

/* Directions, N x 3; out may be the input. */
void npg_place_normals(const npg_placement *placement, float *out, const float *normals, size_t count);

/* F x 3, wound so that the surface still looks outward. */
void npg_place_faces(const npg_placement *placement, uint32_t *out, const uint32_t *faces, size_t face_count);

/* F x 3 x 2 values of the corners, in the order of those faces. */
void npg_place_corners(const npg_placement *placement, float *out, const float *corners, size_t face_count);

/* The largest coordinate that the box of the capture has as written, at most. */
double npg_place_largest(const npg_placement *placement, const npg_frame_box *box);

/* ---- names and folder of the results ---- */

typedef struct npg_mesh_names { /* how the mesh files of a run are called */
    const char *prefix, *ending;
    int width; /* digits of the number at least */
} npg_mesh_names;

enum { NPG_MESH_NAME_SIZE = 256 };

/* "<prefix>_<number>.<ending>". */
void npg_mesh_name(char name[NPG_MESH_NAME_SIZE], const npg_mesh_names *names, int64_t number);

/* The number in such a name (four digits at least, whatever the prefix) of one of the endings ".ply .obj ", or in that of
 * an unfinished file (pipeline/file.h). */
bool npg_mesh_name_read(const char *name, const char *endings, int64_t *number);

/* Digits that the largest number needs, 4 at least. */
int npg_number_width(int64_t number_max);

/* Make OUT and see that bytes can be written into it, by writing and removing some.  NPG_DISK. */
npg_status npg_folder_probe(const char *output);

/* Remove what an earlier run left: done.json first, so that what remains can't pass for a whole result, then
 * its other files and the mesh files (<word>_<digits>.ply or .obj).  Files that no run makes stay. */
npg_status npg_folder_clear(const char *output);

#endif
