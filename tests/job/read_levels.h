/* Latent grids, read as another program reads them. */
#ifndef NPG_TEST_READ_LEVELS_H
#define NPG_TEST_READ_LEVELS_H

#include <stdbool.h>

#include "kernels/levels.h"

/* Into rows; false when a grid has not as many values as its level nodes.  Grids that are missing throw. */
bool read_levels(const char *path, const npg_levels *levels, float *rows);

#endif
