/* Fit levels: which latent grids a fit has, from its settings (paper, latent grids). */
#ifndef NPG_FIT_LEVELS_H
#define NPG_FIT_LEVELS_H

#include "kernels/levels.h"
#include "optimize/fit.h"

/* levels: all zero before. */
void npg_fit_levels(npg_levels *levels, const npg_fit_settings *settings);

#endif
