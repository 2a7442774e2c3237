/* Device: what its files share. */
#ifndef NPG_DEVICE_INTERNAL_H
#define NPG_DEVICE_INTERNAL_H

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <CL/cl_ext.h>

#include "kernels/runtime/cl_error.h"
#include "kernels/runtime/device.h"

#define NPG_KERNELS_MAX 16 /* of one program; mlp has the most, 6 */

struct npg_device {
    npg_device_info info;
    const npg_tuning *tuning;
    cl_device_id id;
    cl_context context;
    cl_command_queue queue;
    npg_program *programs; /* built so far, owned                                             */
    bool is_in_cache;      /* the kernel cache has been entered and must be left              */
    bool is_distrusted;    /* it has computed wrong: none of its programs goes into the cache */
};

/* Release all programs; those that were built from their text are put into the cache first, unless the device
 * is distrusted. */
void npg_programs_close(npg_device *device);

#endif
