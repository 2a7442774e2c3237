/* Measure: how well a deformed reference explains the points of its frame. */
#ifndef NPG_MEASURE_H
#define NPG_MEASURE_H

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/mesh.h"

typedef struct npg_measure npg_measure;

typedef struct npg_measure_settings {
    double cover_dist;   /* a point that near covers the surface, in per cent of the diagonal */
    int64_t point_limit; /* points of a frame that are asked for at most; 0: all               */
} npg_measure_settings;

/* The mesh is a loan that must outlive the measure.  unseen_share: of its area that no point of its frame saw,
 * 0 to 1.  NPG_MEMORY; *measure is NULL after an error. */
npg_status npg_measure_open(npg_measure **measure, const npg_mesh *reference, double unseen_share,
                            const npg_measure_settings *settings);
void npg_measure_close(npg_measure **measure);

/* Fill the frame's figures from its vertices (V x 3, as the reference's) and its points: those of shape
 * (npg_shape_measure()), and unless the frame is skipped or has no finite point
 *
 *   point_dist_*       of the points to the surface, in diagonals of the box
 *   vertex_dist_mean   of the vertices to the nearest point, the same
 *   chamfer            1e5 x half the sum of both mean squares
 *   coverage           share of the area with a point within max(cover_dist, 2 x spacing of the points)
 *   unsupported_*      share and largest place of what neither the reference's points nor these support
 *   misfits            as npg_misfit_find(), in world coordinates
 *
 * What is not known stays as it is.  One thread at a time.  NPG_MEMORY. */
npg_status npg_measure_frame(npg_measure *measure, npg_frame *frame, const npg_frame_box *box);

/* Bytes that a measure takes, at most: points, hits and distances, with the k-d tree about as much again; per
 * vertex of the reference the shape, the surface and its search tree. */
size_t npg_measure_memory(const npg_measure_settings *settings, size_t point_count, size_t vert_count);

#endif
