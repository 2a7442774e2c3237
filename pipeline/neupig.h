/* neupig: one moving mesh from a long sequence of point clouds.  The public interface.
 *
 * A run takes frames (point clouds in time order), reconstructs the surface once at a keyframe and finds its
 * deformation in every frame.  Frames come from files that the run reads itself (option "input"), or are
 * pushed; results go to a folder (option "output"), are pulled, or both.
 *
 *     npg_options *options = NULL;
 *     npg_run *run = NULL;
 *     npg_options_open(&options);
 *     npg_options_set(options, "input", "capture/");
 *     npg_options_set(options, "output", "out/");
 *     npg_status status = npg_run_open(&run, options, NULL);
 *     if (!status) status = npg_run_wait(run);
 *     if (status) fprintf(stderr, "%s\n", npg_error_text());
 *     npg_run_close(&run);
 *     npg_options_close(&options);
 *
 * Conventions.  Functions that can fail return npg_status: 0 is success, a positive value steers the flow
 * (NPG_END), a negative value is a failure whose text npg_error_text() gives on the same thread.  A function
 * that takes T ** consumes the reference and nulls the pointer; T * is a loan until the call returns.
 * Closers accept NULL.  Arrays are row-major; letters: T frames, N points, V vertices, F faces.
 *
 * Versions.  Structs that cross the border begin with struct_size: whoever fills one sets it to the sizeof he
 * was compiled with.  Later versions only add members at the end, so that a program and a library of
 * different age understand each other: what one side does not know reads as zero, or is left out.  The one
 * exception is npg_surface_hit, an element of arrays, which stays as it is.
 *
 * Threads.  A handle belongs to one thread at a time unless its functions say otherwise; different handles
 * have nothing in common. */
#ifndef NEUPIG_H
#define NEUPIG_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define NPG_VERSION_MAJOR 0
#define NPG_VERSION_MINOR 1
#define NPG_VERSION_PATCH 0

#if defined(__GNUC__)
#define NPG_API                         __attribute__((visibility("default")))
#define NPG_PRINTF(format_at, first_at) __attribute__((format(printf, format_at, first_at)))
#else
#define NPG_API
#define NPG_PRINTF(format_at, first_at)
#endif

/* ---- status ---- */

typedef enum npg_status {
    NPG_OK = 0,
    NPG_END = 1,        /* no more: the stream ended                                           */
    NPG_STOPPED = 2,    /* npg_run_stop() was called; run it again to resume                   */
    NPG_PARTIAL = 3,    /* done, but frames were skipped, unexplained or below the quality bar */
    NPG_CHANGED = 4,    /* ended where the topology changed (option alarm = split)             */
    NPG_FAILED = -1,    /* an environment or library failed in a way of no class below         */
    NPG_USAGE = -2,     /* an option, a configuration or a call that makes no sense            */
    NPG_BAD_INPUT = -3, /* the data can't be used: the text names file, place and cause        */
    NPG_DEVICE = -4,    /* OpenCL: no device, a failed build, a kernel that computes wrong     */
    NPG_DISK = -5,      /* writing failed: disk full, no permission                            */
    NPG_MEMORY = -6,    /* an allocation failed or would pass the limit                        */
    NPG_DIVERGED = -7,  /* the optimisation produced a number that is not finite               */
    NPG_ABORTED = -8    /* another stage failed first; its status is the one to report         */
} npg_status;

/* The exit code of the command for a status: 0 done, 1 failed, 2 usage, 3 bad input, 4 device, 5 disk, 6
 * memory, 7 finished with frames skipped or below the quality bar, 75 stopped, run again to resume. */
NPG_API int npg_status_exit_code(npg_status status);

/* A word for a status, for logs and reports.  Never NULL. */
NPG_API const char *npg_status_name(npg_status status);

/* The text of the last failure on this thread; "" when there was none.  Valid until the next failure. */
NPG_API const char *npg_error_text(void);

/* For callbacks that fail (npg_custom_stage): make text the calling thread's failure and return status. */
NPG_API npg_status npg_error_set(npg_status status, const char *text);

/* "0.1.0". */
NPG_API const char *npg_version(void);

/* ---- memory ---- */

/* Where the library takes its own memory from.  alloc returns size bytes aligned to align
 * (a power of two), or NULL; release frees them.  Both are called from several threads.
 * Set once, before anything is opened. */
