/* Tuning: the sets, and how they reach the kernels. */
#include "kernels/runtime/tuning.h"

#include <stdio.h>
#include <string.h>

const npg_tuning npg_tuning_wide = {.name = "wide",
                                    .mlp_rows = 192,
                                    .mlp_vector = 16,
                                    .mlp_tile_vectors = 2,
                                    .mlp_tile_rows = 12,
                                    .mlp_grad_rows = 8,
                                    .mlp_head_rows = 12,
                                    .mlp_local = 1,
                                    .mlp_groups = 2,
                                    .nearest_queries = 64,
                                    .frame_local = 1,
                                    .span = 16,
                                    .local = 1};

/* 16 registers of 8 floats: 6 x 2 sums, 2 vectors of weights, one value. */
const npg_tuning npg_tuning_narrow = {.name = "narrow",
                                      .mlp_rows = 192,
                                      .mlp_vector = 8,
                                      .mlp_tile_vectors = 2,
                                      .mlp_tile_rows = 6,
                                      .mlp_grad_rows = 4,
                                      .mlp_head_rows = 6,
                                      .mlp_local = 1,
                                      .mlp_groups = 2,
                                      .nearest_queries = 64,
                                      .frame_local = 1,
                                      .span = 16,
                                      .local = 1};

/* 128 items side by side in one row of 512 columns, loads of neighbours adjacent;
 * small blocks give many groups. */
const npg_tuning npg_tuning_gpu = {.name = "gpu",
                                   .mlp_rows = 64,
                                   .mlp_vector = 4,
                                   .mlp_tile_vectors = 1,
                                   .mlp_tile_rows = 8,
                                   .mlp_grad_rows = 8,
                                   .mlp_head_rows = 1,
                                   .mlp_local = 128,
                                   .mlp_groups = 2,
                                   .nearest_queries = 1,
                                   .frame_local = 128,
                                   .span = 1,
                                   .local = 64};

void npg_tuning_constants(char *out, size_t size, const npg_tuning *t, const char *program)
{
    out[0] = 0;
    if (!strcmp(program, "mlp"))
        snprintf(out, size, "-DROWS=%d -DVW=%d -DNV=%d -DMR=%d -DGR=%d -DHR=%d -DLOCAL=%d -DSPAN=%d",
                 t->mlp_rows, t->mlp_vector, t->mlp_tile_vectors, t->mlp_tile_rows, t->mlp_grad_rows,
                 t->mlp_head_rows, t->mlp_local, t->span);
    if (!strcmp(program, "nearest"))
        snprintf(out, size, "-DQUERIES=%d -DLOCAL=%d", t->nearest_queries, t->frame_local);
    if (!strcmp(program, "chamfer")) snprintf(out, size, "-DLOCAL=%d", t->frame_local);
    if (!strcmp(program, "adam")) snprintf(out, size, "-DSPAN=%d", t->span);
}
