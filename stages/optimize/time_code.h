/* Time code: what the decoder is told about time (paper: "Fourier Time Encoding" and the table
 * on time functions). */
#ifndef NPG_TIME_CODE_H
#define NPG_TIME_CODE_H

#include <stddef.h>
#include <stdint.h>

#include "pipeline/status.h"

typedef enum npg_time_kind {
    NPG_TIME_FOURIER,    /* sin(pi 2^j t), j = 0 .. M - 1, then cos                         */
    NPG_TIME_POLYNOMIAL, /* t^j, j = 1 .. 2 M                                               */
    NPG_TIME_GAUSSIAN,   /* sin(2 pi b_j t), then cos, b_j drawn from a normal distribution */
    NPG_TIME_LEARNED     /* a two-layer network of t, trained along                         */
} npg_time_kind;

typedef struct npg_time_code npg_time_code;

/* frequencies: M, so that a code has 2 M values. */
npg_status npg_time_code_open(npg_time_code **code, npg_time_kind kind, size_t frequencies, uint64_t seed);
void npg_time_code_close(npg_time_code **code);

/* codes [count][2 M] of the times [count] (0 is the first frame, 1 the last). */
void npg_time_code_fill(const npg_time_code *code, float *codes, const double *times, size_t count);

/* Parameters and moments of a learned code (*count doubles) and its steps so far, for saving and restoring;
 * NULL and 0 for the others. */
double *npg_time_code_parts(npg_time_code *code, size_t *count, int64_t **step);

/* Whether the code has parameters to train; and one step of Adam for them with dcodes [count][2 M]. */
int npg_time_code_learns(const npg_time_code *code);
npg_status npg_time_code_step(npg_time_code *code, const float *dcodes, const double *times, size_t count,
                              double rate);

#endif
