/* One view: whether one sensor saw all points of a cloud, and from where.
 *
 * points: N x 3, finite.  The same input gives the same result; any number of calls may run at once. */
#ifndef NPG_ONE_VIEW_H
#define NPG_ONE_VIEW_H

#include <stdbool.h>
#include <stddef.h>

#include "pipeline/status.h"

/* Whether the cloud looks like one view from a sensor: hardly a point is hidden behind another as seen from
 * there, and the sensor is outside the cloud's box.  NPG_MEMORY. */
npg_status npg_cloud_is_single_view(bool *yes, const float *points, size_t point_count,
                                    const double sensor[3]);

/* A place from which the cloud looks like one view, at a distance of 1.5 times its size, where there is one:
 * of places all round it, the mean of those from which least is hidden.  Seen from the other side as little
 * is hidden; a body bulges toward its sensor, so there what lies along its outline is farther away, and a
 * cloud for which that does not tell the sides apart has none.  Known to about 15 degrees (a dancer).
 * Cost: 200 000 points drawn for a cloud of many views, about 700 000 for one of one view.  NPG_MEMORY. */
npg_status npg_one_view_find(bool *found, double sensor[3], const float *points, size_t point_count);

/* Bytes that it takes. */
size_t npg_one_view_memory(void);

#endif
