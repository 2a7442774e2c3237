/* Reading of one frame for a page: its mesh, its points, and how far they are from each other. */
#ifndef NPG_VIEW_READ_H
#define NPG_VIEW_READ_H

#include "tools/view/view_frame.h"

/* Fill frames->vert_pos, relative to the part's origin: from the mesh's file; without one it stays. */
npg_status npg_view_read_mesh(npg_view_frames *frames, const npg_view_frame *frame);

/* Fill frames->points, in the coordinates of the meshes and relative to the part's origin.  None where the
 * file can't be read: noted in `frames`, no failure.  NPG_MEMORY. */
npg_status npg_view_read_points(npg_view_frames *frames, const npg_view_frame *frame);

/* errors (V, 0 to 255) of the frame at hand, and frames->seen. */
npg_status npg_view_measure(npg_view_frames *frames, int32_t *errors);

/* Copy at most frames->point_limit of the points to frames->some, in the order of a space-filling curve. */
npg_status npg_view_choose_points(npg_view_frames *frames, size_t *count);

#endif
