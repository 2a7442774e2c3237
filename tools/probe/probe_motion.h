/* Motion: how far a figure's parts go from one frame to the next, without following them.
 *
 * step = the 90th percentile of the distance from a frame's points to the next frame's nearest one, over the
 * diagonal of the box that holds all but the outermost 1 % of the frame's points along each axis; the mean
 * over the capture.  A few hundred points of a thinned frame are asked, so that it costs milliseconds. */
#ifndef NPG_PROBE_MOTION_H
#define NPG_PROBE_MOTION_H

#include "pipeline/chunk.h"

typedef struct npg_probe_motion {
    float *last; /* thinned points of the last frame, owned */
    size_t last_count;
    double sum;
    size_t pairs;
} npg_probe_motion;

/* Add the next frame; one with too few points breaks the sequence.  NPG_MEMORY. */
npg_status npg_probe_motion_add(npg_probe_motion *motion, const npg_frame *frame);
void npg_probe_motion_uninit(npg_probe_motion *motion);

#endif
