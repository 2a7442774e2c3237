/* Probe: what a capture holds, frame by frame and as a whole, and what a run of it would take. */
#ifndef NPG_PROBE_H
#define NPG_PROBE_H

#include <jansson.h>

#include "ingest/frame_files.h"
#include "pipeline/frame_box.h"

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
} npg_probe;

void npg_probe_init(npg_probe *probe);
void npg_probe_uninit(npg_probe *probe);

/* Add to the list under "attention": what a run would stumble over, or the user should know. */
void npg_probe_warn(npg_probe *probe, const char *format, ...) NPG_PRINTF(2, 3);

/* Count a frame that was read with `status`, and clear it.  Bad data goes into the list; any other failure
 * is returned. */
npg_status npg_probe_count(npg_probe *probe, npg_status status, npg_frame *frame, const char *format,
                           int64_t number);

/* Read all frames of a list. */
npg_status npg_probe_files(npg_probe *probe, const npg_frame_files *list);

/* Add what only shows when all frames have been read. */
void npg_probe_warn_of_all(npg_probe *probe);

typedef struct npg_probe_spread {
    size_t least, median, most;
} npg_probe_spread;

npg_probe_spread npg_probe_counts(npg_probe *probe);

/* What a run with these options would take on this machine's cores, were they as fast as those of the guide's
 * figures; memory: of the process and of Poisson's together. */
typedef struct npg_estimate {
    size_t vertices, window;
    double memory_bytes, disk_bytes, time_s;
} npg_estimate;

npg_estimate npg_probe_estimate(npg_probe *probe, const npg_options *options);

#endif
