/* Ingest, inside: what its files offer each other; those of a rig have rig/rig_internal.h. */
#ifndef NPG_INGEST_INTERNAL_H
#define NPG_INGEST_INTERNAL_H

#include "ingest/ingest.h"
#include "pipeline/source.h"

/* Formats, inside: what each reader file offers to reader.c, and what they read into.
 *
 * All read from where the source stands; they fill frame->pos_local, normals, colours and point_count alone, and leave
 * half-read arrays to the caller on failure. */

/* One PLY with all its elements.  NPG_END when the source has no byte left; what follows the last element is
 * left there.  may_be_points: a mesh may be without faces. */
npg_status npg_ply_read_cloud(npg_frame *frame, npg_source *source, npg_origin *origin);
npg_status npg_ply_read_mesh(npg_mesh **mesh, npg_source *source, npg_origin *origin, bool may_be_points);

npg_status npg_obj_read_cloud(npg_frame *frame, npg_source *source, npg_origin *origin);
npg_status npg_obj_read_mesh(npg_mesh **mesh, npg_source *source, npg_origin *origin, bool may_be_points);

/* wants_normals: columns 4 to 6 are normals whatever their length (.xyzn). */
npg_status npg_xyz_read_cloud(npg_frame *frame, npg_source *source, npg_origin *origin, bool wants_normals);

/* One NPY array; NPG_END and the rest as for PLY. */
npg_status npg_npy_read_cloud(npg_frame *frame, npg_source *source, npg_origin *origin);

npg_status npg_pcd_read_cloud(npg_frame *frame, npg_source *source, npg_origin *origin);

/* The format a name's ending stands for ("ply", "xyz", ...), NULL for none; the file is not read. */
const char *npg_format_by_ending(const char *path);

/* ---- what the elements of a PLY file are made of ---- */

enum { NPG_PLY_ELEMENTS = 16, NPG_PLY_PROPERTIES = 128, NPG_PLY_NAME = 64 };

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

typedef struct npg_ply_property {
    char name[NPG_PLY_NAME];
    npg_ply_type type; /* of the value, or of a list's items */
    bool is_list;
    npg_ply_type count_type; /* lists only                                        */
    size_t offset;           /* in the row; meaningful where no list is before it */
} npg_ply_property;

typedef struct npg_ply_element {
    char name[NPG_PLY_NAME];
    uint64_t count;
    bool has_lists;
    size_t row_size; /* bytes of a binary row, lists counted as their bare length */
    size_t property_count;
    npg_ply_property properties[NPG_PLY_PROPERTIES];
} npg_ply_element;

typedef struct npg_ply_header {
    npg_ply_format format;
    size_t element_count;
    npg_ply_element elements[NPG_PLY_ELEMENTS];
} npg_ply_header;

/* Read and check the header; the source then stands at the body.  Counts are compared with the bytes that
 * follow where these are known.  NPG_END when the source is at its end before the first byte. */
npg_status npg_ply_header_read(npg_ply_header *header, npg_source *source);

size_t npg_ply_type_size(npg_ply_type type);

/* A value of a binary row. */
double npg_ply_value(const unsigned char *bytes, npg_ply_type type, npg_ply_format format);

/* ---- point list: rows that go straight into a frame's arrays ---- */

typedef struct npg_point_list {
    npg_frame *frame;   /* loan; its arrays grow */
    npg_origin *origin; /* loan */
    size_t pos_capacity, normal_capacity, colour_capacity;
    bool has_normals, has_colours;
} npg_point_list;

/* Room for `more` further points beyond those that are there.  NPG_MEMORY. */
npg_status npg_points_reserve(npg_point_list *list, size_t more);

/* Add one point, world coordinates; normal (any length) is used when has_normals.  A normal without a
 * direction (zero or not finite) becomes (0, 0, 0).  Room must have been reserved. */
void npg_points_add(npg_point_list *list, const double world[3], const double normal[3]);

/* The colour of the point that npg_points_add() added last; with has_colours every point has one. */
static inline void npg_points_colour(npg_point_list *list, const uint8_t rgba[4])
{
    uint8_t *to = list->frame->colours + 4 * (list->frame->point_count - 1);
    for (int c = 0; c < 4; c++) to[c] = rgba[c];
}

