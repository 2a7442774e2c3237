/* Mesh clean: from a raw reconstruction to a reference mesh one can deform: trimmed, in one piece, decimated,
 * manifold, without flipped, degenerate or duplicate faces.
 *
 * All functions replace *mesh by a new one (its normals are dropped, they would be stale) or leave it as it
 * was on failure.  Nothing here is random and nothing depends on the number of threads.  NPG_MEMORY. */
#ifndef NPG_MESH_CLEAN_H
#define NPG_MESH_CLEAN_H

#include <stdbool.h>

#include "pipeline/mesh.h"

/* Distance of every vertex to the nearest of N points.  dist: V. */
npg_status npg_mesh_point_dist(float *dist, const npg_mesh *mesh, const float *points, size_t point_count);

/* The same for any V places.  dist: V. */
npg_status npg_points_dist(float *dist, const float *places, size_t place_count, const float *points,
                           size_t point_count);

/* Median distance to the 8th neighbour, over the points: how dense a cloud is. */
npg_status npg_cloud_spacing(double *spacing, const float *points, size_t point_count);

/* Keep the faces whose keep_face (F) is not 0.  *share gets the share of the area that went. */
npg_status npg_mesh_keep_share(npg_mesh **mesh, double *share, const uint8_t *keep_face);

/* The largest of three vertices' distances. */
float npg_farthest_corner(const float *dist, const uint32_t face[3]);

/* Drop the faces of which a vertex is farther than dist_max from every point.  *share gets the share of the
 * area that went. */
npg_status npg_mesh_trim(npg_mesh **mesh, double *share, const float *points, size_t point_count,
                         double dist_max);

/* Share of the area that lies farther than dist_max from every point (by the mean of a face's vertices). */
npg_status npg_mesh_unseen(double *share, const npg_mesh *mesh, const float *points, size_t point_count,
                           double dist_max);

typedef struct npg_pieces {
    size_t found, kept; /* components */
    double lost_share;  /* share of the area that went */
} npg_pieces;

/* Keep the component of the largest area, and those with at least share_min of all area that come within
 * dist_max of it (a hand that a hole in the points cuts off belongs to the body; a ball beside it does not).
 * dist_max 0: the largest alone.  A mesh without faces stays as it is. */
npg_status npg_mesh_keep_main(npg_mesh **mesh, npg_pieces *pieces, double share_min, double dist_max);

/* At most face_max faces, by edge collapse (meshoptimizer). */
npg_status npg_mesh_decimate(npg_mesh **mesh, size_t face_max);

typedef struct npg_mending {
    size_t degenerate, duplicate, split_vertices, holes, flipped; /* what was found and mended */
} npg_mending;

/* Drop faces that use a vertex twice, repeat another or lie back to back with another; give each fan around a
 * vertex its own vertex; close holes of up to 32 edges; smooth where faces are turned over or have no area,
 * and collapse them where that does not help.  Of shreds no face may be left. */
npg_status npg_mesh_mend(npg_mesh **mesh, npg_mending *done);

/* Faces turned over against their surroundings: the normal points against the mean of the neighbours', or the
 * area is zero.  is_flipped (F) may be NULL. */
npg_status npg_mesh_flipped(size_t *count, uint8_t *is_flipped, const npg_mesh *mesh);

/* NPG_BAD_INPUT with the first edge that more than two faces use, or two in the same direction, or the first
 * degenerate face; name is what the text calls the mesh. */
npg_status npg_mesh_require_manifold(const npg_mesh *mesh, const char *name);

#endif
