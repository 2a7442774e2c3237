#ifndef NPG_KERNELS_DEVICE_INTERNAL_H
#define NPG_KERNELS_DEVICE_INTERNAL_H

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <CL/cl_ext.h>

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

/* The text of every .cl file, embedded by the build. */

typedef struct npg_kernel_source {
    const char *name, *text; /* "mlp", the whole file; the list ends with NULL */
} npg_kernel_source;

extern const npg_kernel_source npg_kernel_sources[];

/* More OpenCL platforms (drivers), and devices of all together, than these are neither asked nor listed. */
#define NPG_PLATFORMS_MAX 16
#define NPG_DEVICES_MAX   32

/* What neupig-devices prints when it has got through. */
#define NPG_PROBE_ANSWER "asked\n"

#endif
