/* Tuning: what differs between a wide processor and a GPU.  A kernel exists once; tile, vector width,
 * work-group and share of work are numbers that reach it as build constants.
 *
 * Each set gives the same bytes on the same device whenever it is used; two sets differ in the order of sums,
 * so in the last digits. */
#ifndef NPG_TUNING_H
#define NPG_TUNING_H

#include <stddef.h>

typedef struct npg_tuning {
    const char *name;
    int mlp_rows;         /* vertices in a block of the decoder                                  */
    int mlp_vector;       /* floats in a vector of the decoder: 4, 8, 16                         */
    int mlp_tile_vectors; /* vectors in a row of a register tile                                 */
    int mlp_tile_rows;    /* rows of a register tile                                             */
    int mlp_grad_rows;    /* rows of a register tile of the weights' gradient                    */
    int mlp_head_rows;    /* rows of a register tile of the last layer                           */
    int mlp_local;        /* work-items that share a block                                       */
    int mlp_groups;       /* blocks under way for each compute unit                              */
    int nearest_queries;  /* searches that a work-item makes one after the other                 */
    int frame_local;      /* work-items that share a frame: chamfer, boxes of the searches       */
    int span;             /* values that a work-item takes in a row: adam, sums of the gradient  */
    int local;            /* work-group of the other kernels                                     */
} npg_tuning;

/* The sets for processors with vectors of 16 floats, of 8 or fewer, and for GPUs. */
extern const npg_tuning npg_tuning_wide, npg_tuning_narrow, npg_tuning_gpu;

/* The build constants of kernels/<program>.cl. */
void npg_tuning_constants(char *out, size_t size, const npg_tuning *tuning, const char *program);

#endif
