/* Colour cells: the colours of all frames in the keyframe's pose, one robust mean per cube and side.
 *
 * Cubes of one size over the surface; points that face different octants do not share one, so that both sides
 * of a thin part keep their colours.  Memory is bounded: once `most` cubes are in use, new ones are left
 * out. */
#ifndef NPG_COLOUR_CELLS_H
#define NPG_COLOUR_CELLS_H

#include "pipeline/memory.h"

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

#endif
