/* Least: of the states that a fit goes through, a copy of the one with the least loss.
 *
 * Steps of constant length circle around a minimum instead of ending in it: from one epoch to the next the
 * loss goes up and down by several per cent, and the last state is one draw of many. */
#ifndef NPG_FIT_LEAST_H
#define NPG_FIT_LEAST_H

#include "optimize/fit.h"
#include "pipeline/archive.h"

/* All that steps change, where it lives: loans. */
typedef struct npg_fit_knowns {
    npg_buffer *rows, *params; /* differential coordinates, decoder */
    npg_time_code *time_code;
} npg_fit_knowns;

/* {0} is none yet. */
typedef struct npg_fit_least {
    npg_fit_step step;    /* what the state's epoch measured before its own step */
    double loss;          /* of that step, without confidence; only with rows    */
    float *rows, *params; /* copies, owned; NULL: none yet                       */
    double *code;         /* of the time code's parameters, owned                */
    size_t row_bytes, param_bytes, code_bytes;
} npg_fit_least;

/* Chamfer distance and weighted isometry without the confidence of frames, which changes
 * from epoch to epoch. */
double npg_fit_plain_loss(const npg_fit_step *step, double isometry_weight);

/* Copy the state when its loss is less than the least so far. */
npg_status npg_fit_least_offer(npg_fit_least *least, const npg_fit_step *step, double loss,
                               const npg_fit_knowns *now);

/* Put the copy where it came from; there must be one. */
npg_status npg_fit_least_restore(const npg_fit_least *least, const npg_fit_knowns *to);
void npg_fit_least_clear(npg_fit_least *least);

/* As blocks "least.*" of an archive; where they are missing there is none yet. */
npg_status npg_fit_least_save(const npg_fit_least *least, npg_archive_writer *archive);
npg_status npg_fit_least_load(npg_fit_least *least, const npg_archive *archive);

#endif
