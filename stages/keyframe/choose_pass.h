/* Choosing pass: reads the frames of facts.choice, and takes the one of its candidates whose surface fits
 * best in the others (choose.h) for the keyframe. */
#ifndef NPG_CHOOSE_PASS_H
#define NPG_CHOOSE_PASS_H

#include "align/candidate_clouds.h"
#include "keyframe/choose.h"

/* The frames read so far; zeroed before the pass. */
typedef struct npg_choose_pass {
    npg_candidate_clouds *clouds; /* owned */
} npg_choose_pass;

/* Remember what the frames of a chunk show.  NPG_MEMORY. */
npg_status npg_choose_pass_add(npg_choose_pass *pass, const npg_facts *facts, npg_chunk *chunk);

/* The end of the pass: *result gets the candidate to take, result->index -1 where the frame by score stays.
 * Its candidates go into the stage's report; what was seen is published where welds are to be cut
 * (npg_fact_candidate_clouds).  NPG_MEMORY, NPG_STOPPED. */
npg_status npg_choose_pass_end(npg_choose_pass *pass, npg_worker *worker, npg_draft_result *result);

void npg_choose_pass_clear(npg_choose_pass *pass);

#endif
