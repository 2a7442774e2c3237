/* With parent: a process that must not outlive the one that started it. */
#ifndef NPG_WITH_PARENT_H
#define NPG_WITH_PARENT_H

#include <signal.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <unistd.h>

/* From now on the signal comes when the parent ends; it comes at once where that has ended before, so that it is not
 * the parent any more.  parent: its process id as text; NULL does nothing.  Lasts over exec. */
static inline void npg_end_with_parent(const char *parent, int signal)
{
    if (!parent) return;
    prctl(PR_SET_PDEATHSIG, signal);
    if (getppid() != (pid_t)strtol(parent, NULL, 10)) kill(getpid(), signal);
}

#endif
