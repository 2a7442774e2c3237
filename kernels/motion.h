/* motion: what follows the decoder: transform, nearest, chamfer, isometry;
 * one .cl for each.  Positions on the device are in blocks of 16 (layout.h). */
#ifndef NPG_MOTION_H
#define NPG_MOTION_H

#include "kernels/kernels.h"
#include "kernels/layout.h"

typedef struct npg_motion {
    npg_program *transform, *nearest, *chamfer, *isometry;
    size_t rows, real, frames;              /* V padded, V, T                                           */
    npg_buffer rest;                        /* positions that are transformed: of all frames, or of each   */
    size_t stride;                          /* floats from one frame's to the next; 0: all have the same   */
    npg_buffer x, g;                        /* [frames] positions and dL/dx                             */
    npg_buffer vert_boxes;                  /* [frames][tree blocks of V][96]                           */
    npg_buffer points, point_boxes;         /* all targets, and their trees                             */
    npg_buffer to_points, to_verts;         /* nearest indices, kept as candidates from step to step    */
    npg_buffer forward, reverse;            /* slots: vertex -> point, point -> vertex                  */
    npg_buffer start, neighbour, edge_rest; /* half-edges by vertex                                     */
    npg_buffer cd, part, gain;
    size_t most_points, half_edges;
    size_t local, queries; /* from the tuning: work-items of a frame, searches of a work-item */
} npg_motion;

/* A target of one frame: points in Morton order; a loan during npg_motion_open. */
typedef struct npg_target {
    const float *points; /* N x 3 */
    size_t count;        /* N >= 1 */
} npg_target;

/* vertices: real x 3 in Morton order; edges between them (E pairs).  rows: real padded, a multiple of 16.
 * targets: one per frame, or NULL when npg_motion_chamfer() will not be called. */
npg_status npg_motion_open(npg_motion *motion, npg_device *device, const float *vertices, size_t real,
                           size_t rows, const uint32_t (*edges)[2], size_t edge_count,
                           const npg_target *targets, size_t frames);
void npg_motion_close(npg_motion *motion);

/* From now on each frame's own positions are transformed: bases [frames][real x 3], ordered as the vertices that
 * the motion was opened with, whose edges stay what edges are compared with. */
npg_status npg_motion_rebase(npg_motion *motion, npg_device *device, const float *bases);

/* x of frames first .. first + count - 1 from the decoder's out [frames][rows][8]. */
npg_status npg_motion_apply(npg_motion *motion, const npg_buffer *out, size_t first, size_t count);

/* Correspondences, cd [frames] and its gradient g, with Welsch weights of width alpha (0: none). */
npg_status npg_motion_chamfer(npg_motion *motion, double alpha, size_t first, size_t count);

/* g = gain[frame] g + iso_gain d(isometry)/dx; then dout from g.  gains: one per frame from `first` on.
 * part [frames][blocks of the rows] gets the sums of edge changes over half-edges. */
npg_status npg_motion_back(npg_motion *motion, const npg_buffer *dout, const npg_buffer *out,
                           const float *gains, double iso_gain, size_t first, size_t count);

#endif
