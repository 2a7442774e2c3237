/* Ingest: what other rooms and the tools use of it: readers of one file, the frames of a capture, rigs of depth
 * sensors, the store of frames that were read, the spool of a live source, and what a capture holds. */
#ifndef NPG_INGEST_H
#define NPG_INGEST_H

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/json_file.h"
#include "pipeline/mesh.h"
#include "pipeline/options.h"
#include "pipeline/stage.h"
#include "pipeline/store.h"

/* Readers: clouds and meshes from files and streams.  One .c file per format; this is their common face.
 *
 * Formats by the name's ending, then by content: .ply, .obj, .xyz/.txt/.xyzn/.pts, .npy, .pcd.
 * Positions come out as float relative to an origin (npg_origin) that the first file read settles: its first
 * finite point, or the median of its points where that one lies far off, so that captures far from 0 keep
 * their detail.  Points that are not finite are kept: the outlier stage counts and drops them.  Normals come
 * out with unit length; one without a direction is (0, 0, 0).
 * Failures are NPG_BAD_INPUT (with path, line or byte, and cause), NPG_MEMORY.  Memory while reading a cloud
 * stays below 4 x file size + 1 MiB, whatever the header claims (a compressed PCD: of what it unpacks to).  Threads:
 * different frames may be read at the same time; *origin is written only while it is not known. */

/* Read a cloud into frame->pos_local, normals (where the file has them), point_count,
 * cleaning.read, path and fields; the frame is empty before, and after a failure.
 * A file without points is NPG_OK with point_count 0. */
npg_status npg_read_cloud(npg_frame *frame, const char *path, npg_origin *origin);

/* Read a triangle mesh from PLY or OBJ; polygons are split into fans, normals, colours and UVs per vertex are
 * kept where given.  vert_pos is local.  Indices are checked; a mesh without faces is NPG_BAD_INPUT. */
npg_status npg_read_mesh(npg_mesh **mesh, const char *path, npg_origin *origin);

/* The points of a file, whatever else it holds, as a mesh without faces; normals and colours where the file has
 * them.  NPG_BAD_INPUT where there is no point. */
npg_status npg_read_points(npg_mesh **mesh, const char *path, npg_origin *origin);

/* The same for any of the formats, faces or not: points alone become a mesh with face_count 0.  NPG_BAD_INPUT
 * where there is not even a point.  "rig.json#NUMBER": that frame of a rig, as npg_rig_usual has it. */
npg_status npg_read_shape(npg_mesh **mesh, const char *path, npg_origin *origin);

/* Frames concatenated on a stream (a pipe will do): PLY or NPY files one after the other.  NPG_END at a clean
 * end between two frames; a stream that stops inside a frame is NPG_BAD_INPUT.  stopping(user), or
 * NULL, is asked about four times a second while nothing comes; true makes next return NPG_STOPPED. */
typedef struct npg_stream npg_stream;
npg_status npg_stream_open(npg_stream **stream, int fd, const char *name, bool (*stopping)(void *user),
                           void *user);
npg_status npg_stream_next(npg_stream *stream, npg_frame *frame, npg_origin *origin);
void npg_stream_close(npg_stream **stream);

/* The format that npg_read_cloud would use for a path ("ply", "obj", "xyz", "npy", "pcd"), NULL for none. */
const char *npg_reader_for(const char *path);

/* Camera: pinhole with OpenCV's lens distortion.  Camera axes: x right, y down, z ahead; pixel (0, 0) is the
 * centre of the upper left pixel.
 *
 *     x = X / Z, y = Y / Z, r2 = x x + y y
 *     s = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
 *     u = fx (x s + 2 p1 x y + p2 (r2 + 2 x x)) + cx
 *     v = fy (y s + p1 (r2 + 2 y y) + 2 p2 x y) + cy
 *
 * Poses are 3 x 4, row-major, [R | t]: p' = R p + t. */

