/* Ingest stage. */
#ifndef NPG_INGEST_H
#define NPG_INGEST_H

#include "pipeline/stage.h"

extern const npg_stage npg_stage_ingest;

#endif
