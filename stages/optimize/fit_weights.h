/* Weights: the confidence of each frame (paper, eq. confidence, and the table on stability terms). */
#ifndef NPG_FIT_WEIGHTS_H
#define NPG_FIT_WEIGHTS_H

#include "optimize/fit.h"

/* State of one epoch; frames are asked for from the key outward, so that each product
 * is ready when needed. */
typedef struct npg_weights {
    int confidence, catch_up;
    double progress; /* e / e_max */
    double delta;
    int64_t key;
    double key_cd;        /* NaN before the first frame with points */
    double before, after; /* product of omega on either side of the key so far */
    double share;         /* 1 / T */
} npg_weights;

void npg_weights_begin(npg_weights *weights, const npg_fit_settings *settings, double progress, int64_t key,
                       size_t frame_count);

/* The weight of the next frame outward, times 1 / T; 0 for a frame without points. */
double npg_weights_next(npg_weights *weights, int64_t index, double cd, bool has_points);

#endif
