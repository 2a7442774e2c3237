/* Fit levels: a hierarchy of grids and the grid over normal directions. */
#include <math.h>

#include "optimize/grids/fit.h"

#define NORMAL_NODES 4 /* per axis of the grid over directions (published code) */

void npg_fit_levels(npg_levels *levels, const npg_grid_settings *s)
{
    for (int64_t l = 0; l < s->grid_levels; l++)
        npg_levels_add(levels, (npg_level){.kind = NPG_LEVEL_POSITION,
                                           .nodes = (int)(s->grid_base + l * s->grid_step),
                                           .channel_end = (int)s->position_channels,
                                           .share = 1.0 / (double)s->grid_levels,
                                           .lambda = s->lambda * pow(s->lambda_growth, (double)l),
                                           .rate = s->grid_rate * pow(s->grid_rate_growth, (double)l)});
    if (!s->normal_channels) return;
    npg_levels_add(levels, (npg_level){.kind = NPG_LEVEL_NORMAL,
                                       .nodes = NORMAL_NODES,
                                       .channel_first = (int)s->position_channels,
                                       .channel_end = (int)(s->position_channels + s->normal_channels),
                                       .share = 1,
                                       .lambda = s->lambda,
                                       .rate = s->grid_rate});
}
