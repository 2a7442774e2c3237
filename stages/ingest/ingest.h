/* Door of the ingest room: what tools use of it. */
#ifndef NPG_INGEST_H
#define NPG_INGEST_H

#include "ingest/formats/reader.h" /* one cloud or mesh from a file or a stream                    */
#include "ingest/frame_files.h"    /* which files of an input are frames, and the text of --frames */
#include "ingest/frame_names.h"    /* names in natural order                                       */
#include "ingest/input_list.h"     /* the frames that the options of a run name                    */
#include "ingest/probe.h"          /* what a capture holds, and what a run of it would take         */
#include "ingest/rig/rig.h"

#endif