/* world -> local, one point; the first finite one becomes the origin. */
void npg_local_of(float local[3], npg_origin *origin, const double world[3]);

/* Move the origin to the median of the points when it lies so far from them that float can't tell them apart
 * well; true when it moved (the points must then be read again). */
bool npg_origin_improve(npg_origin *origin, const float *pos_local, size_t point_count);

/* Unit length, (0, 0, 0) where there is no direction. */
void npg_unit_normal(float out[3], const double normal[3]);

/* ---- mesh builder: what a reader collects a mesh in ---- */

typedef struct npg_mesh_builder {
    npg_origin *origin; /* loan */
    bool may_be_points; /* faces are not asked for */
    bool has_normals, has_colours, has_uvs;
    size_t vert_count, face_count;
    size_t pos_capacity, normal_capacity, colour_capacity, uv_capacity, face_capacity;
    float *vert_pos, *vert_normals, *vert_uvs; /* owned */
    uint8_t *vert_colours;                     /* owned */
    float *corner_uvs;                         /* F x 3 x 2 or NULL, owned */
    uint32_t *faces;                           /* owned */
} npg_mesh_builder;

/* Room for that many more vertices and triangles.  NPG_MEMORY. */
npg_status npg_builder_reserve(npg_mesh_builder *builder, size_t vertices, size_t triangles);

/* The next vertex, world coordinates, all else 0; room must have been reserved.  Returns its number. */
size_t npg_builder_vertex(npg_mesh_builder *builder, const double world[3]);

/* A polygon as a fan around its first corner; takes room itself.  NPG_MEMORY. */
npg_status npg_builder_polygon(npg_mesh_builder *builder, const uint32_t *corners, size_t corner_count);

/* The mesh, which then owns the builder's arrays.  NPG_BAD_INPUT (beginning with `name`) without faces
 * (unless may_be_points) or when a face uses a vertex that is not there. */
npg_status npg_builder_finish(npg_mesh **mesh, npg_mesh_builder *builder, const char *name);
void npg_builder_clear(npg_mesh_builder *builder);

/* Frame names: the frame number inside a file's name. */

/* The number of every path: the last run of digits (the ending aside) that grows from each
 * path to the next.  *is_numbered is false where there is none; the numbers are then 0, 1, 2 ...
 * One path alone is numbered by the last run of its file name.  is_sorted: NPG_BAD_INPUT when two neighbours
 * differ only in leading zeros. */
npg_status npg_number_paths(int64_t *numbers, bool *is_numbered, char *const *paths, size_t count,
                            bool is_sorted);

/* The value of the run of digits that stands `from_end` runs before the last one of a name, its ending aside;
 * -1 where there is none or it is too long for a number. */
int64_t npg_name_number(const char *name, size_t from_end);

/* The largest number that divides both, for the step of a numbering; the other one when one is 0. */
int64_t npg_common_divisor(int64_t a, int64_t b);

/* Frame inputs: the files that a folder, pattern, glob, list or single path stands for. */

typedef struct npg_paths {
    npg_arena *arena; /* a loan, set before anything else: what paths and numbers are of */
    char **paths;
    int64_t *numbers; /* NULL unless the input itself says the numbers (a pattern) */
    size_t count, capacity;
    size_t left_out; /* see npg_frame_files                     */
    bool is_listed;  /* in the order of a list file, not sorted */
} npg_paths;

/* In time order, at least one.  See npg_frame_files_open. */
npg_status npg_paths_find(npg_paths *out, const char *input);

/* The files of a folder with one of these endings, whatever its case, in natural order. */
npg_status npg_paths_list(npg_paths *out, const char *folder, const char *const *endings);

/* Capture: the frames of a capture in files, readable in any order, with a store of what was read. */

/* What to do about numbers that no file has. */
typedef enum npg_missing {
    NPG_MISSING_ERROR, /* refuse the capture                                    */
    NPG_MISSING_SKIP,  /* a frame without points, is_skipped                    */
    NPG_MISSING_HOLD,  /* the points of the frame before it (or after), is_held */
    NPG_MISSING_IGNORE /* numbers mean nothing: frames follow each other        */
} npg_missing;

