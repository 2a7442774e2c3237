/* Frame box: the one place where coordinates change.
 *
 *   world   what the files say, double
 *   local   world - origin, float; origin is a point of the capture, so captures far from 0 keep their detail
 *   unit    (local - centre) * scale, float; the box of all frames has its longest side in [-0.95, 0.95] and
 * its middle at 0 (the paper normalises to [-1, 1]; 0.95 leaves the grids a margin) */
#ifndef NPG_FRAME_BOX_H
#define NPG_FRAME_BOX_H

#include <stdbool.h>

#include "pipeline/status.h"

#define NPG_UNIT_EXTENT 0.95 /* half of the longest side of the box, in units */

/* The longest side that a capture may have.  Cleaning and normals come before the box and are in local float:
 * below, squares and cubes of the points' spacing leave its range; above, points count as not
 * finite. */
#define NPG_SIDE_MIN 1e-13
#define NPG_SIDE_MAX 1e12

typedef struct npg_bounds { /* empty while lo > hi */
    double lo[3], hi[3];
} npg_bounds;

typedef struct npg_origin { /* not known until the first file with a finite point has been read */
    bool known;
    double world[3];
} npg_origin;

typedef struct npg_frame_box {
    double origin[3]; /* world                                     */
    double centre[3]; /* local                                     */
    double scale;     /* unit / local                              */
    double diagonal;  /* of the figure, in local (and world) units: the bounds', until the keyframe stage
                         sets the median over frames of the diagonal of a frame's own box */
} npg_frame_box;

/* Make a point the origin, unless it is known already or the point is not finite. */
void npg_origin_offer(npg_origin *origin, const double world[3]);

npg_bounds npg_bounds_empty(void);
void npg_bounds_add_points(npg_bounds *bounds, const float *points, size_t point_count);
npg_bounds npg_bounds_of(const float *points, size_t point_count);
void npg_bounds_add(npg_bounds *bounds, const npg_bounds *other);
double npg_bounds_diagonal(const npg_bounds *bounds);

/* The longest side; 0 while nothing was added. */
double npg_bounds_longest(const npg_bounds *bounds);

/* The box for local bounds.  NPG_BAD_INPUT when they are empty or not finite, or their longest side is 0
 * or none that a capture may have. */
npg_status npg_frame_box_set(npg_frame_box *box, const npg_origin *origin, const npg_bounds *bounds_local);

/* N x 3 each; out may be the input. */
void npg_box_local_to_unit(const npg_frame_box *box, float *unit, const float *local, size_t point_count);
void npg_box_unit_to_world(const npg_frame_box *box, double *world, const float *unit, size_t point_count);

#endif