typedef struct npg_allocator {
    size_t struct_size;
    void *user;
    void *(*alloc)(void *user, size_t align, size_t size);
    void (*release)(void *user, void *memory);
} npg_allocator;

/* NPG_USAGE while memory of the library is still in use.  NULL brings back the default. */
NPG_API npg_status npg_memory_set_allocator(const npg_allocator *allocator);

/* Bytes in use now, and the most ever in use since the process began (device buffers on the CPU included).
 * The process has more resident: code, the device's compiler, and what its heap keeps though it is free.
 * With glibc mallopt(M_MMAP_THRESHOLD, 1 << 20) at the program's start keeps that small, as the command
 * does. */
NPG_API size_t npg_memory_used(void);
NPG_API size_t npg_memory_peak(void);

/* ---- options ---- */

typedef struct npg_options npg_options;

typedef enum npg_option_type {
    NPG_OPTION_FLAG,   /* "yes" or "no"                        */
    NPG_OPTION_INT,    /* decimal integer                      */
    NPG_OPTION_REAL,   /* decimal number                       */
    NPG_OPTION_CHOICE, /* one of the words in choices, "a|b|c" */
    NPG_OPTION_TEXT    /* any text                             */
} npg_option_type;

typedef enum npg_option_use {
    NPG_USE_COMMON, /* of the command, too                                            */
    NPG_USE_METHOD, /* a key of the method: programs set it, the command in --method  */
    NPG_USE_PART,   /* "LIST.part": programs set it, the command in --LIST part=value */
    NPG_USE_PROGRAM /* for programs alone                                             */
} npg_option_use;

typedef struct npg_option_info {
    size_t struct_size;
    const char *stage; /* the stage it belongs to, "run" for the run itself */
    const char *name, *help, *default_text, *choices, *value_name;
    npg_option_type type;
    double min, max;
    npg_option_use use;
} npg_option_info;

NPG_API npg_status npg_options_open(npg_options **options);
NPG_API void npg_options_close(npg_options **options);

/* Set one option by its name ("epochs", without dashes).  NPG_USAGE names the option and what it takes.
 * "method" is one of its names (default, best, paper ...), a JSON file, or a JSON object as text that sets
 * options, keys of the method above all: {"preset": "paper", "epochs": 250}.  "preset" is the name that the
 * others are added to.  Configurations of the paper's published code are read, too.  "bars", "depth-range" and
 * "follow-end" are lists that set their parts, as in "residual=1,coverage=0" for "bars.residual" and
 * "bars.coverage". */
NPG_API npg_status npg_options_set(npg_options *options, const char *name, const char *value);

/* The method in a file; // comments are allowed.  NPG_USAGE names file and option. */
NPG_API npg_status npg_options_load(npg_options *options, const char *path);

/* The options that the job in the folder was begun with, its input and its output:
 * with append = yes a run then adds the frames that came since, without it it finishes those that are left.
 * NPG_USAGE when the folder holds no job. */
NPG_API npg_status npg_options_load_job(npg_options *options, const char *folder);

/* The value an option has now, after presets, as text; NULL for a name that does not exist.  Valid until the
 * options change. */
NPG_API const char *npg_options_get(const npg_options *options, const char *name);

/* The i-th option of all stages, in the order of the chain; NPG_END after the last.
 * The texts stay for good. */
NPG_API npg_status npg_options_describe(size_t i, npg_option_info *info);

/* ---- custom stages ---- */

/* A frame on its way through the chain.  All pointers are loans until the callback returns.  Points, normals
 * and vertices may be changed in place, never their number; coordinates are kept small for floats:
 *
 *     point in the world  = points_origin + points[i]
 *     vertex in the world = vertices_origin + vertices_unit * vertices[v]
 */
typedef struct npg_frame_view {
    size_t struct_size;
    int64_t index, number; /* position in the sequence, and the number in the file's name */
    const char *path;      /* of its file; NULL for a frame that was pushed               */
    size_t point_count;    /* N                                                           */
    float *points;         /* N x 3                                                       */
    float *normals;        /* N x 3, unit length; NULL where there are none (yet)         */
    uint8_t *keep;         /* N, all 1: what is set to 0 is dropped with its normal       */
    double points_origin[3];
    size_t vertex_count, face_count; /* V, F; 0 before align                              */
    float *vertices;                 /* V x 3, NULL before align                          */
    const uint32_t *faces;           /* F x 3, the same in every frame; NULL before align */
    double vertices_origin[3], vertices_unit;
    double residual, coverage; /* as in npg_result; NaN before evaluate */
    uint8_t *colours;          /* N x 4 RGBA, sRGB, alpha 0: not known; NULL where the points have none */
    const uint8_t
        *vertex_colours; /* V x 4 RGBA, sRGB: those of the reference; NULL without, or before align */
} npg_frame_view;

