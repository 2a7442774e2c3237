/* The fuse room within: averages over cells, and free-space carving. */
#ifndef NPG_FUSE_INTERNAL_H
#define NPG_FUSE_INTERNAL_H

#include "geometry/geometry.h"
#include "geometry/sensor_space.h"

/* Cells: averages of many points over small cubes, in memory that does not grow with the points.
 *
 * A point is averaged with those whose place on the surface falls into the same cube and whose surface faces
 * the same octant, so that two sides of a thin part stay two:
 *
 *     mean = sum w x / sum w,   normal = sum w n / |sum w n|
 *
 * Where the cubes would become too many they grow: each takes in its neighbours of twice the side.  What
 * fewer frames than asked for saw, counted over cubes of NPG_VOTE_CELLS times the side, is left out at the end.
 * Equal input in equal order gives equal bits. */

#define NPG_VOTE_CELLS 4

typedef struct npg_cells npg_cells;

/* side: of a cell, at first, 1e-5 at least; most: cells at most, 65 at least.  NPG_MEMORY. */
npg_status npg_cells_open(npg_cells **cells, double side, size_t most);
void npg_cells_close(npg_cells **cells);

/* A point with its normal and weight, in the cell of the place `at`, where the surface faces `facing`.
 * frame: of the point; frames come one after the other.  NPG_MEMORY. */
npg_status npg_cells_add(npg_cells *cells, const float at[3], const float facing[3], const float point[3],
                         const float normal[3], float weight, int64_t frame);

size_t npg_cells_count(const npg_cells *cells);
double npg_cells_side(const npg_cells *cells);

/* The means and normals of the cells around which at least `frames_least` frames saw something: points and
 * normals (room for npg_cells_count() x 3 each), in the order in which the cells were met.  *count gets how
 * many.  NPG_MEMORY. */
npg_status npg_cells_means(const npg_cells *cells, float *points, float *normals, size_t *count,
                           int64_t frames_least);

/* Bytes that it takes at most. */
size_t npg_cells_memory(size_t most);

/* Colour cells: the colours of all frames in the keyframe's pose, one robust mean per cube and side.
 *
 * Cubes of one size over the surface; points that face different octants do not share one, so that both sides
 * of a thin part keep their colours.  Memory is bounded: once `most` cubes are in use, new ones are left
 * out. */

typedef struct npg_colour_cells npg_colour_cells;

/* side: of a cube, units.  NPG_MEMORY. */
npg_status npg_colour_cells_open(npg_colour_cells **cells, double side, size_t most);
void npg_colour_cells_close(npg_colour_cells **cells);

/* A sample that counts `weight` times, at a point (units) of a surface that faces `facing` there. */
void npg_colour_cells_add(npg_colour_cells *cells, const float point[3], const float facing[3],
                          const uint8_t rgb[3], unsigned weight);

size_t npg_colour_cells_count(const npg_colour_cells *cells);

/* The cubes' mean points and normals (count x 3 each) and robust colours (count x 4, alpha 255), in the order
 * in which they were met. */
void npg_colour_cells_means(const npg_colour_cells *cells, float *points, float *normals, uint8_t *colours);

/* Bytes at most. */
size_t npg_colour_cells_memory(size_t most);

/* Free-space carving: places near the reference that sensors have seen to be empty.
 *
 * Cubes of one size within a band around the surface.  Each hangs on the point of the surface that is closest
 * to it at rest, as a frame's points do (geometry/skinning.c), and goes with it; in every frame it is looked up
 * in the depth map of every sensor (depth_map.h).  A frame says
 *
 *     filled   where a sensor saw something there, within the margin
 *     empty    else, where a sensor saw past it: to something behind it, or beside all that it saw
 *     nothing  else: hidden, or too near to an edge
 *
 * and a cell is empty where most frames that say anything say so.  Not in the paper. */

typedef struct npg_carving npg_carving;

/* reference: unit coordinates.  side: of a cell; it grows until there are `most` at most.  band: distance
 * from the surface up to which there are cells.  NPG_MEMORY. */
npg_status npg_carving_open(npg_carving **cells, const npg_mesh *reference, double side, double band,
                            size_t most);
void npg_carving_close(npg_carving **cells);

/* What the sensors of a frame saw, in unit coordinates. */
typedef struct npg_seen {
    const float *sensors; /* S x 3, not finite where one saw nothing */
    size_t sensor_count;
    const float *points; /* N x 3; which sensor saw one is not known: all count for each */
    size_t point_count;
    double bin, margin;    /* of the depth maps */
    npg_free_space *space; /* what the images say, instead of maps of the points; or NULL */
    bool is_key;           /* the frame that a growing side is of: its motion alone is certain */
} npg_seen;

/* One frame; skin is where the surface is in it.  NPG_MEMORY. */
npg_status npg_carving_see(npg_carving *cells, const npg_skin *skin, const npg_seen *seen);

size_t npg_carving_count(const npg_carving *cells);
double npg_carving_side(const npg_carving *cells);

/* Middles of the empty ones (room for npg_carving_count() x 3): those that at least `frames_least` frames
 * saw empty, and at least `share` of the frames that say anything of them; 1 - `share` where the frame with
 * is_key fills them.  Returns how many. */
size_t npg_carving_find(const npg_carving *cells, float *places, int frames_least, double share);

/* Bytes at most. */
size_t npg_carving_memory(size_t most);

#endif
