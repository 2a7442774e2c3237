/* A chain with an option of every type, for the fuzz targets that read options: the parser is the same, and
 * they need not be linked from all stages. */
#ifndef NPG_FUZZ_CHAIN_H
#define NPG_FUZZ_CHAIN_H

#include "pipeline/options.h"
#include "pipeline/stage.h"

/* clang-format off */
static const npg_option fuzz_options[] = {
    /* type        name         place    default  least  most  shown as or words */
    NPG_ROW_INT   ("whole",     0,       "1",     -5,    1e6,  NULL, ""),
    NPG_ROW_REAL  ("real",      0,       "0.5",   -1e9,  1e9,  NULL, ""),
    NPG_ROW_FLAG  ("flag",      0,       "no", ""),
    NPG_ROW_CHOICE("choice",    0,       "one",   "one|two|three", ""),
    NPG_ROW_TEXT  ("text",      0,       "",      NULL, ""),
    {0}};
/* clang-format on */

static const npg_stage fuzz_stage = {.name = "fuzz", .options = fuzz_options};
const npg_stage *const npg_chain[] = {&fuzz_stage, NULL};

static const npg_preset_value fuzz_paper[] = {{"whole", "7"}, {0}};
const npg_preset npg_presets[] = {{"method", "paper", "", fuzz_paper}, {0}};

#endif
