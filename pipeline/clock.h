/* Clocks that never go back. */
#ifndef NPG_CLOCK_H
#define NPG_CLOCK_H

#include <time.h>

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

#endif
