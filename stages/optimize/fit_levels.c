/* Fit levels: a hierarchy of grids or a hash table, and the grid over normal directions. */
#include "optimize/fit.h"

#include <math.h>

#define HASH_LEVELS 15
#define HASH_ROWS   16384
#define HASH_FIRST  16
#define HASH_GROWTH 1.35

/* The two numbers of a level's smoothing matrix (levels.h). */
static double screen_of(const npg_fit_settings *s, double lambda)
{
    return s->smoothing == NPG_SMOOTHING_SCREENED ? 1 + 6 * lambda : 1;
}

static double degree_of(const npg_fit_settings *s)
{
    return s->smoothing == NPG_SMOOTHING_DOUBLED ? 2 : 1;
}

static void add_grids(npg_levels *levels, const npg_fit_settings *s)
{
    bool single = s->encoding == NPG_ENCODING_SINGLE;
    for (int64_t l = single ? s->grid_levels - 1 : 0; l < s->grid_levels; l++)
        npg_levels_add(levels,
                       (npg_level){.kind = NPG_LEVEL_POSITION,
                                   .nodes = (int)(s->grid_base + l * s->grid_step),
                                   .channel_first = 0,
                                   .channel_end = (int)s->position_channels,
                                   .share = single ? 1.0 : 1.0 / (double)s->grid_levels,
                                   .lambda = s->lambda * pow(s->lambda_growth, (double)l),
                                   .screen = screen_of(s, s->lambda * pow(s->lambda_growth, (double)l)),
                                   .degree = degree_of(s),
                                   .rate = s->grid_rate * pow(s->grid_rate_growth, (double)l)},
                       0);
}

static void add_hash(npg_levels *levels, const npg_fit_settings *s)
{
    for (int l = 0; l < HASH_LEVELS && 2 * l + 2 <= s->position_channels; l++)
        npg_levels_add(levels,
                       (npg_level){.kind = NPG_LEVEL_HASHED,
                                   .nodes = (int)floor(HASH_FIRST * pow(HASH_GROWTH, l)),
                                   .channel_first = 2 * l,
                                   .channel_end = 2 * l + 2,
                                   .share = 1,
                                   .rate = s->grid_rate},
                       HASH_ROWS);
}

void npg_fit_levels(npg_levels *levels, const npg_fit_settings *s)
{
    if (s->encoding == NPG_ENCODING_HASH)
        add_hash(levels, s);
    else
        add_grids(levels, s);
    if (!s->normal_grid) return;
    npg_levels_add(levels,
                   (npg_level){.kind = NPG_LEVEL_NORMAL,
                               .nodes = (int)s->normal_nodes,
                               .channel_first = (int)s->position_channels,
                               .channel_end = (int)(s->position_channels + s->normal_channels),
                               .share = 1,
                               .lambda = s->lambda,
                               .screen = screen_of(s, s->lambda),
                               .degree = degree_of(s),
                               .rate = s->grid_rate},
                   0);
}
