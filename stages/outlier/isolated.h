/* Isolated: drops frames' isolated points, and keeps which they were for the later passes that bring the
 * same frame again: the statistical filter is the costliest part of cleaning, and its answer does not
 * change. */
#ifndef NPG_ISOLATED_H
#define NPG_ISOLATED_H

#include "pipeline/chunk.h"

typedef struct npg_isolated npg_isolated;

/* What is kept takes byte_max at most; frames beyond that are filtered in every pass. */
npg_status npg_isolated_open(npg_isolated **isolated, size_t byte_max);
void npg_isolated_close(npg_isolated **isolated);

/* Drop the isolated points of frames that have been cleaned of all else (cleaning.h), several at a time in
 * threads; skipped and empty frames are left alone.  A frame is known by its index and the hash of its
 * points.  NPG_MEMORY; errors name the frame. */
npg_status npg_isolated_drop(npg_isolated *isolated, npg_frame *const *frames, size_t count, int neighbours,
                             double ratio);

#endif
