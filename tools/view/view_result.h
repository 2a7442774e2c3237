/* Result: what a run has left in its folder, or has so far, as a page shows it. */
#ifndef NPG_VIEW_RESULT_H
#define NPG_VIEW_RESULT_H

#include <jansson.h>

#include "export/export.h"
#include "pipeline/frame_box.h"
#include "tools/view/view_codec.h"

typedef struct npg_view_frame {
    int64_t index, number;
    json_t *line;              /* of frames.jsonl; owned                                      */
    const char *file, *source; /* mesh, seen from the part's folder, and points: loans, NULL: none */
} npg_view_frame;

/* What has one reference: a run, or one of its segments. */
typedef struct npg_view_part {
    char *folder, *label;   /* owned; label: "." or the segment's folder */
    npg_mesh *reference;    /* owned; NULL: not there yet                */
    npg_view_links links;   /* of the reference                          */
    npg_origin origin;      /* of reference.ply                          */
    npg_view_frame *frames; /* in time order, owned                      */
    size_t count, capacity;
    size_t group;                /* frames that are packed together           */
    json_t *report, *done, *job; /* report.json, done.json, job/job.json; owned, NULL: none */
    npg_placement placement;     /* the capture's coordinates to the meshes'  */
    double diagonal;             /* of the figure, in the meshes' unit      */
    double cover_share;          /* points so near cover the surface, in diagonals */
} npg_view_part;

typedef struct npg_view_result {
    char *path, *name; /* owned; name: the folder's own */
    npg_view_part *parts;
    size_t part_count, capacity;
    json_t *segments; /* segments.json, owned; NULL: the run has one reference */
    bool is_done;
} npg_view_result;

/* Read lists and references; every: of the frames only each so many-th (by index), and the keyframe.
 * NPG_USAGE: no folder of a run.  NPG_BAD_INPUT: damaged, or (not may_be_empty) nothing solved yet. */
npg_status npg_view_result_open(npg_view_result *result, const char *path, int64_t every, bool may_be_empty);
void npg_view_result_close(npg_view_result *result);

/* What the page knows of it beside meshes and points; a new reference, NULL: no memory (view_facts.c). */
json_t *npg_view_result_json(const npg_view_result *result);

/* A JSON file of a folder; NULL (and NPG_OK) where it is not there. */
npg_status npg_view_load_json(json_t **out, const char *folder, const char *name);

#endif
