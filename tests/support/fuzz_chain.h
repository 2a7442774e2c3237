/* A chain with an option of every type, for the fuzz targets that read options: the parser is the same, and
 * they need not be linked from all stages. */
#ifndef NPG_FUZZ_CHAIN_H
#define NPG_FUZZ_CHAIN_H

#include "pipeline/stage.h"

static const npg_option fuzz_options[] = {
    {"whole", "", NPG_OPTION_INT, 0, "1", -5, 1e6, NULL, NULL},
    {"real", "", NPG_OPTION_REAL, 0, "0.5", -1e9, 1e9, NULL, NULL},
    {"flag", "", NPG_OPTION_FLAG, 0, "no", 0, 0, NULL, NULL},
    {"choice", "", NPG_OPTION_CHOICE, 0, "one", 0, 0, "one|two|three", NULL},
    {"text", "", NPG_OPTION_TEXT, 0, "", 0, 0, NULL, NULL},
    {"truth", "", NPG_OPTION_TEXT, 0, "", 0, 0, NULL, NULL},
    {0}};

static const npg_stage fuzz_stage = {.name = "fuzz", .options = fuzz_options};
const npg_stage *const npg_chain[] = {&fuzz_stage, NULL};
const npg_service *const npg_services[] = {NULL};

static const npg_preset_value fuzz_paper[] = {{"whole", "7"}, {0}};
const npg_preset npg_presets[] = {{"paper", "", fuzz_paper}, {0}};

#endif
