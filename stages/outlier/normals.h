/* Normals: by the winding number of the whole cloud (closed bodies: outward), or by principal components and the
 * sensor (single views: toward it); and how dense and noisy a cloud is.
 *
 * points and normals: N x 3, points finite.  Every function gives the same result for every number of threads
 * and may fail with NPG_MEMORY only, unless said otherwise. */
#ifndef NPG_NORMALS_H
#define NPG_NORMALS_H

#include <stdbool.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "pipeline/memory.h"

#define NPG_NEIGHBOURS 12 /* of a point, itself among them: of its side, and whether it is isolated */

/* The direction in which a few points spread least. */
void npg_normal_of(float normal[3], const float *points, size_t point_count);

/* Unit normals without a side: the direction in which the `neighbours` nearest points spread least. */
npg_status npg_normals_estimate(float *normals, const float *points, size_t point_count, int neighbours);

/* Turn every normal toward the sensor (same coordinates as the points).  *flipped counts the turned ones. */
void npg_normals_face_sensor(float *normals, size_t *flipped, const float *points, size_t point_count,
                             const float sensor[3]);

/* Winding: unit normals of all points together, outward of what they enclose, and of what is open to one side
 * (sheets.c): winding.c has the formula.  given (N x 3, unit, some on the wrong side): where to begin, and then what
 * is open faces to its convex sides; or NULL.  Of large clouds an even choice of points makes the field, and the
 * normals of all are read from it, as coarse as those points are: npg_winding_is_whole() says whether all took
 * part.  A point without any direction keeps what normals has.  N >= 1.  The time goes with N log N (winding_sums.h).  NPG_MEMORY. */
npg_status npg_winding_normals(float *normals, const float *points, const float *given, size_t point_count);
bool npg_winding_is_whole(size_t point_count);
size_t npg_winding_memory(size_t point_count); /* bytes at most */

/* Which points of a sheet face away from the side that its largest part has.  normals: as the winding number has them;
 * number (N): it, at the points; arrays are the arena's (sheets.c). */
npg_status npg_sheets_find_away(uint8_t *away, npg_arena *arena, const float *points, const float *normals,
                                const float *number, const npg_neighbours *near, size_t point_count);

/* Unit normals from nothing: outward for closed bodies, to one side for open ones. */
npg_status npg_normals_make(float *normals, const float *points, size_t point_count);

/* Find normals on the wrong side among given ones (unit length) and turn them, beginning from the sides given:
 * one by one where few face away, else by whole patches of neighbours that agree.  *flipped counts the turned ones. */
npg_status npg_normals_mend(float *normals, size_t *flipped, const float *points, size_t point_count);

/* Median distance to the 8th neighbour, over the points: how dense a cloud is. */
npg_status npg_cloud_spacing(double *spacing, const float *points, size_t point_count);

/* Standard deviation of the points across their surface.  Residuals to planes through 8 and through 24
 * neighbours are noise plus curvature, and only curvature grows with the neighbourhood (with its area): the
 * difference tells them apart.  normals (outward) or NULL: with them, points of thin parts, which have another
 * side among those neighbours, are not asked, unless nine in ten are; how far that side is is no noise. */
npg_status npg_cloud_noise(double *sigma, const float *points, const float *normals, size_t point_count);

#endif
