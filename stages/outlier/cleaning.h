/* Cleaning: from the points of a file to those worth using.
 *
 * The steps change a frame's pos_local and normals in place, keep the order of what stays, and count what
 * goes in frame->cleaning.  Deterministic for every number of threads.  NPG_MEMORY. */
#ifndef NPG_CLEANING_H
#define NPG_CLEANING_H

#include "pipeline/chunk.h"

#define NPG_COORDINATE_MAX 1e12f /* farther from the origin than this counts as not finite */

/* Drop points with a coordinate that is not a usable number. */
npg_status npg_clean_finite(npg_frame *frame);

/* Of points at exactly one place keep the first. */
npg_status npg_clean_duplicates(npg_frame *frame);

/* Keep the first point of every cubic cell with this side (local units). */
npg_status npg_clean_voxels(npg_frame *frame, double side);

/* Thin by cells until at most point_max points are left (more than half of that, unless the cloud is stranger
 * than a surface).  *side is the side of the cells, 0 when there was nothing to do. */
npg_status npg_clean_cap(npg_frame *frame, double *side, size_t point_max);

/* NPG_BAD_INPUT when there are fewer than 16 points, or all lie in one place, on one line or on one plane. */
npg_status npg_clean_check(const npg_frame *frame);

#endif
