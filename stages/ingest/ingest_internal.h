/* Ingest, inside: what its files offer each other; those of a rig have rig/rig_internal.h. */
#ifndef NPG_INGEST_INTERNAL_H
#define NPG_INGEST_INTERNAL_H

#include "ingest/ingest.h"
#include "pipeline/file.h"
#include "pipeline/source.h"

/* Formats, inside: what each reader file offers to reader.c, and what they read into.
 *
 * All read from where the source stands into an empty builder, whose wants_faces and may_be_points they heed; what
 * they leave in it on failure is the caller's to clear. */

typedef enum npg_ply_format { NPG_PLY_ASCII, NPG_PLY_LITTLE, NPG_PLY_BIG } npg_ply_format;

typedef enum npg_ply_type {
    NPG_PLY_INT8,
    NPG_PLY_UINT8,
    NPG_PLY_INT16,
    NPG_PLY_UINT16,
    NPG_PLY_INT32,
    NPG_PLY_UINT32,
    NPG_PLY_FLOAT,
    NPG_PLY_DOUBLE
} npg_ply_type;

/* What a number of a point or vertex can mean. */
enum {
    NPG_X,
    NPG_Y,
    NPG_Z,
    NPG_NX,
    NPG_NY,
    NPG_NZ,
    NPG_RED,
    NPG_GREEN,
    NPG_BLUE,
    NPG_ALPHA,
    NPG_U,
    NPG_V,
    NPG_SLOTS
};

/* The one that a file's header calls so, -1 for none. */
int npg_slot_of(const char *name);

typedef struct npg_builder {
    npg_origin *origin; /* loan */
    npg_purpose purpose;
    bool wants_faces;   /* a mesh: faces and texture coordinates, too */
    bool may_be_points; /* faces are not asked for */
    bool has_normals, has_colours, has_uvs;
    size_t vert_count, face_count, vert_capacity, face_capacity;
    size_t finite_count,
        far_count; /* of the points: as they stand in the file; farther off than any box reaches */
    float *pos, *normals, *uvs; /* owned */
    uint8_t *colours;           /* owned */
    float *corner_uvs;          /* F x 3 x 2 or NULL, owned */
    uint32_t *faces;            /* owned */
} npg_builder;

typedef npg_status npg_format_read(npg_builder *builder, npg_source *source);

/* One PLY with all its elements, or one NPY array.  NPG_END when the source has no byte left; what follows the end
 * is left there. */
npg_format_read npg_ply_read, npg_npy_read;

npg_format_read npg_obj_read, npg_pcd_read, npg_xyz_read;

/* The ending that most of the names have, of those that readers know but `but` (or NULL); how many have it.  Names are
 * texts, or stand first in structs of `size` bytes. */
const char *npg_ending_of_most(size_t *most, const void *names, size_t count, size_t size, const char *but);

/* The format a name's ending stands for ("ply", "xyz", ...), NULL for none; the file is not read. */
const char *npg_format_by_ending(const char *path);

/* Room for that many more vertices and triangles.  NPG_MEMORY. */
npg_status npg_builder_reserve(npg_builder *builder, size_t vertices, size_t triangles);

/* Add one vertex, for which room must have been reserved; returns its number.  Positions are those of the world, a
 * normal has any length (without a direction, zero or not finite, it becomes (0, 0, 0)), colours go to 255. */
size_t npg_builder_add(npg_builder *builder, const double values[NPG_SLOTS]);

/* A polygon as a fan around its first corner; takes room itself.  NPG_MEMORY. */
npg_status npg_builder_polygon(npg_builder *builder, const uint32_t *corners, size_t corner_count);

/* The points into an empty frame, or the mesh; it then owns the builder's arrays.  NPG_BAD_INPUT (beginning with
 * `name`) without faces (unless may_be_points) or when a face uses a vertex that is not there. */
void npg_builder_frame(npg_frame *frame, npg_builder *builder);
npg_status npg_builder_mesh(npg_mesh **mesh, npg_builder *builder, const char *name);
void npg_builder_clear(npg_builder *builder);

/* world -> local, one point; the first finite one becomes the origin. */
void npg_local_of(float local[3], npg_origin *origin, const double world[3]);

/* Move the origin to the median of the points when it lies so far from them that float can't tell them apart
 * well; true when it moved (the points must then be read again). */
bool npg_origin_improve(npg_origin *origin, const float *pos_local, size_t point_count);

/* Unit length, (0, 0, 0) where there is no direction. */
void npg_unit_normal(float out[3], const double normal[3]);

/* ---- binary rows ---- */

size_t npg_ply_type_size(npg_ply_type type);

