/* Probe: what a capture holds, frame by frame and as a whole. */
#ifndef NPG_PROBE_FACTS_H
#define NPG_PROBE_FACTS_H

#include <jansson.h>

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "tools/probe/probe_motion.h"

typedef struct npg_probe {
    size_t frames, unreadable, with_normals;
    size_t point_total, not_finite, zero_normals;
    size_t *counts; /* points of every readable frame, owned */
    size_t count_room;
    npg_origin origin;
    npg_bounds bounds; /* local, of finite points */
    npg_bounds last;   /* of the last frame with points */
    uint64_t bytes;
    double read_s;
    json_t *formats, *attention, *per_frame; /* owned */
    char first_fault[1024];
    npg_probe_motion motion;
} npg_probe;

void npg_probe_init(npg_probe *probe);
void npg_probe_uninit(npg_probe *probe);

/* Add to the list under "attention": what a run would stumble over, or the user should know. */
void npg_probe_warn(npg_probe *probe, const char *format, ...) NPG_PRINTF(2, 3);

/* Count a readable frame. */
npg_status npg_probe_add(npg_probe *probe, const npg_frame *frame, const char *format, int64_t number);

/* Count one that could not be read; the text is the failure's. */
void npg_probe_add_fault(npg_probe *probe, int64_t number);

typedef struct npg_probe_spread {
    size_t least, median, most;
} npg_probe_spread;

npg_probe_spread npg_probe_counts(npg_probe *probe);

/* How far limbs go from frame to frame, in diagonals of the figure (probe_motion.h); 0: nothing tells. */
double npg_probe_step(const npg_probe *probe);

#endif
