/* Progress: how far a run is, as a bar on a terminal or as JSON lines, and the log on standard error. */
#ifndef NPG_PROGRESS_H
#define NPG_PROGRESS_H

#include <jansson.h>
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>

#include "pipeline/status.h"

enum { NPG_SHOW_AUTO, NPG_SHOW_BAR, NPG_SHOW_JSON, NPG_SHOW_NONE }; /* the words of --progress */

typedef struct npg_reporter {
    int show;            /* NPG_SHOW_*, never AUTO once set up */
    npg_log_level level; /* records above it are not shown     */
    bool colour, bar_drawn;
    double drawn_s; /* when the bar was last drawn, in run seconds           */
    int log_fd;     /* of the log file; -1: none, or it could not be written */
} npg_reporter;

/* What the verbs that start runs take of it, and the rows of their tables; place: where it is in their values. */
typedef struct npg_reporter_settings {
    int show;
    bool quiet, verbose;
} npg_reporter_settings;

#define NPG_REPORTER_ROWS(place)                                                                             \
    NPG_ROW_CHOICE(                                                                                          \
        "progress", (place) + offsetof(npg_reporter_settings, show), "auto", "auto|bar|json|none",           \
        "How to show progress. json writes one line per step to standard output; auto: a bar on a "          \
        "terminal"),                                                                                         \
        NPG_ROW_FLAG("quiet", (place) + offsetof(npg_reporter_settings, quiet), "no",                        \
                     "Log warnings and errors only (also -q)"),                                              \
        NPG_ROW_FLAG("verbose", (place) + offsetof(npg_reporter_settings, verbose), "no",                    \
                     "Log everything (also -v)")

/* AUTO is a bar when standard error is a terminal, else nothing. */
void npg_reporter_init(npg_reporter *reporter, const npg_reporter_settings *settings);

/* Every log record, the start and the end also as a line of JSON at the end of a file, in whole lines, so
 * that several runs may share it.  "" for none.  NPG_DISK.  Closed by npg_reporter_end(). */
npg_status npg_reporter_open_log(npg_reporter *reporter, const char *path, const char *output);

/* Hooks for a run; the reporter is a loan until the run is closed. */
npg_hooks npg_reporter_hooks(npg_reporter *reporter);

/* A record of the verb's own. */
void npg_reporter_log(npg_reporter *reporter, npg_log_level level, double time_s, const char *stage,
                      const char *format, ...) NPG_PRINTF(5, 6);

/* Remove the bar before something else is printed. */
void npg_reporter_pause(npg_reporter *reporter);

/* Remove the bar, and write the closing record to the log file and in JSON mode to standard output. */
void npg_reporter_end(npg_reporter *reporter, npg_status status, const char *output);

/* In JSON mode a record (consumed; NULL does nothing) as a line on standard output. */
void npg_reporter_print(const npg_reporter *reporter, json_t *record);

/* Append a record (consumed; NULL does nothing) with "time" put in front to a log file: one write, so that
 * several processes may append to the same one.  A write that fails is reported once on standard error, and
 * *fd (-1: does nothing) becomes -1. */
void npg_log_file_write(int *fd, json_t *record);

/* "1:02:03", "2:03", or "?" where it is not known. */
void npg_spell_time(char *out, size_t size, double seconds);

/* ---- what the verbs that start runs share (verb_run.c) ---- */

/* Block SIGINT, SIGTERM and SIGHUP, where they are not ignored, and `more`; *all: those that are, for one thread to wait
 * for, *before: the mask to go back to. */
void npg_signals_block(sigset_t *all, sigset_t *before, int more);

/* A run from its start to its end.  SIGINT, SIGTERM and SIGHUP stop it; when it does not end in time the
 * process does, with exit code 75: a run can be resumed from what is on disk at any moment. */
npg_status npg_run_job(const npg_options *options, npg_reporter *reporter);

/* The same without the reporter's closing record, for one run of several. */
npg_status npg_run_once(const npg_options *options, npg_reporter *reporter);

/* Where the results are, on standard output; how it ended, on standard error. */
void npg_run_job_results(const char *verb, const char *output, npg_status status);

#endif
