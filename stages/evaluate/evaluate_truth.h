/* Truth: a frame against the ground truth, where the user has one. */
#ifndef NPG_EVALUATE_TRUTH_H
#define NPG_EVALUATE_TRUTH_H

#include "pipeline/stage.h"

typedef struct npg_truth npg_truth;

/* The meshes (PLY or OBJ) of a folder, found by the last number in their names.  NPG_BAD_INPUT when there are
 * none or two have one number, and with is_confined when one leads out of the folder. */
npg_status npg_truth_open(npg_truth **truth, const char *folder, bool is_confined);
void npg_truth_close(npg_truth **truth);

/* Fill truth_cd, truth_nc, truth_f and truth_corr of a frame by geometry/metrics.h; they are NaN when the
 * folder has no mesh of the frame's number.  Lengths are in diagonals of the box of the truth's mesh of the
 * run's lowest number, or of the first there is.  Corr ties vertices in the first frame that is asked for,
 * the keyframe of a run (neupig eval ties them in the first in time, which this pass sees last). */
npg_status npg_truth_compare(npg_truth *truth, npg_frame *frame, const npg_facts *facts, uint64_t seed);

#endif
