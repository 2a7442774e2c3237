/* Attach: points tied to a surface, carried along when the surface moves.
 *
 * At rest every point p is tied to the closest point c = sum w_k v_k of the surface (face, weights w) and
 * keeps the offset p - c.  In a moved pose the point is c' + R (p - c), with c' = sum w_k v'_k and R a
 * rotation:
 *
 *   - it takes the surface normal at c (vertex normals, mixed by w, unit length) into the one at c';
 *   - around the normal it turns by the angle that fits the three corners, seen along the normal, best in the
 *     sense of least squares.
 *
 * So a point on the surface stays on it, one off it keeps its distance to c, and a rigid motion is followed
 * exactly.  Directions (normals) turn by the same R.
 *
 * Threads: one attachment belongs to one thread at a time. */
#ifndef NPG_ATTACH_H
#define NPG_ATTACH_H

#include "pipeline/mesh.h"

typedef struct npg_attachment npg_attachment;

/* Tie N points (N x 3, in the unit of rest->vert_pos) to a mesh at rest.  normals (N x 3, unit length)
 * may be NULL; with them a point of a thin part is tied to the side its normal looks to:
 * where the closest face looks the other way and one that looks its way lies on the line of the normal
 * within reach (NPG_ATTACH_REACH of the mesh's diagonal), it takes that one.  Both are copied;
 * the mesh is held by reference.  NPG_BAD_INPUT names the first point that is not finite; NPG_USAGE
 * for a mesh without faces; NPG_MEMORY. */
npg_status npg_attach_open(npg_attachment **attachment, npg_mesh *rest, const float *points,
                           const float *normals, size_t point_count);

#define NPG_ATTACH_REACH 0.02 /* of the diagonal: parts that thin have two sides so near; set by trial */

/* Points tied farther away than dist (in the mesh's unit), and the worst of them: its number, and the largest
 * distance of all points.  *worst is 0 without points. */
void npg_attach_far(const npg_attachment *attachment, double dist, size_t *far_count, size_t *worst,
                    double *worst_dist);

/* Where the points are when the mesh's vertices are at vert_pos (V x 3): pos N x 3; normals N x 3 or NULL,
 * only with normals at open. */
npg_status npg_attach_move(npg_attachment *attachment, const float *vert_pos, double *pos, float *normals);

/* NULL inside is fine. */
void npg_attach_close(npg_attachment **attachment);

#endif
