/* Batch: many captures, each in its own folder and process. */
#ifndef NPG_BATCH_H
#define NPG_BATCH_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>
#include <sys/stat.h>

#include "pipeline/memory.h"
#include "pipeline/options.h"
#include "tools/progress.h"

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
    char *name;           /* of its folder in the output                                  */
    char *input, *output; /* absolute paths                                               */
    npg_options *options; /* of its run, input and output among them; owned               */
    char *refusal;        /* why it is not even started, NULL: it is                      */
    double max_time_s;    /* 0: no limit                                                  */
    int segments;         /* NPG_BATCH_SEGMENTS_..                                        */
    npg_verdict verdict;
} npg_capture;

typedef struct npg_batch {
    npg_arena arena; /* of all texts, of the captures' too */
    char *path, *output;
    bool is_folder; /* path is that of a folder of captures, not of a manifest */
    npg_capture *captures;
    size_t count, capacity;
    size_t task_index, task_count; /* this process does captures i with i mod task_count == task_index */
} npg_batch;

/* What the command line says for all captures. */
typedef struct npg_batch_given {
    const npg_options *options; /* those set in it win over the manifest's; "output" is that of the batch */
    double max_time_s;          /* < 0: not given */
    int segments;               /* NPG_BATCH_SEGMENTS_.. */
} npg_batch_given;

/* path: a manifest (batch_manifest.c) or a folder whose sub-folders are captures.
 * NPG_USAGE: file, place and cause of what makes no sense.  NPG_BAD_INPUT: nothing there. */
npg_status npg_batch_open(npg_batch **batch, const char *path, const npg_batch_given *given);
void npg_batch_close(npg_batch **batch);

/* Whether the capture at this place is for this process to do. */
bool npg_batch_is_mine(const npg_batch *batch, size_t i);

/* ---- for the two that fill a batch ---- */

npg_status npg_batch_read_manifest(npg_batch *batch, const npg_batch_given *given);

/* Add a capture with fresh options.  NPG_USAGE: a name that can't be a folder's or that another one has. */
npg_status npg_batch_add(npg_batch *batch, npg_capture **capture, const char *name);

/* Set input, output and what the command line gives; the last step.  What leads out of the capture's folder
 * is left alone: the capture then has a refusal.  text: as the manifest or the listing has it; a path that is
 * not absolute is taken from `folder`. */
npg_status npg_batch_complete(npg_batch *batch, npg_capture *capture, const char *folder, const char *text,
                              const npg_batch_given *given);

/* An absolute path of `text` seen from `folder`. */
npg_status npg_path_from(npg_arena *arena, char **path, const char *folder, const char *text);

/* ---- run ---- */

/* Run the captures that are this process's to do, at most `jobs` at a time, and fill in their verdicts;
 * the others' are read.  A capture that fails does not touch the rest.  SIGINT, SIGTERM and SIGHUP
 * are passed on; *stopped then becomes true, and nothing more is started.  NPG_MEMORY, NPG_FAILED: the
 * batch itself can't continue. */
npg_status npg_batch_run(npg_batch *batch, npg_reporter *reporter, size_t jobs, bool *stopped);

/* Write OUT/batch.json with every capture of the batch, also those that other processes do, as far as they
 * are now, and print the table to `out` unless it is NULL.  Processes of one batch take turns. */
npg_status npg_batch_report(npg_batch *batch, FILE *out);

/* ---- the process of one capture: neupig run in a child, its output, and how it is stopped ---- */

/* Why a run was asked to end. */
typedef enum npg_stop_cause { NPG_STOP_NONE, NPG_STOP_TIME, NPG_STOP_REQUEST } npg_stop_cause;

typedef struct npg_process {
    npg_capture *capture; /* loan; NULL: nothing runs in this place */
    pid_t pid;
    int out, err;            /* its standard output and error; -1: closed               */
    json_t *progress;        /* its last record of that kind, owned; may be NULL        */
    double begun_s, asked_s; /* asked_s: when it was first asked to end, 0 before that  */
    npg_stop_cause cause;
    bool was_killed;
    struct stat done_before; /* of done.json before the start; zeroed: there was none */
} npg_process;

/* Start the run of a capture: its folder, its log, the child.  NPG_DISK, NPG_FAILED. */
npg_status npg_process_start(npg_process *process, npg_capture *capture);

/* Read what has come; whether there is new progress. */
bool npg_process_read(npg_process *process);

/* Stop it when it takes too long, kill it when it does not end although asked. */
void npg_process_watch(npg_process *process);

/* Ask it to end (SIGTERM, once); the second time kills it and what it has started. */
void npg_process_stop(npg_process *process, npg_stop_cause cause);

/* Whether it has ended; then its verdict is judged, written and logged, and the place is free. */
npg_status npg_process_reap(npg_process *process, bool *ended);

/* ---- verdicts: how a run ended, in a word, and OUT/<name>/verdict.json ---- */

/* From what waitpid() gave, with the cause; words: the run's own last ones. */
void npg_verdict_judge(npg_verdict *verdict, const npg_capture *capture, int how, npg_stop_cause cause,
                       const char *words);

/* Of a run that could not be started or waited for. */
void npg_verdict_fail(npg_verdict *verdict, npg_status status, const char *message);

/* Of a capture that is not started because of its refusal: bad input.  In its folder, as any other. */
npg_status npg_verdict_refuse(npg_capture *capture);

/* Whether nothing is left to do, whatever the quality. */
bool npg_verdict_is_done(const npg_verdict *verdict);

/* What verdict.json says; is_known is false when there is none. */
void npg_verdict_read(npg_verdict *verdict, const npg_capture *capture);
npg_status npg_verdict_write(const npg_capture *capture);

/* How a batch ended: NPG_STOPPED before its end, NPG_FAILED when a capture has failed or is not done, NPG_PARTIAL when
 * one is done with frames skipped or below the quality bar.  Captures of this process, or of all. */
npg_status npg_batch_status(const npg_batch *batch, bool of_all, bool stopped);

/* An object of name, input, output and what verdict.json says. */
json_t *npg_verdict_json(const npg_capture *capture);

/* The same as a record of logs. */
json_t *npg_verdict_record(const npg_capture *capture);

/* Of a capture that is run with segments = auto an array of {folder, first_frame, last_frame, keyframe,
 * status, cause}, in time order; cause: what cut it off, null for none.  A new reference; NULL when it has
 * none yet. */
json_t *npg_capture_segments(const npg_capture *capture);

#endif
