/* Process of one capture: neupig run in a child, its output, its memory, and how it is stopped. */
#ifndef NPG_BATCH_PROCESS_H
#define NPG_BATCH_PROCESS_H

#include "tools/batch/batch_verdict.h"

typedef struct npg_process {
    npg_capture *capture; /* loan; NULL: nothing runs in this place */
    pid_t pid;
    int out, err;                     /* this end of its standard output and error; -1: closed */
    char line[4096], last_error[512]; /* the line that is coming in; its last whole line on standard error */
    size_t line_length, err_length;
    char err_line[512];
    json_t *progress, *end;  /* its last records of these kinds, owned; may be NULL */
    double begun_s, asked_s; /* asked_s: when it was first asked to end, 0 before that */
    npg_stop_cause cause;
    bool was_killed;
    size_t peak_bytes;
    long long done_before[3]; /* device, inode and time of done.json before the start; 0: none */
} npg_process;

/* Start the run of a capture: its folder, its log, the child.  NPG_DISK, NPG_FAILED. */
npg_status npg_process_start(npg_process *process, npg_capture *capture);

/* Read what has come; *advanced: there is new progress. */
void npg_process_read(npg_process *process, bool *advanced);

/* Check its time and memory, and stop it when it takes too much or does not end although asked. */
void npg_process_watch(npg_process *process);

/* Ask it to end (SIGTERM, once); the second time kills it and what it has started. */
void npg_process_stop(npg_process *process, npg_stop_cause cause);

/* Whether it has ended; then its verdict is judged, written and logged, and the place is free. */
npg_status npg_process_reap(npg_process *process, bool *ended);

#endif
