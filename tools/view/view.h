/* Page: one HTML file that needs no other, of one result or of two side by side. */
#ifndef NPG_VIEW_H
#define NPG_VIEW_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "export/export.h"
#include "pipeline/frame_box.h"
#include "pipeline/mesh.h"

typedef struct npg_view_order {
    const char *const *paths; /* of results */
    size_t path_count;        /* 1 or 2 */
    const char *output;       /* the page   */
    size_t point_limit;       /* points shown per frame at most */
    int64_t every;            /* frames by index, 1: all */
    bool is_live;             /* the run is at work: the page says how far it is, and loads itself again */
} npg_view_order;

typedef struct npg_view_facts {
    size_t frames, vertices; /* of all results; vertices: the most */
    uint64_t bytes;
    size_t without_points; /* frames */
    char why[512];
} npg_view_facts;

/* Which way is up in a run's results (report.json; NULL: y): as option up says, or as the sensors of a rig stand, whose axes
 * they have. */
npg_up npg_view_up(const json_t *report);

/* The file appears when it is whole.  Failures as npg_view_result_open(), npg_view_group_block(), NPG_DISK.
 * */
npg_status npg_view_page_write(npg_view_facts *facts, const npg_view_order *order);

/* Write the page of a run that is at work, and again where frames have come, until no run holds the folder's
 * lock; then as npg_view_page_write() does. */
npg_status npg_view_follow(npg_view_facts *facts, const npg_view_order *order);

/* ---- between the files of the page: a result as it was read, and its meshes and points as blocks of bytes ---- */

/* Codec of the page's numbers: what changes little from frame to frame and from vertex to vertex takes
 * little.
 *
 * A block is numbers (int32), made small by prediction, then packed:
 *
 *   predict  what is left of v[i] after the rounded mean of the values at lower vertices that share a face
 *            with it: floor((2 sum + n) / (2 n)), each as often as faces have it; without any, after v[i - 1]
 *   pack     zigzag (0, -1, 1, -2 ... become 0, 1, 2, 3 ...), four planes of bytes (all lowest bytes first,
 *            then all second ones ...), zlib
 *
 * All of it is integers, so that the page (web/src/codec.js) has the very same numbers back.  On a dancer of
 * 175 frames and 9971 vertices this takes 62 % of what meshoptimizer's vertex codec takes of the same
 * differences, and the browser brings the decoder. */

/* Bytes that grow; begins zeroed. */
typedef struct npg_bytes {
    uint8_t *data; /* owned: npg_release() */
    size_t size, capacity;
} npg_bytes;

npg_status npg_bytes_add(npg_bytes *bytes, const void *data, size_t size);

/* Of each vertex the lower ones that share a face with it: those of v are of[start[v]] up to, and without,
 * of[start[v + 1]]. */
typedef struct npg_view_links {
    size_t vert_count;
    uint32_t *start, *of; /* V + 1 */
} npg_view_links;

npg_status npg_view_links_open(npg_view_links *links, npg_arena *arena, const npg_mesh *mesh);

/* left[i] for the V values; another array than values. */
void npg_view_predict(const npg_view_links *links, int32_t *left, const int32_t *values);

/* Append packed numbers.  *packed_size, where not NULL, gets the bytes they took.  NPG_MEMORY. */
npg_status npg_view_pack(npg_bytes *out, size_t *packed_size, const int32_t *values, size_t count);

/* The grid that positions are rounded to. */
typedef struct npg_view_grid {
    double origin[3], step;
} npg_view_grid;

#define NPG_VIEW_GRID_MAX (1 << 24) /* numbers on the grid, from 0 */

/* grid = (p - origin) / step, rounded, within 0 .. NPG_VIEW_GRID_MAX.  p: count x 3, finite; out: 3 x count,
 * the x of all points first. */
void npg_view_round(const npg_view_grid *grid, int32_t *out, const float *points, size_t count);

/* Result: what a run has left in its folder, or has so far, as a page shows it. */

typedef struct npg_view_frame {
    int64_t index, number;
    json_t *line;              /* of frames.jsonl; owned                                      */
    const char *file, *source; /* mesh, seen from the part's folder, and points: loans, NULL: none */
} npg_view_frame;

/* What has one reference: a run, or one of its segments. */
typedef struct npg_view_part {
    char *folder, *label;   /* label: "." or the segment's folder        */
    npg_mesh *reference;    /* owned; NULL: not there yet                */
    npg_view_links links;   /* of the reference                          */
    npg_origin origin;      /* of reference.ply                          */
    npg_view_frame *frames; /* in time order                             */
    size_t count, capacity;
    size_t group;                /* frames that are packed together           */
    json_t *report, *done, *job; /* report.json, done.json, job/job.json; owned, NULL: none */
    npg_placement placement;     /* the capture's coordinates to the meshes'  */
    double diagonal;             /* of the figure, in the meshes' unit      */
    double cover_share;          /* points so near cover the surface, in diagonals */
} npg_view_part;

