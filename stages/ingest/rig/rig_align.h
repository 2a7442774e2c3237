/* Rig alignment: one rigid correction per sensor that brings the surfaces which several sensors see together,
 * the same in all frames, and how well they determine it. */
#ifndef NPG_RIG_ALIGN_H
#define NPG_RIG_ALIGN_H

#include "ingest/rig/rig_sights.h"

#define NPG_ALIGN_REACH                                                                                      \
    0.025 /* of the depth: surfaces further apart are different ones, or a pose is far off */

/* A correction: x' = pose x in the world, and the deviation (rms length) of its two halves. */
typedef struct npg_correction {
    double pose[12];
    double shift, turn;       /* of the sensor's position, in the rig's unit; angle, radians */
    double shift_sd, turn_sd; /* standard deviations; infinite where nothing was solved      */
} npg_correction;

/* Least sum over all pairs (npg_rig_sight_match) of rho(n . (C_a p - C_b q)), over the corrections C
 * of the sensors that are free; those of the others stay as they are given.  corrections (one per sensor) are
 * where it starts, and what comes out; at least one sensor must not be free.
 *
 * rho is Huber's, at 1.345 of the residuals' robust deviation, and cuts off at five of them.  Gauss-Newton
 * with new pairs in each step.  A weak prior (4 % of the depth, 3 degrees) holds what nothing determines.
 * The deviations are the larger of two: from the normal equations and the residuals' deviation (twice its
 * square, for each pixel is in about two pairs), and from how much the frames' own gradients differ
 * (sandwich), which knows of errors that neighbouring pixels share.  NPG_MEMORY. */
npg_status npg_rig_solve(npg_correction *corrections, const npg_rig_sights *sights, const bool *is_free);

#endif