typedef struct npg_custom_stage {
    size_t struct_size;
    const char *name; /* for log and report: small letters, digits and dashes; no other stage's */
    /* the stage it follows: ingest, outlier, keyframe, mesh, align, optimize, evaluate or export (then it
     * only looks: what is on disk was written before) */
    const char *after;
    void *user; /* handed to the callback */
    /* One frame.  NPG_OK passes it on; a failure ends the run with this status and the text of
     * npg_error_set(); NPG_STOPPED stops it. */
    npg_status (*frame)(void *user, npg_frame_view *frame);
} npg_custom_stage;

/* Put a stage into the chain of every run opened with these options; the struct and its texts are copied,
 * what user points to must outlive the runs.  Several after the same stage work in the order they were added.
 *
 * Every run calls the callback from one thread at a time, a thread of the stage's own, so it works beside the
 * other stages; it must not call functions of the same run but npg_run_stop().  After ingest and outlier it
 * sees each frame several times (to measure, to score, to choose the keyframe, to make the reference, to
 * solve; of a live source those of the look-ahead) and must do the same each time, or the result is
 * undefined; after the others once.  Frames do not come in time order but as
 * they are solved, outwards from the keyframe.  Points after outlier and vertices must stay finite, and a
 * frame that has been cleaned must keep a point (NPG_USAGE, NPG_BAD_INPUT).
 *
 * A run that resumes an earlier one needs the same stages (by name and place).
 * NPG_USAGE: a name that is taken, a place that is not there, too many stages. */
NPG_API npg_status npg_options_add_stage(npg_options *options, const npg_custom_stage *stage);

/* ---- logs and progress ---- */

typedef enum npg_log_level { NPG_LOG_ERROR, NPG_LOG_WARNING, NPG_LOG_INFO, NPG_LOG_DEBUG } npg_log_level;

typedef struct npg_log_record {
    size_t struct_size;
    npg_log_level level;
    double time_s;       /* seconds since the run was opened            */
    const char *stage;   /* the stage it comes from                     */
    int64_t frame;       /* number of the frame it is about, -1 if none */
    const char *message; /* one line, no newline at its end             */
} npg_log_record;

typedef struct npg_progress {
    size_t struct_size;
    const char *stage;           /* the stage that decides how far the run is            */
    double share;                /* 0..1 of the whole run                                */
    double elapsed_s, left_s;    /* left_s < 0 while it is not known                     */
    int64_t frames_done, frames; /* written so far, in all (-1: not known yet)           */
    int64_t step, steps;         /* epochs of the window at work; of stage align: frames */
    int64_t window, windows;     /* the window at work, and how many there will be       */
    double loss;                 /* last mean loss per frame; NaN before the first       */
} npg_progress;

/* Called from the run's threads, one call at a time for each run.  Pointers in the records are loans. */
typedef struct npg_hooks {
    size_t struct_size;
    void *user;
    void (*log)(void *user, const npg_log_record *record);
    void (*progress)(void *user, const npg_progress *progress);
} npg_hooks;

/* ---- runs ---- */

typedef struct npg_run npg_run;

/* A cloud handed in by npg_run_push(): N points, world coordinates. */
typedef struct npg_cloud {
    size_t struct_size;
    int64_t number;         /* the frame's number; numbers must grow */
    size_t point_count;     /* N                                     */
    const double *points;   /* N x 3, any unit; copied               */
    const float *normals;   /* N x 3 or NULL; copied                 */
    const uint8_t *colours; /* N x 4 RGBA or NULL: sRGB, alpha 0 where not known; copied */
} npg_cloud;

/* One frame of the moving mesh, got by npg_run_pull(). */
typedef struct npg_result {
    size_t struct_size;
    int64_t index, number;  /* position in the sequence, and the number in the file's name      */
    size_t vertex_count;    /* V, the same in every frame                                       */
    size_t face_count;      /* F                                                                */
    const double *vertices; /* V x 3, world coordinates                                         */
    const uint32_t *faces;  /* F x 3, the same list in every frame                              */
    double residual;        /* median distance points -> surface, in diagonals of a frame's box (median) */
    double coverage;        /* share of the surface that has points near it, 0..1               */
    /* V x 4 RGBA, sRGB: of the reference, or with colour = frames as this frame saw them; alpha 255: seen,
     * 254: lent by neighbours (of the reference) or by the reference (of a frame); NULL without colours */
    const uint8_t *vertex_colours;
    int good; /* above the quality bar (option bars), by itself: what shows only beside later frames is in the report */
} npg_result;