enum { NPG_K1, NPG_K2, NPG_P1, NPG_P2, NPG_K3, NPG_K4, NPG_K5, NPG_K6, NPG_DISTORTIONS }; /* OpenCV's order */

typedef struct npg_camera {
    size_t width, height;  /* of the images that the intrinsics are of, pixels */
    double fx, fy, cx, cy; /* pixels */
    double distortion[NPG_DISTORTIONS];
} npg_camera;

/* Rig: depth sensors with their calibration, and which image of which sensor belongs to which frame.  Lengths are in
 * one unit (metres, as a rule).
 *
 * A frame is what all sensors saw at one time.  A sensor whose image is missing then is a gap of that sensor,
 * not of the frame. */

/* What to make of the poses in the files (option sensor-poses). */
typedef enum npg_rig_poses { NPG_POSES_FILE, NPG_POSES_INVERSE, NPG_POSES_NONE } npg_rig_poses;
/* Whether pixels without depth say that nothing is there (option background). */
typedef enum npg_background {
    NPG_BACKGROUND_AUTO,
    NPG_BACKGROUND_REMOVED,
    NPG_BACKGROUND_UNKNOWN
} npg_background;

typedef struct npg_rig_settings {
    int poses;            /* npg_rig_poses                                                            */
    int background;       /* npg_background                                                           */
    double step_share;    /* neighbouring pixels whose depths differ by more than this share of the   */
                          /* nearer one are not one surface                                           */
    int64_t margin;       /* pixels beside such a step and beside missing depth that are dropped      */
                          /* unless they continue the surface; 0: none                                */
    double near_m, far_m; /* depths that are used, in the rig's unit; far 0: no limit                */
    bool confine;         /* refuse what the rig names outside its folder                             */
} npg_rig_settings;

/* What the options of a run say when none is given. */
extern const npg_rig_settings npg_rig_usual;

/* Images of one sensor at one time. */
typedef struct npg_rig_shot {
    int64_t number;              /* first: of the frame                       */
    char *depth, *colour, *mask; /* paths; colour and mask may be NULL        */
    bool has_pose;
    double pose[12]; /* sensor to world, where the sensor moves */
} npg_rig_shot;

typedef struct npg_rig_sensor {
    char *name;
    npg_camera camera;
    bool has_colour_camera; /* else colours lie on the depth image pixel by pixel */
    npg_camera colour_camera;
    double depth_to_colour[12]; /* from the depth camera's axes to the colour camera's */
    double scale;               /* unit / depth step                                   */
    double near_m, far_m;       /* of this sensor; far 0: no limit                     */
    bool is_opengl;             /* its poses are of axes x right, y up, z backward     */
    double pose[12];            /* sensor to world, where it stands still              */
    double correction[12];      /* world to world, after the pose; of npg_rig_correct() */
    npg_rig_shot *shots;        /* in order */
    size_t shot_count, shot_capacity;
    float *rays; /* H x W x 2, NaN where there is none; made at the first use, owned */
} npg_rig_sensor;

typedef struct npg_rig {
    npg_arena arena;     /* of all that it has, but the rays of its sensors */
    char *path, *folder; /* as given; the folder that its names start from  */
    char *unit;          /* of lengths, as rig.json names it; NULL: "m"     */
    npg_rig_settings settings;
    npg_rig_sensor *sensors;
    size_t sensor_count, sensor_capacity;
    size_t frame_count;
    int64_t *numbers; /* per frame, growing                      */
    int32_t *shot_of; /* frame_count x sensor_count, -1: a gap   */
    /* of those that npg_rig_read() has read: how many have no depth at all, and the first */
    size_t blank_count;
    const char *first_blank;
} npg_rig;

/* Whether a path is one: a rig.json (any file *.json), a folder with one, or one of depth images as other programs write
 * them, which can't be opened without. */
bool npg_rig_is(const char *path);

/* Load the description; no image is decoded.  NPG_BAD_INPUT names file and place. */
npg_status npg_rig_open(npg_rig **rig, const char *path, const npg_rig_settings *settings);
void npg_rig_close(npg_rig **rig);

