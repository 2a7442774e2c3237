/* Formats: what each reader file offers to reader.c.  All read from where the source stands; they fill
 * frame->pos_local, normals and point_count alone, and leave half-read arrays to the caller on failure. */
#ifndef NPG_FORMATS_H
#define NPG_FORMATS_H

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

#endif
