/* Door of the ingest room: what tools use of it. */
#ifndef NPG_INGEST_H
#define NPG_INGEST_H

#include "ingest/formats/reader.h" /* one cloud or mesh from a file or a stream                    */
#include "ingest/frame_files.h"
#include "ingest/probe.h" /* what a capture holds, and what a run of it would take         */
#include "ingest/rig/rig.h"

#endif
