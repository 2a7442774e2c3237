/* Normals: direction by principal components, side by agreement with neighbours and by the winding number of
 * the whole cloud (closed bodies: outward) or by the sensor (single views: toward it).
 *
 * points and normals: N x 3, points finite.  Every function gives the same result for every number of threads
 * and may fail with NPG_MEMORY only, unless said otherwise. */
#ifndef NPG_NORMALS_H
#define NPG_NORMALS_H

#include <stdbool.h>

#include "pipeline/status.h"

#define NPG_SURFACE_POINTS 16 /* of a cloud: fewer are no surface; set by trial */
#define NPG_NEIGHBOURS     12 /* of a point, itself among them: of its side, and whether it is isolated */

/* The direction in which a few points spread least. */
void npg_normal_of(float normal[3], const float *points, size_t point_count);

/* Unit normals without a side: the direction in which the `neighbours` nearest points spread least. */
npg_status npg_normals_estimate(float *normals, const float *points, size_t point_count, int neighbours);

/* The same at `at_count` of the points alone, for several numbers of neighbours among all N, ascending, at once:
 * normals[i] (at_count x 3) are those of neighbours[i]. */
npg_status npg_normals_estimate_at(float *const *normals, const uint32_t *at, size_t at_count,
                                   const float *points, size_t point_count, const int *neighbours,
                                   size_t count);

/* Turn every normal toward the sensor (same coordinates as the points).  *flipped counts the turned ones. */
void npg_normals_face_sensor(float *normals, size_t *flipped, const float *points, size_t point_count,
                             const double sensor[3]);

/* Estimate and orient with several numbers of neighbours and keep the result whose sides fit together best: few
 * follow thin limbs, many see through noise.  Outward for closed bodies, to the convex side for open ones. */
npg_status npg_normals_make(float *normals, const float *points, size_t point_count);

/* Find normals on the wrong side among given ones and turn them: by neighbours and winding number, beginning
 * from the sides given.  *flipped counts the turned ones. */
npg_status npg_normals_mend(float *normals, size_t *flipped, const float *points, size_t point_count);

#endif
