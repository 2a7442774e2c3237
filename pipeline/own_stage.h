/* Own stage: a stage that a program adds to the chain through npg_options_add_stage(). */
#ifndef NPG_OWN_STAGE_H
#define NPG_OWN_STAGE_H

#include "pipeline/stage.h"

#define NPG_OWN_STAGES_MAX 6 /* beside the chain's */

typedef struct npg_own {
    npg_stage stage; /* first: what the worker points to */
    npg_own_stage given;
    uint32_t fields; /* NPG_FIELD_* that frames and facts have where it stands */
} npg_own;

/* A stage for `given` (a loan that outlives it), to stand right after `before` in a chain
 * that has `fields` there. */
npg_own npg_own_make(const npg_own_stage *given, const npg_stage *before, uint32_t fields);

/* Check what a program gives: name, place in the chain, callback.  NPG_USAGE. */
npg_status npg_own_check(const npg_own_stage *given, const npg_stage *const *chain);

#endif