/* Which way its sensors have up, on average, as the nearest of y, z, -y and -z: that of the images; of cameras that
 * are put up lying, whose images have it near x, that across them, y or z. */
npg_up npg_rig_up(const npg_rig *rig);
extern const char *const npg_up_words[]; /* "y", "z", "-y", "-z", NULL: by npg_up */

/* Place of a frame number; SIZE_MAX for one that is not there. */
size_t npg_rig_find(const npg_rig *rig, int64_t number);

/* The shot of a sensor in a frame, NULL for a gap. */
const npg_rig_shot *npg_rig_shot_of(const npg_rig *rig, size_t frame, size_t sensor);

/* The pose (sensor to world) it is used with: settings, axes and correction applied. */
void npg_rig_pose(const npg_rig *rig, double pose[12], size_t sensor, const npg_rig_shot *shot);

/* Numbers that stand for all calibration a frame is made with (intrinsics, poses, settings): two rigs that
 * give one frame the same points from the same images have the same. */
uint64_t npg_rig_frame_hash(const npg_rig *rig, size_t frame);

/* All points of a frame, of all its sensors: positions, normals that face the sensor, colours where there are
 * colour images, the sensor of each.  frame must be empty.  Sensors are decoded in parallel; the result does
 * not depend on it.  NPG_BAD_INPUT names the image.  A frame without a usable pixel has 0 points. */
npg_status npg_rig_read(npg_rig *rig, npg_frame *frame, size_t at, npg_origin *origin);

/* The same of the frame with a number, "PATH#NUMBER", once more as a mesh without faces, and whether a text is that of a
 * rig that is there.  NPG_BAD_INPUT. */
bool npg_rig_is_frame(const char *text);
npg_status npg_rig_read_frame(npg_frame *frame, const char *text, npg_origin *origin);
npg_status npg_rig_read_shape(npg_mesh **mesh, const char *text, npg_origin *origin);

/* npg_rig_up() of the rig of such a frame. */
npg_status npg_rig_up_of(npg_up *up, const char *text);

/* A sensor's pose, by what it sees together with the others. */
typedef enum npg_rig_verdict {
    NPG_RIG_ALONE,   /* there is no other sensor                                    */
    NPG_RIG_FIXED,   /* the others are measured against it: most agree with it      */
    NPG_RIG_ALIGNED, /* within 0.001 of the depth (2.5 mm at 2.5 m) and 0.2 degrees */
    NPG_RIG_OFF,     /* beyond that, and beyond three deviations                    */
    NPG_RIG_UNKNOWN  /* what they see together does not determine it                */
} npg_rig_verdict;

typedef struct npg_rig_view {
    size_t frames, points; /* frames with an image among those looked at, and points in them  */
    double depth;          /* mean depth of all sensors' points, in the rig's unit             */
    double overlap;        /* share of its points that lie on what other sensors see, 0..1     */
    double apart;          /* distance to their surfaces there, standard deviation by the      */
                           /* median, in the rig's unit; 0: none                               */
    npg_rig_verdict verdict;
    double shift, turn_deg;       /* how far the pose is off: position, in the rig's unit; rotation */
    double shift_sd, turn_sd_deg; /* their standard deviations, infinite where nothing is known     */
    double correction[12];        /* x' = correction x, in the world; none unless it is OFF         */
} npg_rig_view;

/* Compare the surfaces that sensors see in up to 24 of the given frames (places in the rig),
 * spread over them; one entry per sensor.  Images that can't be read count as missing.  NPG_MEMORY. */
npg_status npg_rig_compare(npg_rig *rig, npg_rig_view *views, const size_t *frames, size_t count);

/* From now on use the corrections: npg_rig_pose() includes them. */
void npg_rig_correct(npg_rig *rig, const npg_rig_view *views);

/* Put "pose" ("aligned", "off" ...), "shift", "turn_deg", their deviations, and "correction" (four rows of
 * four, only where it is off) into a sensor's object; lengths in the rig's unit, null: not known. */