/* Check the options, build the chain and start the run's threads.  hooks may be NULL.
 * With the option input = "" frames come from npg_run_push().  NPG_USAGE, NPG_MEMORY, NPG_BAD_INPUT. */
NPG_API npg_status npg_run_open(npg_run **run, const npg_options *options, const npg_hooks *hooks);

/* Give the run its next frame; blocks while the run is busy (that is the back-pressure).  Any one thread.
 * NPG_USAGE when the run reads files or the number does not grow; the run's failure once it has failed. */
NPG_API npg_status npg_run_push(npg_run *run, const npg_cloud *cloud);

/* Which frame to push first.  A run that resumes an earlier one with pushed frames (same options and output,
 * without pull) has kept those it solved: *number gets the number of the first that it needs.  Frames with
 * smaller numbers may be left out; pushed again they are compared with what came before (another frame under
 * such a number fails the run with NPG_USAGE) and not solved again.  INT64_MIN: nothing was kept, push from
 * the first on.  Waits until the run has looked at its output folder; any thread, at any time before the run
 * is closed.  NPG_USAGE when the run reads its frames itself; the run's failure once it has failed. */
NPG_API npg_status npg_run_wanted_number(npg_run *run, int64_t *number);

/* Say that no more frames will be pushed. */
NPG_API npg_status npg_run_finish(npg_run *run);

/* Wait for the next finished frame.  Only for runs with option pull = yes; frames come as windows close, not
 * in time order.  The caller owns the result.  NPG_END after the last; a failure is the run's failure. */
NPG_API npg_status npg_run_pull(npg_run *run, npg_result **result);
NPG_API void npg_result_close(npg_result **result);

/* Wait for the end of the run and return its status: NPG_OK, NPG_PARTIAL, NPG_STOPPED or what failed first.
 * A run with pull = yes ends only when its results have been pulled. */
NPG_API npg_status npg_run_wait(npg_run *run);

/* Ask the run to stop soon.  Safe in a signal handler and from any thread. */
NPG_API void npg_run_stop(npg_run *run);

/* Stop the run if it is at work, wait for its threads, free everything. */
NPG_API void npg_run_close(npg_run **run);

/* ---- nearest surface point ---- */

typedef struct npg_surface npg_surface;

typedef struct npg_surface_hit {
    uint32_t face;    /* the closest face                         */
    float weights[3]; /* barycentric weights of the closest point */
    float dist_sq;    /* squared distance, in the mesh's unit     */
} npg_surface_hit;

/* A searchable surface from V vertices (V x 3) and F faces (F x 3); both are copied.  NPG_USAGE for an index
 * out of range or a vertex that is not finite. */
NPG_API npg_status npg_surface_open(npg_surface **surface, const float *vertices, size_t vertex_count,
                                    const uint32_t *faces, size_t face_count);

/* Move the vertices; the search tree is refitted.  Not while another thread asks. */
NPG_API npg_status npg_surface_move(npg_surface *surface, const float *vertices);

/* hits[i] = the surface point closest to points[i] (N x 3).  Thread-safe.  A point that is not finite gets
 * face = UINT32_MAX and dist_sq = infinity. */
NPG_API npg_status npg_surface_closest(const npg_surface *surface, npg_surface_hit *hits, const float *points,
                                       size_t point_count);
NPG_API void npg_surface_close(npg_surface **surface);

/* ---- what a capture holds ---- */

/* Of all frames of an input, as neupig probe shows it.  Counts are of frames, or of points. */
typedef struct npg_capture_facts {
    size_t struct_size;
    size_t frames, missing, unreadable; /* those that could not be read are among the frames */
    size_t with_normals;
    size_t points_least, points_median, points_most, points_total;
    size_t not_finite;                       /* points with a coordinate that is no number                */
    size_t attention;                        /* things that a run would stumble over: in text and json    */
    double box_low[3], box_high[3];          /* of finite points, world coordinates; infinite without any */
    uint64_t bytes;                          /* of the files                                              */
    size_t vertices, window;                 /* that a run with these options would have: V, frames       */
    double memory_bytes, disk_bytes, time_s; /* what it would take, about, on this machine                */
    const char *text, *json; /* all of it in lines, and as one JSON object with each frame and sensor     */
} npg_capture_facts;