typedef struct npg_view_result {
    npg_arena arena;   /* of all that is not said to be owned */
    char *path, *name; /* name: the folder's own */
    npg_view_part *parts;
    size_t part_count, capacity;
    json_t *segments; /* segments.json, owned; NULL: the run has one reference */
    bool is_done;
} npg_view_result;

/* Read lists and references; every: of the frames only each so many-th (by index), and the keyframe.
 * NPG_USAGE: no folder of a run.  NPG_BAD_INPUT: damaged, or (not may_be_empty) nothing solved yet. */
npg_status npg_view_result_open(npg_view_result *result, const char *path, int64_t every, bool may_be_empty);
void npg_view_result_close(npg_view_result *result);

/* The options it was run with, texts by name; NULL: not known. */
const json_t *npg_view_run_options(const npg_view_part *part);

/* A number, or a text of one, of an object. */
double npg_view_number(const json_t *object, const char *key, double otherwise);

/* What the page knows of it beside meshes and points; a new reference, NULL: no memory (view_facts.c). */
json_t *npg_view_result_json(const npg_view_result *result);

/* Frame: meshes and points of a result as blocks of bytes for the page.
 *
 * A group block (frames that are packed together), little-endian:
 *
 *     f64 origin[3], step        the grid of its positions; points lie on one NPG_VIEW_POINT_STEP times as
 *     wide u32 frames, bytes of positions, of errors, of points
 *     u32 points of each frame, then how many of each, its last ones, the run had dropped
 *     positions                  per frame x of all vertices, then y, z: of the first frame, of later ones
 *                                the change since the one before; predicted and packed
 *     errors                     per frame and vertex 2 e + c, predicted and packed.  c: whether a point is
 *                                near (bars.cover).  e: how far points lie outside the surface there,
 *                                d = ((e - 128) / 127)^2 x NPG_VIEW_ERROR_MAX diagonals, inside it below
 *                                128; 1 and 255 are that or more, 0 is not known
 *     points                     per frame x, then y, z, in the order of a space-filling curve, each as the
 *                                change since the point before; packed
 *
 * A frame without a mesh has the positions of the one before it.
 *
 * A part block, what is the same in all its frames:
 *
 *     u32 vertices, faces
 *     f64 origin[3], step        of the reference
 *     u32 bytes of faces, of the reference, of colours, of the counts
 *     faces                      corners, each as the change since the one before; packed
 *     reference                  as the positions of a first frame
 *     colours                    red of all vertices, then green, blue; predicted and packed; 0 bytes: none
 *     counts                     in how many frames a point covers the vertex; predicted and packed; 0 bytes:
 *                                not known */

#define NPG_VIEW_POINT_STEP 16
#define NPG_VIEW_ERROR_MAX  0.05

/* Works through the frames of a part; to be closed by releasing its arena. */
typedef struct npg_view_frames {
    npg_arena arena;           /* of the arrays */
    const npg_view_part *part; /* loan */
    size_t point_limit;        /* points of a frame that are shown; all are measured from */
    float *vert_pos;           /* V x 3 of the frame at hand                              */
    float *points, *some;      /* N x 3, those that were dropped last, and those shown    */
    size_t point_count, dropped_count, point_capacity, some_capacity;
    double noise_sum; /* of noise_count frames, in the meshes' unit */
    size_t noise_count;
    int32_t *seen;         /* V                                                       */
    size_t without_points; /* frames whose points could not be read                   */
    size_t with_points;
    char why[512]; /* ... why not, of the first                               */
} npg_view_frames;

npg_status npg_view_frames_open(npg_view_frames *frames, const npg_view_part *part, size_t point_limit);

/* Append the block of the frames first .. first + count - 1 of the part.  NPG_BAD_INPUT names a mesh that is
 * damaged or not of the reference. */
npg_status npg_view_group_block(npg_bytes *out, npg_view_frames *frames, size_t first, size_t count);

/* Append the part's block, once all frames have been through npg_view_group_block(). */
npg_status npg_view_part_block(npg_bytes *out, npg_view_frames *frames);

/* Reading of one frame for a page: its mesh, its points, and how far they are from each other. */

/* Fill frames->vert_pos, relative to the part's origin: from the mesh's file; without one it stays. */
npg_status npg_view_read_mesh(npg_view_frames *frames, const npg_view_frame *frame);

/* Fill frames->points and its counts (point_count: of those kept), in the coordinates of the meshes and relative to the part's origin.  None where the
 * file can't be read: noted in `frames`, no failure.  NPG_MEMORY. */
npg_status npg_view_read_points(npg_view_frames *frames, const npg_view_frame *frame);

/* errors (V, as in a block) of the frame at hand, and frames->seen: the signed distances of the points to the
 * surface, each spread over the corners of its face by its weights there and then to their neighbours, as
 * means; a vertex that none fell to takes the mean of its neighbours, if a point is as near as it then should
 * be. */
npg_status npg_view_measure(npg_view_frames *frames, int32_t *errors);

/* Copy at most frames->point_limit of the points to frames->some, in the order of a space-filling curve: of
 * those kept, then of those dropped. */
npg_status npg_view_choose_points(npg_view_frames *frames, size_t *count, size_t *dropped);

#endif