void npg_rig_report_pose(json_t *sensor, const npg_rig_view *view);

/* The same as one phrase: "off by 12.3 mm and 0.70 deg (deviation 0.8 mm, 0.03 deg)". */
void npg_rig_describe_pose(char *text, size_t size, const npg_rig *rig, const npg_rig_view *view);

/* A length in the rig's unit: "12.3 mm" where that is m, cm or mm. */
void npg_rig_describe_length(char *text, size_t size, const npg_rig *rig, double length);

/* Frame selection: the text of --frames.
 *
 *   "a:b:step"  positions in time as Python slices them: from a up to but without b, negative ones from the
 *               end, every part may be left out; step >= 1
 *   "1-5,8"     the numbers in the files' names, both ends included
 *   ""          everything */

typedef struct npg_selection {
    bool is_slice, has_first, has_end;
    int64_t first, end, step; /* slice                                          */
    size_t range_count;       /* numbers; 0 and no slice: everything            */
    int64_t (*ranges)[2];     /* both ends included, ascending and apart; owned */
} npg_selection;

/* NPG_USAGE says what is wrong with the text.  Clear it after success. */
npg_status npg_selection_parse(npg_selection *selection, const char *text);
void npg_selection_clear(npg_selection *selection);

/* Whether the frame at a position of `count` with a number is chosen; count < 0: not known, and then a slice
 * must not count from the end (npg_selection_needs_count). */
bool npg_selection_takes(const npg_selection *selection, int64_t position, int64_t number, int64_t count);
bool npg_selection_needs_count(const npg_selection *selection);

/* Frame files: which files are the frames of a capture, in time order, gaps included.
 *
 * An input is one of
 *   a folder        all files of the ending that most of its files have; else its sub-folder points/,
 *                   point_clouds/ or its only one
 *   a pattern       frame_%04d.ply or frame_####.ply, also in a folder's name
 *   a shell glob    "scan_*.ply"
 *   a list file     one path per line, relative to the list or to the working folder; # begins a comment
 *   one file        a capture of one frame
 *   a rig           a rig.json, or a folder of depth images with their calibration
 * Names sort naturally (f2 before f10), a list file keeps its own order.  A frame's number comes from its
 * name; the step of the numbering is the largest that all numbers share, and what it leaves out is a gap. */

typedef struct npg_frame_slot {
    char *path; /* NULL: a gap */
    int64_t number;
    uint64_t calibration; /* npg_rig_frame_hash() when the list was opened; 0: of a file */
} npg_frame_slot;

typedef struct npg_frame_files {
    npg_arena arena;         /* of slots and paths                                                */
    size_t count, gap_count; /* slots, and how many of them are gaps                              */
    npg_frame_slot *slots;
    size_t left_out; /* files of a folder with another ending that could have been frames */
    npg_rig *rig;    /* whose frames these are; owned, or NULL for files                  */
} npg_frame_files;

/* finds_gaps false: frames follow each other whatever their numbers are.  settings NULL: the input is no rig; of
 * a rig paths are those of each frame's first depth image.
 * NPG_BAD_INPUT: nothing there, nothing readable, a list with a path that is not there.  NPG_USAGE: a
 * selection that is malformed or chooses nothing.  NPG_MEMORY. */
npg_status npg_frame_files_open(npg_frame_files **list, const char *input, const char *selection,
                                bool finds_gaps, const npg_rig_settings *settings);

/* Read frame `slot`, which has a path: npg_read_cloud(), or npg_rig_read(). */
npg_status npg_frame_files_read(const npg_frame_files *list, size_t slot, npg_frame *frame,
                                npg_origin *origin);

/* npg_rig_compare() over the slots that have a path, of a list that has a rig; *views to npg_release(). */
npg_status npg_frame_files_compare(const npg_frame_files *list, npg_rig_view **views);

