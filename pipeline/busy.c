/* Busy: clocks of the process and of its children. */
#include "pipeline/clock.h"

#include <sys/resource.h>
#include <sys/time.h>
#include <unistd.h>

static double seconds_of(struct timeval time)
{
    return (double)time.tv_sec + 1e-6 * (double)time.tv_usec;
}

npg_busy npg_busy_now(void)
{
    struct rusage children;
    npg_busy now = {.wall_s = npg_clock_s(), .cpu_s = npg_clock_process_s()};
    if (!getrusage(RUSAGE_CHILDREN, &children))
        now.children_s = seconds_of(children.ru_utime) + seconds_of(children.ru_stime);
    return now;
}

json_t *npg_busy_since(const npg_busy *then)
{
    npg_busy now = npg_busy_now();
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    double wall_s = now.wall_s - then->wall_s, cpu_s = now.cpu_s - then->cpu_s,
           children_s = now.children_s - then->children_s, room_s = wall_s * (double)(cores < 1 ? 1 : cores);
    return json_pack("{s:f, s:f, s:f, s:f}", "wall_s", wall_s, "process_cpu_s", cpu_s, "children_cpu_s",
                     children_s, "busy_share", room_s > 0 ? (cpu_s + children_s) / room_s : 0.0);
}
