/* Cells: averages of many points over small cubes, in memory that does not grow with the points.
 *
 * A point is averaged with those whose place on the surface falls into the same cube and whose surface faces
 * the same octant, so that two sides of a thin part stay two:
 *
 *     mean = sum w x / sum w,   normal = sum w n / |sum w n|
 *
 * Where the cubes would become too many they grow: each takes in its neighbours of twice the side.  What
 * fewer frames than asked for saw, counted over cubes of four times the side, is left out at the end.
 * Equal input in equal order gives equal bits. */
#ifndef NPG_CELLS_H
#define NPG_CELLS_H

#include "pipeline/status.h"

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

#endif
