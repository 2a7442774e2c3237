/* Tuning: the sets, and how they reach the kernels. */
#include "kernels/runtime/tuning.h"

#include <stdio.h>
#include <string.h>

/* clang-format off */
/* mlp:                                         rows   vector  tile     tile rows   local groups  nearest   frame
 *                                                             vectors  rows grad head            queries   local span local */
const npg_tuning npg_tuning_wide   = {"wide",   192,   16,     2,       12,  8,   12,  1,   2,    64,       1,    16,  1};
/* 16 registers of 8 floats: 6 x 2 sums, 2 vectors of weights, one value. */
const npg_tuning npg_tuning_narrow = {"narrow", 192,   8,      2,       6,   4,   6,   1,   2,    64,       1,    16,  1};
/* 128 items side by side in one row of 512 columns, loads of neighbours adjacent; small blocks give many groups. */
const npg_tuning npg_tuning_gpu    = {"gpu",    64,    4,      1,       8,   8,   1,   128, 2,    1,        128,  1,   64};
/* clang-format on */

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
