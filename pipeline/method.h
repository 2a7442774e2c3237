/* Methods: what the option "method" takes beside the names of npg_presets. */
#ifndef NPG_METHOD_H
#define NPG_METHOD_H

#include "pipeline/status.h"

struct json_t;

/* Set options from a JSON object as text, or from a file of one.  The object holds options by their names
 * ("preset" is the method that they are added to), or is a configuration of the paper's published code, known
 * by its sections "optimization", "grid" and "mlp": that chooses the method "paper" and sets what has a
 * counterpart; npg_options_ignored() then says what has none.  NPG_USAGE names place and cause. */
npg_status npg_method_set(npg_options *options, const char *value);

/* The same for an object that was read; errors name it as `place`. */
npg_status npg_method_apply(npg_options *options, const struct json_t *object, const char *place);

#endif
