/* Child: run a helper program with bytes in, bytes out, a time limit and a way to stop it. */
#ifndef NPG_CHILD_H
#define NPG_CHILD_H

#include <signal.h>
#include <stdbool.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <unistd.h>

#include "pipeline/status.h"

typedef struct npg_child_job {
    /* name of the helper, "neupig-poisson", or an absolute path; started with our process id as its argument, for
     * npg_end_with_parent(); a name is looked for beside this program and
     * this library, in their ../libexec/neupig (or ../../libexec/neupig), and where it was to be installed; its
     * environment is this process's, with OMP_WAIT_POLICY=passive where that has none */
    const char *program;
    const void *input[2]; /* written one after the other, then standard input is closed */
    size_t input_size[2];
    size_t output_max; /* more output than this is a failure */
    double time_limit_s;
    bool (*should_stop)(void *user); /* asked several times a second; may be NULL */
    void *user;
} npg_child_job;

typedef struct npg_child_result {
    uint8_t *output; /* owned by the caller: npg_release */
    size_t output_size;
    char last_line[400]; /* the last one on standard error, "" if none */
} npg_child_result;

/* Run to the end.  NPG_OK: exit code 0.  NPG_MEMORY: exit code 6.  NPG_STOPPED: should_stop said so.
 * NPG_FAILED says: not found, exit code, signal, or time limit (the child is then killed), with the child's
 * last line.  No process, descriptor or signal is left behind; the caller's SIGPIPE setting does not matter.
 * Threads: any number at a time. */
npg_status npg_child_run(npg_child_result *result, const npg_child_job *job);

/* Keep the last line of a text, without its end. */
void npg_keep_last_line(char *text);

/* Find a file of this installation that can be read: beside this program or this library, or in PREFIX/<folder>
 * ("libexec/neupig/") as seen from there. */
bool npg_find_installed(char path[4096], const char *folder, const char *name);

/* ---- for the helper ---- */

/* From now on the signal comes when the parent ends; it comes at once where that has ended before, so that it is not
 * the parent any more.  parent: its process id as text; NULL does nothing. */
static inline void npg_end_with_parent(const char *parent, int signal)
{
    if (!parent) return;
    prctl(PR_SET_PDEATHSIG, signal);
    if (getppid() != (pid_t)strtol(parent, NULL, 10)) kill(getpid(), signal);
}

#endif
