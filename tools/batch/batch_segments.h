/* Segments of a capture that was run with segments = auto: what OUT/<name>/segments.json
 * tells (segments.h). */
#ifndef NPG_BATCH_SEGMENTS_H
#define NPG_BATCH_SEGMENTS_H

#include <jansson.h>

#include "tools/batch/batch.h"

/* An array of {folder, first_frame, last_frame, keyframe, status, cause}, in time order; cause: what cut it
 * off, null for none.  A new reference; NULL when the capture is run without segments or has none yet, and
 * when the file is damaged. */
json_t *npg_batch_segments(const npg_capture *capture);

/* Whether a capture of the batch is run with segments. */
bool npg_batch_has_segments(const npg_batch *batch);

/* "2 (from 7)": how many, and with which frames the later ones begin; "" without segments. */
void npg_batch_segments_text(char *text, size_t size, const json_t *segments);

#endif
