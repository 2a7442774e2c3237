/* Batch: many captures, each in its own folder and process. */
#ifndef NPG_BATCH_H
#define NPG_BATCH_H

#include <stdbool.h>
#include <sys/types.h>

#include "pipeline/options.h"

/* How a capture ended, as OUT/<name>/verdict.json says it. */
typedef struct npg_verdict {
    bool is_known;     /* false: it has not been run to an end yet                               */
    char word[16];     /* done, partial, stopped, time, memory, bad input...                     */
    int exit_code;     /* of the run; 75 for time, 6 for memory, 128 + n when killed by signal n */
    char message[600]; /* why, "" when done                                                      */
    double seconds;    /* of the last start that did anything                                    */
    size_t peak_bytes;
    bool was_done; /* this start found it done; not part of the file */
} npg_verdict;

/* The words of the manifest's and the batch's "segments"; UNSAID: one, or what the manifest says. */
enum { NPG_BATCH_SEGMENTS_UNSAID, NPG_BATCH_SEGMENTS_ONE, NPG_BATCH_SEGMENTS_AUTO };

typedef struct npg_capture {
    char *name;            /* of its folder in the output; owned                           */
    char *input, *output;  /* absolute paths; owned                                        */
    npg_options *options;  /* of its run, input and output among them; owned               */
    char *refusal;         /* why it is not even started, NULL: it is; owned               */
    double max_time_s;     /* 0: no limit                                                  */
    int segments;          /* NPG_BATCH_SEGMENTS_..                                        */
    bool of_mesh_vertices; /* its points are the vertices of meshes: nothing else is there */
    npg_verdict verdict;
} npg_capture;

typedef struct npg_batch {
    char *path, *output;   /* owned */
    bool is_folder;        /* path is that of a folder of captures, not of a manifest */
    npg_capture *captures; /* owned */
    size_t count, capacity;
    bool has_views;                /* a page is put beside each result */
    size_t task_index, task_count; /* this process does captures i with i mod task_count == task_index */
} npg_batch;

/* What the command line says for all captures. */
typedef struct npg_batch_given {
    const npg_options *options; /* those set in it win over the manifest's; "output" is that of the batch */
    double max_time_s;          /* < 0: not given */
    int segments;               /* NPG_BATCH_SEGMENTS_.. */
} npg_batch_given;

/* path: a manifest (batch_manifest.c) or a folder whose sub-folders are captures (batch_folder.c).
 * NPG_USAGE: file, place and cause of what makes no sense.  NPG_BAD_INPUT: nothing there. */
npg_status npg_batch_open(npg_batch **batch, const char *path, const npg_batch_given *given);
void npg_batch_close(npg_batch **batch);

/* Whether the capture at this place is for this process to do. */
bool npg_batch_is_mine(const npg_batch *batch, size_t i);

/* ---- for the two that fill a batch ---- */

npg_status npg_batch_read_manifest(npg_batch *batch, const npg_batch_given *given);
npg_status npg_batch_read_folder(npg_batch *batch, const npg_batch_given *given);

/* Say on standard error what a method of the published code asks for that has no counterpart here; place: where
 * it was read. */
void npg_batch_warn_of_ignored(const npg_options *options, const char *place);

/* Add a capture with fresh options.  NPG_USAGE: a name that can't be a folder's or that another one has. */
npg_status npg_batch_add(npg_batch *batch, npg_capture **capture, const char *name);

/* Set input, output and what the command line gives; the last step.  What leads out of the capture's folder
 * is left alone: the capture then has a refusal.  text: as the manifest or the listing has it; a path that is
 * not absolute is taken from `folder`. */
npg_status npg_batch_complete(npg_batch *batch, npg_capture *capture, const char *folder, const char *text,
                              const npg_batch_given *given);

/* Where frames lie in a folder of a capture: its sub-folder points/, point_clouds/, points_clouds/ or
 * pcl_seqs/ when that holds any, else the folder; only meshes in gt/: that.  Sets the option "truth" to the
 * sub-folder truth/ or gt/ unless it is set or is the input.  *input is to be given to npg_release().
 * NPG_BAD_INPUT: one of these sub-folders leads out of the folder, and is_confined. */
npg_status npg_batch_find_input(npg_capture *capture, char **input, const char *folder, bool is_confined);

/* An absolute path of `text` seen from `folder`; to be given to npg_release(). */
npg_status npg_path_from(char **path, const char *folder, const char *text);

#endif
