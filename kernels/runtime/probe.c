/* Probe: whether the OpenCL drivers can be asked for their devices at all. */
#include "kernels/runtime/device_internal.h"

#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/child.h"
#include "pipeline/memory.h"

#define TIME_LIMIT_S 60 /* the first contact with a GPU that sleeps takes up to ten seconds */

/* Where drivers read what processors, memory and devices there are: what of it is not here. */
static const char *missing_mount(void)
{
    if (access("/sys/devices/system/cpu", R_OK | X_OK))
        return "; /sys is not mounted here (mount -t sysfs sysfs /sys)";
    if (access("/proc/self", R_OK | X_OK)) return "; /proc is not mounted here (mount -t proc proc /proc)";
    return "";
}

static npg_status ask(void)
{
    npg_child_result answer;
    npg_child_job job = {.program = "neupig-devices", .output_max = 4096, .time_limit_s = TIME_LIMIT_S};
    npg_status status = npg_child_run(&answer, &job);
    /* where the host ignores SIGCHLD the end of the answer is the only sign */
    bool is_whole = !status && answer.output_size == strlen(NPG_PROBE_ANSWER) &&
                    !memcmp(answer.output, NPG_PROBE_ANSWER, answer.output_size);
    if (!status) npg_release(&answer.output);
    if (!status && !is_whole)
        status = npg_error(NPG_FAILED, "neupig-devices ended early: %s", answer.last_line);
    if (status != NPG_FAILED) return status;
    char cause[1024];
    snprintf(cause, sizeof cause, "%s", npg_error_text());
    return npg_error(NPG_DEVICE, "OpenCL can't list its devices%s: %s", missing_mount(), cause);
}

npg_status npg_probe_drivers(void)
{
    static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
    static bool is_well;
    pthread_mutex_lock(&lock);
    npg_status status = is_well ? NPG_OK : ask();
    if (!status) is_well = true;
    pthread_mutex_unlock(&lock);
    return status;
}
