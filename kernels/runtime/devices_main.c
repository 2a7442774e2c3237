/* neupig-devices: asks every OpenCL driver for its devices, in a process of its own,
 * because a driver may abort or hang there.  It prints one line when it has got through,
 * whatever errors the drivers returned (device.c). */
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <string.h>
#include <sys/prctl.h>
#include <unistd.h>

#include "kernels/runtime/device_internal.h"
#include "pipeline/child.h"

static void ask_platform(cl_platform_id platform)
{
    cl_device_id devices[NPG_DEVICES_MAX];
    cl_uint count = 0;
    cl_ulong memory;
    if (clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, NPG_DEVICES_MAX, devices, &count)) return;
    for (cl_uint i = 0; i < count && i < NPG_DEVICES_MAX; i++)
        clGetDeviceInfo(devices[i], CL_DEVICE_GLOBAL_MEM_SIZE, sizeof memory, &memory, NULL);
}

int main(int argc, char **argv)
{
    cl_platform_id platforms[NPG_PLATFORMS_MAX];
    cl_uint count = 0;
    npg_end_with_parent(argc > 1 ? argv[1] : NULL, SIGKILL);
    prctl(PR_SET_DUMPABLE, 0); /* its death is reported; no core file for it */
    if (!clGetPlatformIDs(NPG_PLATFORMS_MAX, platforms, &count))
        for (cl_uint i = 0; i < count && i < NPG_PLATFORMS_MAX; i++) ask_platform(platforms[i]);
    ssize_t put = write(STDOUT_FILENO, NPG_PROBE_ANSWER, strlen(NPG_PROBE_ANSWER));
    _exit(put < 0); /* without the drivers' own ends, which are no concern here */
}
