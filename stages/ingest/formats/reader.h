/* Readers: clouds and meshes from files and streams.  One .c file per format; this is their common face.
 *
 * Formats by the name's ending, then by content: .ply, .obj, .xyz/.txt/.xyzn/.pts, .npy, .pcd.
 * Positions come out as float relative to an origin (npg_origin) that the first file read settles: its first
 * finite point, or the median of its points where that one lies far off, so that captures far from 0 keep
 * their detail.  Points that are not finite are kept: the outlier stage counts and drops them.  Normals come
 * out with unit length; one without a direction is (0, 0, 0).
 * Failures are NPG_BAD_INPUT (with path, line or byte, and cause), NPG_MEMORY.  Memory while reading a cloud
 * stays below 4 x file size + 1 MiB, whatever the header claims (a compressed PCD: of what it unpacks to).  Threads:
 * different frames may be read at the same time; *origin is written only while it is not known. */
#ifndef NPG_READER_H
#define NPG_READER_H

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/mesh.h"

/* Read a cloud into frame->pos_local, normals (where the file has them), point_count,
 * cleaning.read, path and fields; the frame is empty before, and after a failure.
 * A file without points is NPG_OK with point_count 0. */
npg_status npg_read_cloud(npg_frame *frame, const char *path, npg_origin *origin);

/* Read a triangle mesh from PLY or OBJ; polygons are split into fans, normals, colours and UVs per vertex are
 * kept where given.  vert_pos is local.  Indices are checked; a mesh without faces is NPG_BAD_INPUT. */
npg_status npg_read_mesh(npg_mesh **mesh, const char *path, npg_origin *origin);

/* The points of a file, whatever else it holds, as a mesh without faces (maybe without points); normals where
 * the file has them.  Errors are those of npg_read_cloud. */
npg_status npg_read_points(npg_mesh **mesh, const char *path, npg_origin *origin);

/* The same for any of the formats, faces or not: points alone become a mesh with face_count 0.  NPG_BAD_INPUT
 * where there is not even a point. */
npg_status npg_read_shape(npg_mesh **mesh, const char *path, npg_origin *origin);

/* Frames concatenated on a stream (a pipe will do): PLY or NPY files one after the other.  NPG_END at a clean
 * end between two frames; a stream that stops inside a frame is NPG_BAD_INPUT. */
typedef struct npg_stream npg_stream;
npg_status npg_stream_open(npg_stream **stream, int fd, const char *name);
npg_status npg_stream_next(npg_stream *stream, npg_frame *frame, npg_origin *origin);
void npg_stream_close(npg_stream **stream);

/* stopping(user) is asked about four times a second while nothing comes;
 * true makes next return NPG_STOPPED. */
void npg_stream_set_stop(npg_stream *stream, bool (*stopping)(void *user), void *user);

/* The format that npg_read_cloud would use for a path ("ply", "obj", "xyz", "npy", "pcd"), NULL for none. */
const char *npg_reader_for(const char *path);

#endif
