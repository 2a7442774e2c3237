#ifndef NPG_KERNELS_DEVICE_INTERNAL_H
#define NPG_KERNELS_DEVICE_INTERNAL_H

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <CL/cl_ext.h>
#include <stdbool.h>

#include "kernels/runtime/device.h"
#include "pipeline/status.h"

/* Names of OpenCL errors, and the status they become. */

/* NPG_OK for CL_SUCCESS; else NPG_MEMORY or NPG_DEVICE with "what: CL_NAME (code)". */
npg_status npg_cl_status(cl_int code, const char *what);

/* Device: what its files share. */

#define NPG_KERNELS_MAX 16 /* of one program; mlp has the most, 6 */

struct npg_device {
    npg_device_info info;
    const npg_tuning *tuning;
    cl_device_id id;
    cl_context context;
    cl_command_queue queue;
    npg_program *programs; /* built so far, owned                                             */
};

void npg_programs_close(npg_device *device);

/* Kernel cache: where PoCL keeps compiled kernels.  Its cache is not safe between processes and goes stale
 * between versions, so each version of neupig has its own folders, numbered, and a process locks the first one
 * that is free until it ends. */

/* Point the driver at the folder, once.  Call before the first OpenCL call.  A cache folder that the user has set
 * (POCL_CACHE_DIR) is left alone.  NPG_DISK when no folder can be made.  Threads: any. */
npg_status npg_kernel_cache_enter(void);

/* The text of every .cl file, embedded by the build. */

typedef struct npg_kernel_source {
    const char *name, *text; /* "mlp", the whole file; the list ends with NULL */
} npg_kernel_source;

extern const npg_kernel_source npg_kernel_sources[];

/* Probe: whether the OpenCL drivers can be asked for their devices at all. */

/* More OpenCL platforms (drivers), and devices of all together, than these are neither asked nor listed. */
#define NPG_PLATFORMS_MAX 16
#define NPG_DEVICES_MAX   32

/* What neupig-devices prints when it has got through. */
#define NPG_PROBE_ANSWER "asked\n"

/* Ask them first in a process of its own (devices_main.c): a driver that can't work on a machine may end
 * the process that asks, as PoCL does in a root without /sys, and a library must not end its host.  Once
 * per process when all is well, about 30 ms.  NPG_DEVICE with the driver's last line and what is missing;
 * errors that a driver returns are left to the caller's own call.  Threads: any. */
npg_status npg_probe_drivers(void);

#endif
