/* Copy: what a fit knows (grids, decoder, time code and their optimisers) on the host: to start a window from
 * another than the one before it, and to let two fits of the same settings over different points of the
 * surface share one state. */
#ifndef NPG_FIT_COPY_H
#define NPG_FIT_COPY_H

#include "optimize/fit.h"
#include "pipeline/store.h"

/* {0} is none yet. */
typedef struct npg_fit_copy {
    char *bytes; /* all parts one behind the other, owned; NULL: none */
    size_t size;
} npg_fit_copy;

/* The present state, between steps. */
npg_status npg_fit_copy_take(npg_fit_copy *copy, npg_fit *fit);
npg_status npg_fit_copy_give(const npg_fit_copy *copy, npg_fit *fit);
void npg_fit_copy_clear(npg_fit_copy *copy);

/* Grids, decoder and time code from one fit to another, whose optimiser stays its own: the moments of another
 * loss would shorten or lengthen its steps for hundreds of epochs. */
npg_status npg_fit_hand_over(npg_fit *to, npg_fit *from);

/* As a block of a store; loading a block that is missing leaves none. */
npg_status npg_fit_copy_save(const npg_fit_copy *copy, npg_store *store, const char *block);
npg_status npg_fit_copy_load(npg_fit_copy *copy, const npg_record *store, const char *block);

/* The present state of a fit as a block, and back into one of the same settings and reference: NPG_BAD_INPUT
 * where the block is missing or has another size. */
npg_status npg_fit_save(npg_fit *fit, npg_store *store, const char *block);
npg_status npg_fit_restore(npg_fit *fit, const npg_record *record, const char *block);

#endif