/* Call visit for each file that the frame `slot` is made of; ends with the first status but NPG_OK. */
npg_status npg_frame_files_each(const npg_frame_files *list, size_t slot,
                                npg_status (*visit)(void *user, const char *path), void *user);

/* Size and checksum of one file, or of all that a frame is made of; begins as zero. */
typedef struct npg_input_sum {
    int64_t bytes;
    uint64_t hash;
    bool is_begun;
} npg_input_sum;

/* Add a file to a npg_input_sum; the order counts.  NPG_BAD_INPUT. */
npg_status npg_input_sum_add(void *sum, const char *path);

/* That of frame `slot`, which has a path; of a rig its calibration counts, too. */
npg_status npg_frame_files_sum(const npg_frame_files *list, size_t slot, npg_input_sum *sum);

/* What stage job found before the first pass: the hash of every slot (uint64_t; 0: it could not be read).  Frames that
 * are read later must have it. */
extern const npg_fact_kind npg_fact_input_hashes;

/* Refuse a list with a file that is not in the input's folder (of a pattern, list or file: the one it lies
 * in) after all links are followed.  NPG_BAD_INPUT names it; nothing has been opened then. */
npg_status npg_frame_files_confine(const npg_frame_files *list, const char *input);
void npg_frame_files_close(npg_frame_files **list);

/* The numbers of the gaps as text, "3, 7-9", ended by "..." where it does not fit. */
void npg_frame_files_gaps(char *text, size_t size, const npg_frame_files *list);

/* Compares as people count: runs of digits by their value ("f2" before "f10").  Names that differ only in
 * leading zeros are equal. */
int npg_natural_compare(const char *a, const char *b);

/* The same of pointers to texts, or to structs that begin with one, as qsort() and bsearch() ask; equal names by their
 * bytes. */
int npg_natural_order(const void *left, const void *right);

/* The files that the options of a run (input, frames, missing, confine, those of rigs) name as its frames; of
 * a rig the description is read, else nothing.  As npg_frame_files_open() and, with confine,
 * npg_frame_files_confine().  selection: in place of option frames, with its own gaps; NULL: as that says. */
npg_status npg_capture_list(npg_frame_files **list, const npg_options *options, const char *selection);

/* Listing: files in natural order. */

#define NPG_CLOUDS ".ply .obj .xyz .xyzn .txt .pts .npy .pcd" /* endings of all that is read */

typedef struct npg_listing {
    npg_arena *arena; /* a loan, set before anything else: what paths and numbers are of */
    char **paths;
    int64_t *numbers; /* NULL unless the input itself says the numbers (a pattern) */
    size_t count, room;
    size_t left_out; /* files of a folder with another ending */
    bool is_listed;  /* in the order of a list, not sorted    */
} npg_listing;

/* Add a file, the files of a folder whose names end in one of `endings` (".ply .obj"), numbers in names
 * compared as numbers, or the frames of a rig.  NPG_BAD_INPUT when the path does not exist or the folder has no
 * such file. */
npg_status npg_listing_add(npg_listing *listing, const char *path, const char *endings);

/* Keep the entries at the selected positions; a number in the selection is a position too, counted from 0. */
void npg_listing_keep(npg_listing *listing, const npg_selection *selection);

/* Where `folder` has a sub-folder of one of `names` ("truth gt"), that one's path, else `folder` itself. */
npg_status npg_subfolder(npg_arena *arena, const char **out, const char *folder, const char *names);

/* Frame store: frames kept for the passes that bring them again, in memory up to a limit and beyond it in a
 * file without a name, which is gone with the run whatever ends it.
 *
 * A frame is kept as it was read until stage outlier puts it back clean, with NPG_FIELD_CLEAN.  One that finds no
 * room, in memory or on disk, is left out without harm: it is read again, from its file or the spool of a live
 * source (below).  What comes out is the same bytes as what went in.
 *
 * Threads: all functions but open and close may be called from any thread. */

typedef struct npg_frame_store npg_frame_store;

typedef struct npg_frame_store_use {
    size_t memory_bytes, disk_bytes; /* now; of the file so far */
} npg_frame_store_use;

