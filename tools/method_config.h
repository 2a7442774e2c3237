/* Method configurations of the paper's published code, as options of a run. */
#ifndef NPG_METHOD_CONFIG_H
#define NPG_METHOD_CONFIG_H

#include "pipeline/status.h"

/* Read options from a JSON file of either kind: our own ({"epochs": 250}), or a method configuration of the
 * published code, which is known by its sections "optimization", "grid" and "mlp".  The latter chooses the
 * preset "paper" and then sets what has a counterpart; keys and words that have none are named in one warning
 * on standard error.  NPG_USAGE names file and place. */
npg_status npg_config_load(npg_options *options, const char *path);

#endif
