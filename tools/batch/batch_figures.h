/* Figures of a capture that is done: how far its points are from the surface, frame by frame. */
#ifndef NPG_BATCH_FIGURES_H
#define NPG_BATCH_FIGURES_H

#include <jansson.h>

#include "tools/batch/batch.h"

typedef struct npg_frame_figures {
    int64_t number;
    double error; /* median distance of the points to the surface, per cent of the diagonal; NaN: none */
    bool good, skipped;
    char *file, *source; /* mesh (seen from the capture's output) and input; owned, NULL: none */
} npg_frame_figures;

typedef struct npg_capture_figures {
    npg_frame_figures *frames; /* in time order, owned */
    size_t count, capacity, good, skipped;
    size_t worst;     /* the frame with the largest error; count: none         */
    double mean, bar; /* mean error; what the error of a good frame is at most */
    json_t *segments; /* as npg_batch_segments() has them, or NULL; owned      */
} npg_capture_figures;

/* Read OUT/<name>/frames.jsonl, or of several segments theirs, each frame once.  No frames where there is no
 * such file: the capture is not done.  NPG_BAD_INPUT: the file is damaged. */
npg_status npg_figures_read(npg_capture_figures *figures, const npg_capture *capture);
void npg_figures_clear(npg_capture_figures *figures);

#endif