/* A value of a binary row; and a colour's, 0 to 255, of one that its type has from 0 to its largest or to 1. */
double npg_ply_value(const unsigned char *bytes, npg_ply_type type, npg_ply_format format);
double npg_colour_value(double value, npg_ply_type type);

/* Where the values of a point lie: the first one's, and from one to the next. */
typedef struct npg_column {
    bool is_there;
    npg_ply_type type;
    size_t offset, step;
} npg_column;

typedef struct npg_columns {
    npg_column of[NPG_SLOTS];
    npg_ply_format format;
} npg_columns;

/* Add rows that are at hand, for which room must have been reserved. */
void npg_rows_add(npg_builder *builder, const npg_columns *columns, const unsigned char *data, size_t count);

/* Read rows of row_size bytes; *done of them.  NPG_END: the source ended before the last. */
npg_status npg_rows_read(npg_builder *builder, npg_source *source, const npg_columns *columns, uint64_t count,
                         size_t row_size, uint64_t *done);

/* The number of every path: the last run of digits (the ending aside) that grows from each
 * path to the next.  *is_numbered is false where there is none; the numbers are then 0, 1, 2 ...
 * One path alone is numbered by the last run of its file name.  is_sorted: NPG_BAD_INPUT when two neighbours
 * differ only in leading zeros. */
npg_status npg_number_paths(int64_t *numbers, bool *is_numbered, char *const *paths, size_t count,
                            bool is_sorted);

/* The value of the run of digits that stands `from_end` runs before the last one of a path, its ending aside;
 * -1 where there is none or it is too long for a number.  *run_count, or NULL: how many runs there are. */
int64_t npg_name_number(const char *path, size_t from_end, size_t *run_count);

/* The largest number that divides both, for the step of a numbering; the other one when one is 0. */
int64_t npg_common_divisor(int64_t a, int64_t b);

/* The files that a folder, pattern, glob, list or single path stands for, in time order, at least one. */
npg_status npg_paths_find(npg_listing *out, const char *input);

/* Capture: the frames of a capture in files, readable in any order, with a store of what was read. */

/* What to do about numbers that no file has. */
typedef enum npg_missing {
    NPG_MISSING_ERROR, /* refuse the capture                                    */
    NPG_MISSING_SKIP,  /* a frame without points, is_skipped                    */
    NPG_MISSING_HOLD,  /* the points of the frame before it (or after), is_held */
    NPG_MISSING_IGNORE /* numbers mean nothing: frames follow each other        */
} npg_missing;

typedef struct npg_capture {
    npg_arena arena;       /* of its arrays */
    npg_frame_files *list; /* owned */
    npg_missing missing;
    bool keep_going;
    uint8_t *is_bad;        /* per slot: could not be read */
    uint64_t *hashes;       /* per slot, 0: not known yet  */
    npg_frame_store *store; /* of what was read; a loan    */
    uint64_t reads;         /* files parsed so far         */
} npg_capture;

/* Over a list that is at hand; takes it.  NPG_BAD_INPUT with the numbers of the gaps under
 * NPG_MISSING_ERROR; input is for messages. */
npg_status npg_capture_open(npg_capture **capture, npg_frame_files **list, const char *input,
                            npg_missing missing, bool keep_going, npg_frame_store *store);
void npg_capture_close(npg_capture **capture);

/* Frame `index` (0 <= index < list->count) into the empty *frame.  NPG_USAGE where its file is not the one that it
 * was before (hashes), keep_going or not.  NPG_PARTIAL: with keep_going, a file that
 * can't be used for the first time; the frame is_skipped and npg_error_text() says why.  is_last_use: the
 * store may give its copy away.  frame->fields has NPG_FIELD_CLEAN where the store has it clean. */
npg_status npg_capture_read(npg_capture *capture, npg_frame *frame, int64_t index, npg_origin *origin,
                            bool is_last_use);

/* Follow: the frames of a folder that grows, in natural order, each as soon as its file is complete.
 *
 * A file is taken when its reader succeeds and it was the same in two scans a quarter of a second apart.  Where the numbers in the names
 * leave one out, up to NPG_FOLLOW_LATE later files wait for it; then it counts as missing.  A file that its
 * reader refuses, that a later one follows and that has not changed for settle_s is broken.  The source ends
 * when the end file is in the folder and every file has been taken, or when nothing changed for idle_s while
 * the run waited.  Time is the monotonic clock's: setting the system's clock changes nothing.
 *
 * Memory: the names of the files that are there and were not taken yet.  One thread. */

enum { NPG_FOLLOW_LATE = 8 }; /* set by trial */

