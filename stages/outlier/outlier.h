/* Outlier: what others may use of the room beside normals. */
#ifndef NPG_OUTLIER_H
#define NPG_OUTLIER_H

#include <stdint.h>

#include "outlier/normals.h"
#include "pipeline/chunk.h"

/* What the stage makes of a frame that was just read: points that are no numbers, that lie where another does
 * or that are more than point_max go from it; of those left, keep[i] is 0 for the isolated ones, at `ratio`
 * deviations (0: none is).  keep: the caller's to release; NULL without points.  NPG_MEMORY. */
npg_status npg_frame_clean(npg_frame *frame, uint8_t **keep, size_t point_max, double ratio);

/* The most points of a frame that a run uses: those asked for (0: what a reference of face_max faces can hold). */
size_t npg_clean_point_max(double asked, double face_max);

#endif
