/* Extent: how much surface a frame shows, as the number of cells of a grid that hold a point.
 *
 * Where cells are much smaller than the points are apart, that is the number of points and says nothing of
 * the surface: so it is with the paper's cells, a 512th of the box, and 5000 points.  With cells of
 *
 *     side = max(2 x spacing of the first frame's points, 1.5 % of the figure's diagonal)
 *
 * it goes with the area: a frame whose parts touch, or hide each other from the sensors, has fewer.  Their
 * number is then the sum over eight places of the grid; it scatters by half a per cent. */
#ifndef NPG_EXTENT_H
#define NPG_EXTENT_H

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"

typedef struct npg_extent npg_extent;

/* The cells of a capture of which this is a frame.  NPG_MEMORY. */
npg_status npg_extent_open(npg_extent **extent, const npg_frame_box *box, const npg_frame *first);
void npg_extent_close(npg_extent **extent);

/* Cells that hold a finite point of the frame: the paper's, and those that go with the area. */
size_t npg_extent_papers(npg_extent *extent, const npg_frame *frame);
size_t npg_extent_area(npg_extent *extent, const npg_frame *frame);

#endif