/* Read every frame of option input as a run with these options would.  NPG_PARTIAL: something needs attention.
 * NPG_BAD_INPUT: nothing is there, or (then with *facts, the text is that of the first) frames can't be read
 * and option keep-going is not set.  NPG_USAGE, NPG_MEMORY.  Takes as long as reading the files; *facts is the
 * caller's.  Thread-safe. */
NPG_API npg_status npg_capture_probe(npg_capture_facts **facts, const npg_options *options);
NPG_API void npg_capture_facts_close(npg_capture_facts **facts);

/* ---- a mesh sequence against a ground truth ---- */

/* Both surfaces are sampled evenly by area.  With a the samples of the prediction, b those of the truth, d the
 * distance from a sample to the nearest one of the other side, in diagonals of the first truth's box, n their
 * normals:
 *
 *     CD    0.5 (mean d(a,b)^2 + mean d(b,a)^2) x 1e5
 *     NC    0.5 (mean |n_a . n_b| both ways)
 *     F     harmonic mean of precision (share of a with d <= tau) and recall (share of b with d <= tau)
 *     Corr  each vertex is tied to the truth's nearest one in the first frame; their mean distance later on
 *
 * What can't be told is NaN: NC without normals, Corr and what follows it without constant topology. */
typedef struct npg_eval_figures {
    size_t struct_size;
    int64_t frames; /* how many; of one frame: its place, from 0 */
    double cd, cd_to_truth, cd_from_truth, nc, f, precision, recall, corr;
    size_t vertices, faces, truth_vertices, truth_faces;
    double diagonal; /* of the first truth's box, in its unit; this and the rest: of the sequence alone */
    double jitter;   /* mean |p(t-1) - 2 p(t) + p(t+1)| of the vertices, in diagonals                   */
    double edge;     /* mean |length(t) / length(0) - 1| of the edges                                   */
    /* how far a vertex and its neighbours are from having moved as one rigid piece: root mean square of what is
     * left, in their root mean square distance; mean over vertices and frames */
    double rigidity;
    double bad_area; /* share of (face, frame) with an area above 10 or below 0.1 times the face's median */
    int constant_topology; /* of the predicted meshes */
} npg_eval_figures;

typedef struct npg_eval_settings {
    size_t struct_size;
    const char *predicted; /* a folder of meshes, or of a run's results                              */
    const char *truth;     /* a folder of meshes, as many, or one that has them in truth/ or gt/     */
    const char *frames;    /* which of the truth: "a:b:step", or places like "1-5,8"; NULL: all      */
    int points_only;       /* the truth is point clouds: all its points are samples, without Corr    */
    size_t samples;        /* on either side; 0: 100000                                              */
    double tau;            /* of F, in diagonals                                                     */
    uint64_t seed;         /* the same one gives the same figures                                    */
    void *user;            /* for the callback: the figures of each frame in turn, a loan; or NULL   */
    void (*frame)(void *user, const npg_eval_figures *figures);
} npg_eval_settings;

/* The means over all frames.  NPG_BAD_INPUT: not as many meshes, one that is damaged or has no area;
 * NPG_USAGE, NPG_MEMORY.  Thread-safe. */
NPG_API npg_status npg_eval(npg_eval_figures *all, const npg_eval_settings *settings);

/* ---- other formats of a run that is done ---- */

typedef struct npg_exported {
    size_t struct_size;
    size_t files;    /* that were made; 0: all lay there already                              */
    size_t repeated; /* frames without a mesh that repeat the one before them in pc2, mdd ... */
} npg_exported;

/* Make formats (a list as of option export: "glb,usda") of the meshes in output, the folder of a run, beside what
 * lies there.  What lies there as it was written is left alone.  done.json comes last: until then, and when it is
 * broken off, the result is the one it was.  Takes the folder's lock.  NPG_USAGE: no such format, one that can't hold
 * the capture, no run, or one that is at work; NPG_BAD_INPUT: it is not done, or its meshes were changed; NPG_DISK,
 * NPG_MEMORY.  Thread-safe. */
NPG_API npg_status npg_export(npg_exported *exported, const char *output, const char *list);

/* ---- another mesh, or points, through a run that is done ---- */

