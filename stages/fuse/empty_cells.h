/* Empty cells: places near the reference that sensors have seen to be empty.
 *
 * Cubes of one size within a band around the surface.  Each hangs on the point of the surface that is closest
 * to it at rest, as a frame's points do (carry_back.h), and goes with it; in every frame it is looked up in
 * the depth map of every sensor (depth_map.h).  A frame says
 *
 *     filled   where a sensor saw something there, within the margin
 *     empty    else, where a sensor saw past it: to something behind it, or beside all that it saw
 *     nothing  else: hidden, or too near to an edge
 *
 * and a cell is empty where most frames that say anything say so.  Not in the paper. */
#ifndef NPG_EMPTY_CELLS_H
#define NPG_EMPTY_CELLS_H

#include "fuse/carry_back.h"

typedef struct npg_empty_cells npg_empty_cells;

/* reference: unit coordinates.  side: of a cell; it grows until there are `most` at most.  band: distance
 * from the surface up to which there are cells.  NPG_MEMORY. */
npg_status npg_empty_cells_open(npg_empty_cells **cells, const npg_mesh *reference, double side, double band,
                                size_t most);
void npg_empty_cells_close(npg_empty_cells **cells);

/* What the sensors of a frame saw, in unit coordinates. */
typedef struct npg_seen {
    const float *sensors; /* S x 3, not finite where one saw nothing */
    size_t sensor_count;
    const float *points; /* N x 3; which sensor saw one is not known: all count for each */
    size_t point_count;
    double bin, margin; /* of the depth maps */
} npg_seen;

/* One frame; carry is where the surface is in it.  NPG_MEMORY. */
npg_status npg_empty_cells_see(npg_empty_cells *cells, const npg_carry_back *carry, const npg_seen *seen);

size_t npg_empty_cells_count(const npg_empty_cells *cells);
double npg_empty_cells_side(const npg_empty_cells *cells);

/* Middles of the empty ones (room for npg_empty_cells_count() x 3): those that at least `frames_least` frames
 * saw empty, and at least `share` of the frames that say anything of them.  Returns how many. */
size_t npg_empty_cells_find(const npg_empty_cells *cells, float *places, int frames_least, double share);

/* Bytes at most. */
size_t npg_empty_cells_memory(size_t most);

#endif