typedef struct npg_follow_settings {
    const char *where;    /* a folder, or <folder>/<pattern of names>                  */
    bool confine;         /* a file that leads out of the folder is refused            */
    const char *end_name; /* a file of this name ends the source; "": none does        */
    double idle_s;        /* seconds without any change that end it; 0: none           */
    double settle_s;      /* seconds without a change after which a bad file stays bad */
    bool finds_gaps;      /* wait for numbers that are left out                        */
    bool (*stopping)(void *user);
    void *user;
} npg_follow_settings;

typedef struct npg_follow npg_follow;

/* NPG_BAD_INPUT: no such folder. */
npg_status npg_follow_open(npg_follow **follow, const npg_follow_settings *settings);
void npg_follow_close(npg_follow **follow);

/* A file that an earlier run has taken, in their order: the next frame is one behind it in natural order.  digits:
 * npg_follow_facts of that run.  NPG_MEMORY. */
npg_status npg_follow_pass(npg_follow *follow, const char *name, size_t digits, int64_t number);

/* Files that are there now and were not taken. */
npg_status npg_follow_count_new(npg_follow *follow, size_t *count);

/* The next frame into the empty *frame, with its number, waiting for it.  NPG_PARTIAL: its file is broken:
 * the frame has number and path but no points, and npg_error_text() says why.  NPG_END, NPG_STOPPED;
 * NPG_BAD_INPUT when the numbers in the names don't grow. */
npg_status npg_follow_next(npg_follow *follow, npg_frame *frame, npg_origin *origin);

typedef struct npg_follow_facts {
    size_t digits; /* which run of digits in the names is the number, counted from the end               */
    int64_t step;  /* by what numbers grow, 0 while one frame came; it can only get smaller              */
    size_t
        late_count; /* files that were found after a later one had been taken, and are left out           */
} npg_follow_facts;

const npg_follow_facts *npg_follow_facts_of(const npg_follow *follow);

/* Live source: frames from standard input, from a folder that grows, or from those that are pushed, each as
 * soon as it is there, with the numbers that are left out between them.
 *
 * What comes goes to the spool, in order; from then on it is a capture like one in files, which passes
 * read in any order, from the cache of what was read and cleaned or from the spool.  The measuring
 * pass walks the first frames, the look-ahead, and waits for one more: whether there is one decides whether the
 * source goes on.  In the solving pass it does, behind the look-ahead; meanwhile a folder, a pipe or npg_run_push()
 * hold back what comes.
 *
 * A run that is resumed has in the spool all that came, compares what comes again (files of the folder, what is
 * piped or pushed), and goes on behind it.  A source that had ended ends there again.
 *
 * Threads: that of stage ingest. */

typedef struct npg_live_settings {
    const char *frames, *follow_end;
    double follow_idle_s, follow_settle_s;
    int missing;        /* npg_missing */
    int64_t look_ahead; /* without a job more is not kept */
} npg_live_settings;

typedef struct npg_live_source npg_live_source;

/* For the whole run; the store is a loan.  NPG_USAGE, NPG_BAD_INPUT. */
npg_status npg_live_source_open(npg_live_source **live, npg_worker *worker, const npg_live_settings *settings,
                                npg_frame_store *store);
void npg_live_source_close(npg_live_source **live);

/* Frame `index` into *frame: any of the look-ahead, with is_last_use only once more; in the measuring pass and
 * behind the look-ahead in the solving one also the next that comes.  NPG_END: there is none with this index;
 * once a source has ended facts.frame_count says how many there are.  NPG_STOPPED, or what can't be read. */
npg_status npg_live_source_read(npg_live_source *live, npg_frame *frame, int64_t index, bool is_last_use);

/* When a pass has read its frames.  NPG_END: of the measuring one facts.planned_count is set, the look-ahead or as many
 * as there are; of the solving one the source has ended. */
npg_status npg_live_source_end(npg_live_source *live);

/* Probe: what a capture holds, frame by frame and as a whole, and what a run of it would take. */

typedef struct npg_probe {
    npg_capture_facts *facts; /* what is counted; a loan */
    int64_t *counts;          /* points of every readable frame, owned */
    size_t count_room, zero_normals;
    npg_origin origin;
    npg_bounds bounds; /* local, of finite points */
    npg_bounds last;   /* of the last frame with points */
    double read_s;
    json_t *formats, *attention, *per_frame; /* owned */
    char first_fault[1024];
} npg_probe;

/* Add to the list under "attention": what a run would stumble over, or the user should know. */
void npg_probe_warn(npg_probe *probe, const char *format, ...) NPG_PRINTF(2, 3);

/* Read all frames of a list, or of standard input. */
npg_status npg_probe_files(npg_probe *probe, const npg_frame_files *list);
npg_status npg_probe_stream(npg_probe *probe);

/* When all have been read: what only shows then, and what a run with these options would take. */
void npg_probe_finish(npg_probe *probe, const npg_options *options);

#endif
