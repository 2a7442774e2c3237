/* Segments: a capture whose topology changes, as several runs with a reference each
 * (neupig run --segments auto).
 *
 * The first run is that of the whole capture, in OUT itself.  Where its alarm goes off (stages/evaluate/alarm.c)
 * it ends; the frames on the keyframe's side are solved again with the same keyframe, the others become a
 * segment with its own keyframe, and so on until every segment explains its frames.  The newer segment
 * also solves the --overlap frames before the cut that its neighbour explains ("shared" in its
 * frames.jsonl).
 *
 *     OUT/segment_<number>/       a job like any other; the number is that of its first own frame
 *     OUT/segments.json           the segments, why and where they were cut; from which it is resumed; at the
 *                                 end also their overlaps and "status"
 *     OUT/done.json               last of all
 *
 * A capture that one reference explains leaves what a run without --segments leaves, and segments.json. */
#ifndef NPG_SEGMENTS_H
#define NPG_SEGMENTS_H

#include <jansson.h>

#include "ingest/ingest.h"
#include "pipeline/memory.h"
#include "pipeline/options.h"
#include "tools/progress.h"

enum { NPG_SEGMENTS_ONE, NPG_SEGMENTS_AUTO }; /* the words of --segments */

/* The whole work.  NPG_USAGE for live sources, and where OUT holds the segments of something else. */
npg_status npg_segments_run(const npg_options *options, npg_reporter *reporter);

/* Before neupig append or apply (the verb) takes a folder for that of one run.
 * NPG_USAGE: it holds several segments (the message names them), or is one of several and `is_alone`
 * (frames that came later belong to all). */
npg_status npg_segments_refuse(const char *folder, const char *verb, bool is_alone);

/* After neupig append has continued OUT: a list of one segment that is not of all frames any more goes. */
npg_status npg_segments_drop_outdated(const char *output);

/* Before a run without --segments: OUT must not hold segments, unless the run is to restart; then they go. */
npg_status npg_segments_require_none(const npg_options *options);

/* ---- between the files of segments ---- */

typedef struct npg_segment {
    int64_t first, last;               /* its own frames, places in the selection, both inclusive */
    int64_t shared_first, shared_last; /* frames before and after them that it solves as well     */
    int64_t keyframe;                  /* number of the frame that must be the keyframe, -1: any  */
    char folder[40];                   /* in OUT; "." for OUT itself                              */
    bool is_partial;                   /* done with frames skipped, unexplained or below the bar  */
    json_t *alarm;                     /* what cut it off from its neighbour, or NULL; owned      */
} npg_segment;

typedef struct npg_segments {
    const char *output, *selection; /* loans */
    npg_frame_files *frames;        /* all that are selected; owned */
    npg_segment *list;              /* in time order; owned */
    size_t count, capacity;
} npg_segments;

void npg_segments_clear(npg_segments *s);

/* The folder's path (of NPG_PATH_SIZE). */
npg_status npg_segment_path(char *path, const npg_segments *s, const npg_segment *segment);

int64_t npg_segment_number(const npg_segments *s, int64_t place);

/* Put a segment in at a place of the list. */
npg_status npg_segments_insert(npg_segments *s, size_t at, const npg_segment *segment);

/* Name it by its first frame. */
void npg_segment_name(npg_segment *segment, const npg_segments *s);

/* The list as an earlier run left it; count 0: there was none.  NPG_USAGE: it is of other frames. */
npg_status npg_segments_load(npg_segments *s);
npg_status npg_segments_save(const npg_segments *s);

/* Whether OUT was done by a run without segments, which raised an alarm and continued. */
bool npg_segments_was_alarmed(const npg_segments *s);

/* Remove what is in OUT of the segments that were loaded, and their lists. */
npg_status npg_segments_remove(const npg_segments *s);

/* Remove a segment's results and its job. */
npg_status npg_segment_remove(const npg_segments *s, const npg_segment *segment);

/* The last OUT/segments.json, and with several segments OUT/done.json. */
npg_status npg_segments_conclude(const npg_segments *s, bool is_partial);

#endif
