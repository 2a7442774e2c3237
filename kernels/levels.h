/* Levels: the grids whose nodes form one table of features, [nodes][32], and how they are sampled. */
#ifndef NPG_LEVELS_H
#define NPG_LEVELS_H

#include <stdbool.h>
#include <stdint.h>

#include "kernels/layout.h"
#include "pipeline/memory.h"

#define NPG_LEVELS_MAX 32
#define NPG_CELL_NODES 8 /* corners of a grid cell: the nodes that a point is sampled from */

typedef enum npg_level_kind {
    NPG_LEVEL_POSITION, /* dense grid over [-1, 1]^3, sampled at positions */
    NPG_LEVEL_NORMAL    /* dense grid over [-1, 1]^3, sampled at normals   */
} npg_level_kind;

/* D counts a node's neighbours inside the grid, A joins them. */
typedef struct npg_level {
    npg_level_kind kind;
    int nodes;                      /* n per axis                                           */
    size_t first_row, row_count;    /* in the table; row_count = n^3                        */
    int channel_first, channel_end; /* the channels it fills                                */
    double share;                   /* weight of its value: 1 / L where levels are averaged */
    double lambda; /* of the smoothing, I + lambda (2 D - A) as in the published code; 0: none */
    double rate;   /* learning rate                                        */
} npg_level;

typedef struct npg_levels {
    npg_level level[NPG_LEVELS_MAX];
    int count;
    size_t row_count; /* of all levels */
} npg_levels;

/* Append a level; fills first_row and row_count.  Nodes lie at the corners of the cube ("align corners"); node
 * (i, j, k) is row (i n + j) n + k. */
void npg_levels_add(npg_levels *levels, npg_level level);

#endif
