/* Formats, inside: what each reader file offers to reader.c, and what they read into.
 *
 * All read from where the source stands; they fill frame->pos_local, normals, colours and point_count alone, and leave
 * half-read arrays to the caller on failure. */
#ifndef NPG_FORMATS_INTERNAL_H
#define NPG_FORMATS_INTERNAL_H

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/mesh.h"
#include "pipeline/source.h"

/* One PLY with all its elements.  NPG_END when the source has no byte left; what follows the last element is
 * left there.  may_be_points: a mesh may be without faces. */
npg_status npg_ply_read_cloud(npg_frame *frame, npg_source *source, npg_origin *origin);
npg_status npg_ply_read_mesh(npg_mesh **mesh, npg_source *source, npg_origin *origin, bool may_be_points);

npg_status npg_obj_read_cloud(npg_frame *frame, npg_source *source, npg_origin *origin);
npg_status npg_obj_read_mesh(npg_mesh **mesh, npg_source *source, npg_origin *origin, bool may_be_points);

/* wants_normals: columns 4 to 6 are normals whatever their length (.xyzn). */
npg_status npg_xyz_read_cloud(npg_frame *frame, npg_source *source, npg_origin *origin, bool wants_normals);

/* One NPY array; NPG_END and the rest as for PLY. */
npg_status npg_npy_read_cloud(npg_frame *frame, npg_source *source, npg_origin *origin);

npg_status npg_pcd_read_cloud(npg_frame *frame, npg_source *source, npg_origin *origin);

/* The format a name's ending stands for ("ply", "xyz", ...), NULL for none; the file is not read. */
const char *npg_format_by_ending(const char *path);

/* ---- what the elements of a PLY file are made of ---- */

enum { NPG_PLY_ELEMENTS = 16, NPG_PLY_PROPERTIES = 128, NPG_PLY_NAME = 64 };

typedef enum npg_ply_format { NPG_PLY_ASCII, NPG_PLY_LITTLE, NPG_PLY_BIG } npg_ply_format;

typedef enum npg_ply_type {
    NPG_PLY_INT8,
    NPG_PLY_UINT8,
    NPG_PLY_INT16,
    NPG_PLY_UINT16,
    NPG_PLY_INT32,
    NPG_PLY_UINT32,
    NPG_PLY_FLOAT,
    NPG_PLY_DOUBLE
} npg_ply_type;

typedef struct npg_ply_property {
    char name[NPG_PLY_NAME];
    npg_ply_type type; /* of the value, or of a list's items */
    bool is_list;
    npg_ply_type count_type; /* lists only                                        */
    size_t offset;           /* in the row; meaningful where no list is before it */
} npg_ply_property;

typedef struct npg_ply_element {
    char name[NPG_PLY_NAME];
    uint64_t count;
    bool has_lists;
    size_t row_size; /* bytes of a binary row, lists counted as their bare length */
    size_t property_count;
    npg_ply_property properties[NPG_PLY_PROPERTIES];
} npg_ply_element;

typedef struct npg_ply_header {
    npg_ply_format format;
    size_t element_count;
    npg_ply_element elements[NPG_PLY_ELEMENTS];
} npg_ply_header;

/* Read and check the header; the source then stands at the body.  Counts are compared with the bytes that
 * follow where these are known.  NPG_END when the source is at its end before the first byte. */
npg_status npg_ply_header_read(npg_ply_header *header, npg_source *source);

size_t npg_ply_type_size(npg_ply_type type);

/* A value of a binary row. */
double npg_ply_value(const unsigned char *bytes, npg_ply_type type, npg_ply_format format);

/* ---- point list: rows that go straight into a frame's arrays ---- */

typedef struct npg_point_list {
    npg_frame *frame;   /* loan; its arrays grow */
    npg_origin *origin; /* loan */
    size_t pos_capacity, normal_capacity, colour_capacity;
    bool has_normals, has_colours;
} npg_point_list;

/* Room for `more` further points beyond those that are there.  NPG_MEMORY. */
npg_status npg_points_reserve(npg_point_list *list, size_t more);

/* Add one point, world coordinates; normal (any length) is used when has_normals.  A normal without a
 * direction (zero or not finite) becomes (0, 0, 0).  Room must have been reserved. */
void npg_points_add(npg_point_list *list, const double world[3], const double normal[3]);

/* The colour of the point that npg_points_add() added last; with has_colours every point has one. */
static inline void npg_points_colour(npg_point_list *list, const uint8_t rgba[4])
{
    uint8_t *to = list->frame->colours + 4 * (list->frame->point_count - 1);
    for (int c = 0; c < 4; c++) to[c] = rgba[c];
}

/* world -> local, one point; the first finite one becomes the origin. */
void npg_local_of(float local[3], npg_origin *origin, const double world[3]);

/* Move the origin to the median of the points when it lies so far from them that float can't tell them apart
 * well; true when it moved (the points must then be read again). */
bool npg_origin_improve(npg_origin *origin, const float *pos_local, size_t point_count);

/* Unit length, (0, 0, 0) where there is no direction. */
void npg_unit_normal(float out[3], const double normal[3]);

/* ---- mesh builder: what a reader collects a mesh in ---- */

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