typedef struct npg_capture {
    npg_frame_files *list; /* owned */
    npg_missing missing;
    bool keep_going;
    uint8_t *is_bad;        /* per slot: could not be read; owned */
    npg_frame_store *store; /* of what was read; owned            */
    uint64_t reads;         /* files parsed so far                */
} npg_capture;

/* Over a list that is at hand; takes it.  NPG_BAD_INPUT with the numbers of the gaps under
 * NPG_MISSING_ERROR; input is for messages.  What was read is kept in cache_limit bytes, and beyond that in
 * spill_folder. */
npg_status npg_capture_open_list(npg_capture **capture, npg_frame_files **list, const char *input,
                                 npg_missing missing, bool keep_going, size_t cache_limit,
                                 const char *spill_folder);

/* Over the list of an input that is no rig. */
npg_status npg_capture_open(npg_capture **capture, const char *input, const char *selection,
                            npg_missing missing, bool keep_going, size_t cache_limit,
                            const char *spill_folder);
void npg_capture_close(npg_capture **capture);

/* Frame `index` (0 <= index < list->count) into the empty *frame.  NPG_PARTIAL: with keep_going, a file that
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

/* Where an earlier run was: the next frame is one behind these in natural order. */
typedef struct npg_follow_place {
    const char *last; /* name of the file that was taken last                     */
    size_t digits;    /* npg_follow_digits() of the run                           */
    int64_t number;   /* of the last file, and by what the numbers grew until it  */
    int64_t step;
    size_t taken_count; /* files taken                                              */
} npg_follow_place;

/* Before the first frame.  NPG_MEMORY. */
npg_status npg_follow_resume(npg_follow *follow, const npg_follow_place *place);

/* Path of a file of the folder, to npg_release().  With confine, NPG_BAD_INPUT for one that leads out. */
npg_status npg_follow_path(const npg_follow *follow, char **path, const char *name);

/* Files that are there now and were not taken. */
npg_status npg_follow_count_new(npg_follow *follow, size_t *count);

/* Which run of digits in the names is the number, counted from the end. */
size_t npg_follow_digits(const npg_follow *follow);

/* The next frame into the empty *frame, with its number, waiting for it.  NPG_PARTIAL: its file is broken:
 * the frame has number and path but no points, and npg_error_text() says why.  NPG_END, NPG_STOPPED;
 * NPG_BAD_INPUT when the numbers in the names don't grow. */
npg_status npg_follow_next(npg_follow *follow, npg_frame *frame, npg_origin *origin);

/* By what the numbers grow from frame to frame, 0 while one frame came; it can only get smaller. */
int64_t npg_follow_step(const npg_follow *follow);

/* Files that were found after a later one had been taken, and are left out. */
size_t npg_follow_late_count(const npg_follow *follow);

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
    npg_missing missing;
    int64_t look_ahead; /* without a job more is not kept */
} npg_live_settings;

typedef struct npg_live_source npg_live_source;

/* For the whole run.  Frames that were read and cleaned take cache_bytes, and beyond that a file in spill_folder
 *.  NPG_USAGE, NPG_BAD_INPUT. */
npg_status npg_live_source_open(npg_live_source **live, npg_worker *worker, const npg_live_settings *settings,
                                size_t cache_bytes, const char *spill_folder);
void npg_live_source_close(npg_live_source **live);

/* What was read and cleaned; a loan. */
npg_frame_store *npg_live_source_cache(npg_live_source *live);

/* Frame `index` into *frame: any of the look-ahead, with is_last_use only once more; in the measuring pass and
 * behind the look-ahead in the solving one also the next that comes.  NPG_END: there is none with this index;
 * once a source has ended facts.frame_count says how many there are.  NPG_STOPPED, or what can't be read. */
npg_status npg_live_source_read(npg_live_source *live, npg_frame *frame, int64_t index, bool is_last_use);

/* End of the measuring pass: facts.planned_count, `most` or as many as there are. */
npg_status npg_live_source_plan(npg_live_source *live, int64_t most);

/* Solving pass, when all its frames were read: the source's last word. */
npg_status npg_live_source_end(npg_live_source *live);

#endif