/* A point p hangs on the closest place c of the reference (face and weights): in a frame it is
 * c' + R (p - c), R the rotation of the surface there. */
typedef struct npg_apply_settings {
    size_t struct_size;
    const char *job;    /* output folder of the run; its meshes are still there                           */
    const char *mesh;   /* a file of a mesh or of points, in the coordinates of the job's reference.ply   */
    const char *output; /* folder for <prefix>_<number>.ply or .obj, other forms, and last done.json      */
    const char *prefix; /* NULL: "frame"                                                                  */
    const char *forms;  /* a list as of option export; NULL: ply, or obj where the mesh's file is         */
    int64_t fps_scale;  /* steps from each frame to the next; above 1 the files are numbered 0, 1, 2 ...  */
    double far_share;   /* of the reference's diagonal: points farther from it are counted                */
    int overwrite;      /* files of the same prefix that lie there are removed; else they are refused     */
} npg_apply_settings;

typedef struct npg_applied {
    size_t struct_size;
    size_t frames;                  /* written                                             */
    size_t point_count, far_count;  /* of the mesh; those too far from the reference       */
    size_t worst;                   /* the farthest, and how far it is: in the reference's */
    double worst_dist, worst_share; /* unit, and in its diagonals                          */
} npg_applied;

/* Filled as far as it got, also on failure.  NPG_USAGE, NPG_BAD_INPUT, NPG_DISK, NPG_MEMORY.  Thread-safe for
 * different output folders. */
NPG_API npg_status npg_apply(npg_applied *applied, const npg_apply_settings *settings);

/* ---- whether results are as they were written ---- */

typedef struct npg_verified {
    size_t struct_size;
    size_t files, damaged; /* that done.json lists; of those, how many are gone or have other bytes */
} npg_verified;

/* Compares size and checksum (XXH3) of every file that output/done.json lists: of a run, of its segments, of
 * npg_apply().  damaged() (NULL: nobody) is told of each that is not as it was written: path and cause.
 * NPG_BAD_INPUT: there is one, whose text names the first, or no list; NPG_USAGE, NPG_MEMORY.  Reads all of them
 * once.  Thread-safe. */
NPG_API npg_status npg_verify(npg_verified *found, const char *output, void *user,
                              void (*damaged)(void *user, const char *text));

/* ---- pictures of meshes and clouds, without a display ---- */

typedef enum npg_picture_colour {
    NPG_PICTURE_PLAIN,
    NPG_PICTURE_VERTEX,   /* the file's own                                                             */
    NPG_PICTURE_NORMAL,   /* by the direction of the surface                                            */
    NPG_PICTURE_IDENTITY, /* by place in the first mesh: shows that vertices keep their place on the body */
    NPG_PICTURE_AUTO      /* a cloud's own where it has any, else plain                                  */
} npg_picture_colour;

/* Which way is up.  Downward ones are how cameras have it: then the front is where they stand. */
typedef enum npg_up {
    NPG_UP_Y,       /* the front is from +z */
    NPG_UP_Z,       /* from -y */
    NPG_UP_MINUS_Y, /* from -z */
    NPG_UP_MINUS_Z  /* from +y */
} npg_up;

typedef struct npg_picture_settings {
    size_t struct_size;
    int64_t width, height;     /* of a tile, pixels; width 0: as what is drawn needs            */
    int64_t columns;           /* tiles in a row; 0: 8                                          */
    int64_t samples;           /* rays per pixel and axis; 0: 2                                 */
    double azimuth, elevation; /* of the eye, degrees; azimuth 0: from the front, 90: from +x   */
    npg_up up;
    npg_picture_colour colour;
    double point_size; /* radius of a cloud's points, in diagonals */
} npg_picture_settings;

typedef struct npg_picture {
    size_t struct_size;
    int64_t width, height;             /* pixels                                                       */
    size_t points_total, points_drawn; /* of the cloud with the most: no more than 200 000 are drawn   */
} npg_picture;

/* Draw each of `count` files (a mesh or a cloud) into one tile of a PNG at path; all share one camera.
 * NPG_USAGE: larger than 2^28 pixels; NPG_BAD_INPUT, NPG_DISK, NPG_MEMORY.  Thread-safe. */
NPG_API npg_status npg_picture_write(npg_picture *picture, const char *path, const char *const *files,
                                     size_t count, const npg_picture_settings *settings);

#ifdef __cplusplus
}
#endif
#endif
