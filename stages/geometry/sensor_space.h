/* Sensor space: what sensors say of the space around a body. */
#ifndef NPG_SENSOR_SPACE_H
#define NPG_SENSOR_SPACE_H

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"

/* Depth map: what one sensor says of space: how far it saw in every direction.
 *
 * Directions are bins of an octahedral map whose axis looks at the points' middle (T. Engelhardt and
 * C. Dachsbacher, Octahedron Environment Maps, 2008).  Each bin has the distance of its nearest point; a
 * place is compared with its own bin and the eight around it, so that slopes and gaps between points prove
 * nothing. */

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

/* Free space: what the depth images of a frame's sensors say of places, those of which nothing was measured
 * there among them.
 *
 * A place x falls into a cell of a sensor's grid of directions, z ahead of it (npg_depth_view).  With d the
 * least depth measured in that cell and those around it, and m = 3 times the width of a cell at z:
 *
 *     beside  nothing was measured within three cells, and all of these are known to be empty
 *     empty   z < d - m
 *     at      else, up to m behind the depth of its own cell
 *     hidden  farther behind
 *     unknown elsewhere: outside of the image, where the sensor could not tell, close to an outline
 *
 * One sensor that saw a place empty is enough, whatever others say. */

typedef struct npg_free_space npg_free_space;

/* In the coordinates of the box; NULL where the frame has no views.  NPG_MEMORY. */
npg_status npg_free_space_open(npg_free_space **space, const npg_frame *frame, const npg_frame_box *box);
void npg_free_space_close(npg_free_space **space);

/* Both thread-safe.  is_empty: whether a sensor saw that nothing is there; false of no space (NULL). */
npg_sight_kind npg_free_space_look(const npg_free_space *space, const float place[3]);
bool npg_free_space_is_empty(const npg_free_space *space, const float place[3]);

/* to = the nearest place out of what a sensor saw to be empty: of those on the rays of the cells in which it
 * measured a depth, at that depth or farther.  Of several sensors that say so the one with the nearest.  false, with
 * `to` as it was, where the place is not empty or nothing was measured.  Thread-safe. */
bool npg_free_space_leave(const npg_free_space *space, float to[3], const float place[3]);

/* How far off a place that was seen may lie from what was seen there: m of the sensor that sees it best; 0
 * where none sees it.  Thread-safe. */
double npg_free_space_margin(const npg_free_space *space, const float place[3]);

/* Of the points that are seen, the share that lies farther than that from the surface (hits: of each its nearest
 * place there); 0 where none is seen.  Thread-safe. */
double npg_free_space_lost_share(const npg_free_space *space, const float *points,
                                 const npg_surface_hit *hits, size_t count);

/* Bytes of one at most. */
size_t npg_free_space_memory(size_t sensor_count);

#endif
