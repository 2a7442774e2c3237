/* Device: opening OpenCL devices, buffers. */
#include "kernels/runtime/device.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "kernels/runtime/device_internal.h"

#define CL_TRY(call) NPG_TRY(npg_cl_status(call, #call))

/* ---- finding devices ---- */

/* ids: of NPG_DEVICES_MAX places. */
static npg_status all_devices(cl_device_id *ids, size_t *count)
{
    cl_platform_id platforms[NPG_PLATFORMS_MAX];
    cl_uint platform_count = 0, found;
    *count = 0;
    NPG_TRY(npg_probe_drivers());
    cl_int code = clGetPlatformIDs(NPG_PLATFORMS_MAX, platforms, &platform_count);
    if (code == CL_PLATFORM_NOT_FOUND_KHR || (!code && !platform_count))
        return npg_error(NPG_DEVICE,
                         "no OpenCL driver is installed (on Debian: apt-get install pocl-opencl-icd)");
    NPG_TRY(npg_cl_status(code, "clGetPlatformIDs"));
    for (cl_uint i = 0; i < platform_count && i < NPG_PLATFORMS_MAX && *count < NPG_DEVICES_MAX; i++) {
        size_t room = NPG_DEVICES_MAX - *count;
        code = clGetDeviceIDs(platforms[i], CL_DEVICE_TYPE_ALL, (cl_uint)room, ids + *count, &found);
        if (code == CL_DEVICE_NOT_FOUND) continue;
        NPG_TRY(npg_cl_status(code, "clGetDeviceIDs"));
        *count += found < room ? found : room;
    }
    return NPG_OK;
}

static npg_status read_facts(npg_device_info *info, cl_device_id id)
{
    cl_platform_id platform;
    cl_device_type type;
    cl_uint units, vector;
    cl_ulong memory;
    memset(info, 0, sizeof *info);
    CL_TRY(clGetDeviceInfo(id, CL_DEVICE_NAME, sizeof info->name - 1, info->name, NULL));
    CL_TRY(clGetDeviceInfo(id, CL_DEVICE_VERSION, sizeof info->version - 1, info->version, NULL));
    CL_TRY(clGetDeviceInfo(id, CL_DEVICE_TYPE, sizeof type, &type, NULL));
    CL_TRY(clGetDeviceInfo(id, CL_DEVICE_MAX_COMPUTE_UNITS, sizeof units, &units, NULL));
    CL_TRY(clGetDeviceInfo(id, CL_DEVICE_GLOBAL_MEM_SIZE, sizeof memory, &memory, NULL));
    CL_TRY(clGetDeviceInfo(id, CL_DRIVER_VERSION, sizeof info->driver - 1, info->driver, NULL));
    CL_TRY(clGetDeviceInfo(id, CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT, sizeof vector, &vector, NULL));
    CL_TRY(clGetDeviceInfo(id, CL_DEVICE_PLATFORM, sizeof platform, &platform, NULL));
    CL_TRY(clGetPlatformInfo(platform, CL_PLATFORM_NAME, sizeof info->platform - 1, info->platform, NULL));
    info->is_cpu = type & CL_DEVICE_TYPE_CPU;
    info->units = (int)units;
    info->vector = (int)vector;
    info->memory_bytes = memory;
    return NPG_OK;
}

npg_status npg_device_describe(size_t i, npg_device_info *info)
{
    cl_device_id ids[NPG_DEVICES_MAX];
    size_t count;
    NPG_TRY(npg_kernel_cache_enter());
    NPG_TRY(all_devices(ids, &count));
    return i < count ? read_facts(info, ids[i]) : NPG_END;
}

static bool contains_ignoring_case(const char *text, const char *part)
{
    size_t size = strlen(part);
    for (; *text; text++)
        if (!strncasecmp(text, part, size)) return true;
    return false;
}

static bool matches_spec(const npg_device_info *info, size_t i, const char *spec)
{
    char *end;
    unsigned long number = strtoul(spec, &end, 10);
    if (isdigit((unsigned char)*spec) && !*end) return number == i;
    if (!strcmp(spec, "cpu")) return info->is_cpu;
    if (!strcmp(spec, "gpu")) return !info->is_cpu;
    return contains_ignoring_case(info->name, spec);
}

static npg_status choose_device(npg_device *device, const char *spec)
{
    cl_device_id ids[NPG_DEVICES_MAX];
    size_t count;
    char list[1024] = "";
    NPG_TRY(all_devices(ids, &count));
    for (int any = 0; any < (*spec ? 1 : 2); any++)
        for (size_t i = 0; i < count; i++) {
            NPG_TRY(read_facts(&device->info, ids[i]));
            device->id = ids[i];
            if (*spec ? matches_spec(&device->info, i, spec) : any || device->info.is_cpu) return NPG_OK;
            size_t used = strlen(list);
            snprintf(list + used, sizeof list - used, " %zu \"%s\"", i, device->info.name);
        }
    return npg_error(NPG_DEVICE, "no OpenCL device fits \"%s\"; there is:%s", spec, *list ? list : " none");
}

