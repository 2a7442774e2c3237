/* Chain: the order of the data's way.  The program's table of contents. */
#include "stage.h"

const npg_stage *const npg_chain[] = {NULL};

const npg_preset npg_presets[] = {{NULL, NULL, NULL}};
