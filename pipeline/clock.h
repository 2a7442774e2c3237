#ifndef NPG_PIPELINE_CLOCK_H
#define NPG_PIPELINE_CLOCK_H

#include <jansson.h>
#include <time.h>

/* Clocks that never go back. */

static inline double npg_clock_of(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Seconds since some fixed moment; setting the system's clock does not change it. */
static inline double npg_clock_s(void)
{
    return npg_clock_of(CLOCK_MONOTONIC);
}

/* Processor seconds of this thread, and of the whole process. */
static inline double npg_clock_thread_s(void)
{
    return npg_clock_of(CLOCK_THREAD_CPUTIME_ID);
}
static inline double npg_clock_process_s(void)
{
    return npg_clock_of(CLOCK_PROCESS_CPUTIME_ID);
}

/* Busy: how much of the machine a run keeps at work. */

typedef struct npg_busy {
    double wall_s, cpu_s, children_s; /* children: helper processes that have ended */
} npg_busy;

npg_busy npg_busy_now(void);

/* What went by since then: {wall_s, process_cpu_s, children_cpu_s, busy_share}.  busy_share is processor
 * time, children's included, over wall time times cores: 1 where no core ever waited. */
json_t *npg_busy_since(const npg_busy *then);

#endif