/* ---- opening ---- */

npg_status npg_device_open(npg_device **out, const char *spec)
{
    return npg_device_open_tuned(out, spec, NULL);
}

const npg_tuning *npg_device_tuning(const npg_device *device)
{
    return device->tuning;
}

/* 16 floats in a vector: AVX-512. */
static const npg_tuning *tuning_of_kind(const npg_device_info *info)
{
    if (!info->is_cpu) return &npg_tuning_gpu;
    return info->vector >= 16 ? &npg_tuning_wide : &npg_tuning_narrow;
}

static npg_status fill_device(npg_device *device, const char *spec, const npg_tuning *tuning)
{
    cl_int code;
    NPG_TRY(npg_kernel_cache_enter());
    NPG_TRY(choose_device(device, spec));
    device->tuning = tuning ? tuning : tuning_of_kind(&device->info);
    device->context = clCreateContext(NULL, 1, &device->id, NULL, NULL, &code);
    NPG_TRY(npg_cl_status(code, "clCreateContext"));
    device->queue = clCreateCommandQueue(device->context, device->id, 0, &code);
    return npg_cl_status(code, "clCreateCommandQueue");
}

npg_status npg_device_open_tuned(npg_device **out, const char *spec, const npg_tuning *tuning)
{
    npg_device *device;
    *out = NULL;
    NPG_TRY(npg_alloc(&device, NPG_FOR_DEVICE, sizeof *device));
    npg_status status = fill_device(device, spec && strcmp(spec, "auto") != 0 ? spec : "", tuning);
    if (status) npg_device_close(&device);
    *out = device;
    return status;
}

void npg_device_close(npg_device **slot)
{
    if (!slot || !*slot) return;
    npg_device *device = *slot;
    if (device->queue) clFinish(device->queue);
    npg_programs_close(device);
    if (device->queue) clReleaseCommandQueue(device->queue);
    if (device->context) clReleaseContext(device->context);
    npg_release(slot);
}

const npg_device_info *npg_device_facts(const npg_device *device)
{
    return &device->info;
}

npg_status npg_device_finish(npg_device *device)
{
    CL_TRY(clFinish(device->queue));
    return NPG_OK;
}

/* ---- buffers ---- */

npg_status npg_buffer_open(npg_buffer *buffer, npg_device *device, size_t size)
{
    cl_int code;
    if (!size) size = 64; /* OpenCL refuses buffers of 0 bytes */
    *buffer = (npg_buffer){device, NULL, size};
    NPG_TRY(npg_memory_count(NPG_FOR_DEVICE, (ptrdiff_t)size));
    buffer->memory = clCreateBuffer(device->context, CL_MEM_READ_WRITE, size, NULL, &code);
    if (code) {
        npg_memory_count(NPG_FOR_DEVICE, -(ptrdiff_t)size);
        buffer->memory = NULL;
        return npg_error_prefix(npg_cl_status(code, "clCreateBuffer"), "device buffer of %zu bytes", size);
    }
    npg_status status = npg_buffer_zero(buffer);
    if (status) npg_buffer_close(buffer);
    return status;
}

void npg_buffer_close(npg_buffer *buffer)
{
    if (!buffer || !buffer->memory) return;
    clReleaseMemObject(buffer->memory);
    npg_memory_count(NPG_FOR_DEVICE, -(ptrdiff_t)buffer->size);
    *buffer = (npg_buffer){0};
}

npg_status npg_buffer_write(npg_buffer *buffer, size_t offset, const void *data, size_t size)
{
    if (!size) return NPG_OK;
    CL_TRY(clEnqueueWriteBuffer(buffer->device->queue, buffer->memory, CL_TRUE, offset, size, data, 0, NULL,
                                NULL));
    return NPG_OK;
}

npg_status npg_buffer_read(const npg_buffer *buffer, size_t offset, void *data, size_t size)
{
    if (!size) return NPG_OK;
    CL_TRY(clEnqueueReadBuffer(buffer->device->queue, buffer->memory, CL_TRUE, offset, size, data, 0, NULL,
                               NULL));
    return NPG_OK;
}

npg_status npg_buffer_zero(npg_buffer *buffer)
{
    const cl_uchar zero = 0;
    CL_TRY(
        clEnqueueFillBuffer(buffer->device->queue, buffer->memory, &zero, 1, 0, buffer->size, 0, NULL, NULL));
    return NPG_OK;
}

npg_status npg_buffer_from(npg_buffer *buffer, npg_device *device, const void *data, size_t size)
{
    NPG_TRY(npg_buffer_open(buffer, device, size));
    return npg_buffer_write(buffer, 0, data, size);
}
