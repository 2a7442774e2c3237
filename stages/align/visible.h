/* Visible: which places of a surface sensors can see, in the pose at work.
 *
 * A sensor sees a place that faces it and has none of the surface before it.  What no sensor sees must not be
 * drawn to the points: they are of another side of the body. */
#ifndef NPG_VISIBLE_H
#define NPG_VISIBLE_H

#include "geometry/query.h"
#include "pipeline/memory.h"

/* Room for a number of places; the arena's, which knows whether there was enough. */
typedef struct npg_visible {
    npg_ray *rays;
    npg_ray_hit *hits;
} npg_visible;

void npg_visible_open(npg_visible *visible, npg_arena *arena, size_t place_count);

/* Whether a place with this unit normal faces one of the sensors (S x 3): the cosine to the way there is
 * above `least`.  A sensor that is not finite saw nothing. */
bool npg_faces_sensor(const float *sensors, size_t sensor_count, const float place[3], const double normal[3],
                      double least);

/* is_seen[i] (N): whether a sensor sees places[i] (N x 3) of the surface, with the normals of its vertices
 * (verts[i]: which one it is; NULL: the i-th); all are where no sensor is known (sensor_count 0).  offset:
 * surface nearer than that hides nothing.  All in the same coordinates.  NPG_MEMORY. */
npg_status npg_visible_find(npg_visible *visible, uint8_t *is_seen, const npg_surface *surface,
                            const float *sensors, size_t sensor_count, const float *places,
                            const uint32_t *verts, const float *vert_normals, size_t count, double offset);

#endif