/* spill_folder: where the file is made when it is needed; NULL: nothing goes to disk.  NPG_MEMORY. */
npg_status npg_frame_store_open(npg_frame_store **store, size_t byte_max, const char *spill_folder);
void npg_frame_store_close(npg_frame_store **store);
npg_frame_store_use npg_frame_store_used(npg_frame_store *store);

/* Keep a copy under frame->index, in place of what is there.  is_final: it may go to disk; one that is not
 * clean yet will be put again, and must not take the room twice.  NPG_MEMORY where all are kept; else what
 * has no points or is held (the copy of a frame that is kept under its own index) is not. */
npg_status npg_frame_store_put(npg_frame_store *store, const npg_frame *frame, bool is_final);

/* A copy of what is kept into the empty *frame, or with give_away the thing itself.  NPG_END: nothing is;
 * NPG_MEMORY, NPG_DISK. */
npg_status npg_frame_store_get(npg_frame_store *store, npg_frame *frame, int64_t index, bool give_away);

/* Keep the normals of a clean frame that is kept, which were made or mended, with frame->cleaning's figures
 * of them; and put them into a frame.  False: none are kept. */
void npg_frame_store_put_normals(npg_frame_store *store, const npg_frame *frame);
bool npg_frame_store_get_normals(npg_frame_store *store, npg_frame *frame);

/* Written by stage ingest before its first chunk, for stage outlier. */
extern const npg_fact_kind npg_fact_frame_store;

/* Spool: what came from a live source, frame by frame, so that passes can walk it again and a run that is broken
 * off is resumed with it: records of a store (pipeline/store.h),
 *
 *     OUT/job/frames.npg     one for every frame that came or is missing, in order of arrival
 *
 * With the points of frames that were selected, or that a gap may repeat; of a folder with their path, which is not
 * looked at again.
 *
 * Threads: stage ingest adds frames, any thread may look at them. */

typedef struct npg_spooled {
    int64_t number;
    int64_t index;       /* -1: it was not selected (option frames)                                   */
    int64_t digits;      /* npg_follow_facts at the time                                           */
    int64_t points;      /* how many came; -1: the frame is missing                                   */
    uint64_t hash;       /* XXH3 of what came                                                         */
    uint64_t key;        /* of this and all that came before                                          */
    uint32_t is_missing; /* no frame came with this number; it is skipped, or held                    */
    uint32_t is_held, is_skipped, unused;
} npg_spooled;

/* A store, written by stage job where a live run keeps state. */
extern const npg_fact_kind npg_fact_spool;

/* How many are there. */
int64_t npg_spool_count(npg_store *spool);

/* Add the next one, which has the key of the one before it (0: there is none) and gets its own; frame gives path
 * and, with_points, the points; cause (or NULL) is why it is skipped.  NPG_DISK. */
npg_status npg_spool_add(npg_store *spool, npg_spooled *entry, const npg_frame *frame, bool with_points,
                         const char *cause);

/* The i-th that came; *record, which may be NULL, to npg_record_close().  NPG_BAD_INPUT where it is damaged. */
npg_status npg_spool_get(npg_store *spool, int64_t i, npg_spooled *entry, npg_record **record);

/* The frame's "path", or "cause" of being skipped, NULL for none; a loan of the record. */
const char *npg_spool_text(const npg_record *record, const char *name);

/* Number, index, marks, path and points of it into an empty frame. */
npg_status npg_spool_frame(const npg_spooled *entry, const npg_record *record, npg_frame *frame);

/* Key of the look-ahead: what the first `count` frames are.  0 where there are none. */
npg_status npg_spool_key(npg_store *spool, int64_t count, uint64_t *key);

/* Of the points of a frame. */
uint64_t npg_spool_hash(const npg_frame *frame);

/* Of a job that is done: NPG_USAGE where the files of a followed folder are others, or more came. */
npg_status npg_live_check_done(npg_worker *worker, npg_store *spool);

#endif
