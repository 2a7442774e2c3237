/* Input list: the frames that the options of a run name, those of files or of a rig (ingest.c). */
#ifndef NPG_INPUT_LIST_H
#define NPG_INPUT_LIST_H

#include "ingest/frame_files.h"
#include "pipeline/options.h"

/* The files that the options of a run (input, frames, missing, confine, those of rigs) name as its frames; of
 * a rig the description is read, else nothing.  As npg_frame_files_open_any() and, with confine,
 * npg_frame_files_confine(). */
npg_status npg_capture_list(npg_frame_files **list, const npg_options *options);

/* The same with another selection than option frames says, and with the gaps of that selection. */
npg_status npg_capture_select(npg_frame_files **list, const npg_options *options, const char *selection);

#endif
