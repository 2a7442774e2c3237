/* Depth map: what one sensor says of space: how far it saw in every direction.
 *
 * Directions are bins of an octahedral map whose axis looks at the points' middle (T. Engelhardt and
 * C. Dachsbacher, Octahedron Environment Maps, 2008).  Each bin has the distance of its nearest point; a
 * place is compared with its own bin and the eight around it, so that slopes and gaps between points prove
 * nothing. */
#ifndef NPG_DEPTH_MAP_H
#define NPG_DEPTH_MAP_H

#include "pipeline/status.h"

typedef struct npg_depth_map npg_depth_map;

typedef enum npg_sight_kind {
    NPG_SEEN_UNKNOWN, /* no ray went there, or too near the end of what was seen                  */
    NPG_SEEN_HIDDEN,  /* behind what was seen                                                     */
    NPG_SEEN_AT,      /* within the margin of it                                                  */
    NPG_SEEN_EMPTY,   /* clearly nearer to the sensor than all that was seen in and around its bin */
    NPG_SEEN_BESIDE   /* outside of the outline: no point in its bin, around it, or on some way out */
} npg_sight_kind;

/* sensor and points (N x 3) in the same coordinates.  side: of a bin, as a length at the points' mean
 * distance; margin: a length.  Points at the sensor itself are left out; without any point all is unknown.
 * NPG_MEMORY. */
npg_status npg_depth_map_open(npg_depth_map **map, const float sensor[3], const float *points,
                              size_t point_count, double side, double margin);
void npg_depth_map_close(npg_depth_map **map);

/* What the sensor says of a place.  Thread-safe. */
npg_sight_kind npg_depth_map_look(const npg_depth_map *map, const float place[3]);

/* Bytes of one at most. */
size_t npg_depth_map_memory(void);

#endif
