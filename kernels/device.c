/* Device: opening OpenCL devices, buffers, programs, launches. */
#include "device.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cl_error.h"
#include "kernel_cache.h"
#include "kernel_sources.h"

#define KERNELS_MAX 16

struct npg_device {
    npg_device_info info;
    cl_device_id id;
    cl_context context;
    cl_command_queue queue;
};

struct npg_program {
    npg_device *device; /* loan */
    const char *name;   /* of the source, static */
    cl_program program;
    cl_kernel kernels[KERNELS_MAX];
    char kernel_names[KERNELS_MAX][48];
    cl_uint kernel_count;
};

#define CL_TRY(call) NPG_TRY(npg_cl_status(call, #call))

/* ---- finding devices ---- */

static npg_status all_devices(cl_device_id *ids, size_t capacity, size_t *count)
{
    cl_platform_id platforms[16];
    cl_uint platform_count = 0, found;
    *count = 0;
    cl_int code = clGetPlatformIDs(16, platforms, &platform_count);
    if (code == -1001 || (!code && !platform_count))
        return npg_error(NPG_DEVICE,
                         "no OpenCL driver is installed (on Debian: apt-get install pocl-opencl-icd)");
    NPG_TRY(npg_cl_status(code, "clGetPlatformIDs"));
    for (cl_uint i = 0; i < platform_count && i < 16; i++) {
        code = clGetDeviceIDs(platforms[i], CL_DEVICE_TYPE_ALL, (cl_uint)(capacity - *count), ids + *count,
                              &found);
        if (code == CL_DEVICE_NOT_FOUND) continue;
        NPG_TRY(npg_cl_status(code, "clGetDeviceIDs"));
        *count += found < capacity - *count ? found : capacity - *count;
    }
    return NPG_OK;
}

static npg_status read_facts(npg_device_info *info, cl_device_id id)
{
    cl_platform_id platform;
    cl_device_type type;
    cl_uint units;
    cl_ulong memory;
    memset(info, 0, sizeof *info);
    CL_TRY(clGetDeviceInfo(id, CL_DEVICE_NAME, sizeof info->name - 1, info->name, NULL));
    CL_TRY(clGetDeviceInfo(id, CL_DEVICE_VERSION, sizeof info->version - 1, info->version, NULL));
    CL_TRY(clGetDeviceInfo(id, CL_DEVICE_TYPE, sizeof type, &type, NULL));
    CL_TRY(clGetDeviceInfo(id, CL_DEVICE_MAX_COMPUTE_UNITS, sizeof units, &units, NULL));
    CL_TRY(clGetDeviceInfo(id, CL_DEVICE_GLOBAL_MEM_SIZE, sizeof memory, &memory, NULL));
    CL_TRY(clGetDeviceInfo(id, CL_DEVICE_PLATFORM, sizeof platform, &platform, NULL));
    CL_TRY(clGetPlatformInfo(platform, CL_PLATFORM_NAME, sizeof info->platform - 1, info->platform, NULL));
    info->is_cpu = type & CL_DEVICE_TYPE_CPU;
    info->units = (int)units;
    info->memory_bytes = memory;
    return NPG_OK;
}

npg_status npg_device_describe(size_t i, npg_device_info *info)
{
    cl_device_id ids[32];
    size_t count;
    NPG_TRY(npg_kernel_cache_enter());
    npg_status status = all_devices(ids, 32, &count);
    if (!status) status = i < count ? read_facts(info, ids[i]) : NPG_END;
    npg_kernel_cache_leave();
    return status;
}

static bool has_part(const char *text, const char *part)
{
    size_t size = strlen(part);
    for (; *text; text++)
        if (!strncasecmp(text, part, size)) return true;
    return false;
}

static bool fits(const npg_device_info *info, size_t i, const char *spec)
{
    char *end;
    unsigned long number = strtoul(spec, &end, 10);
    if (isdigit((unsigned char)*spec) && !*end) return number == i;
    if (!strcmp(spec, "cpu")) return info->is_cpu;
    if (!strcmp(spec, "gpu")) return !info->is_cpu;
    return has_part(info->name, spec);
}

static npg_status choose_device(npg_device *device, const char *spec)
{
    cl_device_id ids[32];
    size_t count;
    char list[1024] = "";
    NPG_TRY(all_devices(ids, 32, &count));
    for (int any = 0; any < (*spec ? 1 : 2); any++)
        for (size_t i = 0; i < count; i++) {
            NPG_TRY(read_facts(&device->info, ids[i]));
            device->id = ids[i];
            if (*spec ? fits(&device->info, i, spec) : any || device->info.is_cpu) return NPG_OK;
            size_t used = strlen(list);
            snprintf(list + used, sizeof list - used, " %zu \"%s\"", i, device->info.name);
        }
    return npg_error(NPG_DEVICE, "no OpenCL device fits \"%s\"; there is:%s", spec, *list ? list : " none");
}

npg_status npg_device_open(npg_device **out, const char *spec)
{
    npg_device *device;
    cl_int code = 0;
    *out = NULL;
    NPG_TRY(npg_kernel_cache_enter());
    npg_status status = npg_alloc(&device, NPG_FOR_DEVICE, sizeof *device);
    if (status) {
        npg_kernel_cache_leave();
        return status;
    }
    status = choose_device(device, spec && strcmp(spec, "auto") != 0 ? spec : "");
    if (!status) {
        device->context = clCreateContext(NULL, 1, &device->id, NULL, NULL, &code);
        status = npg_cl_status(code, "clCreateContext");
    }
    if (!status) {
        device->queue = clCreateCommandQueue(device->context, device->id, 0, &code);
        status = npg_cl_status(code, "clCreateCommandQueue");
    }
    if (status) npg_device_close(&device);
    *out = device;
    return status;
}

void npg_device_close(npg_device **slot)
{
    if (!slot || !*slot) return;
    npg_device *device = *slot;
    if (device->queue) clFinish(device->queue);
    if (device->queue) clReleaseCommandQueue(device->queue);
    if (device->context) clReleaseContext(device->context);
    npg_release(slot);
    npg_kernel_cache_leave();
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
    if (!size) size = 64;
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

/* ---- programs ---- */

static const char *source_of(const char *name, const char **static_name)
{
    for (const npg_kernel_source *source = npg_kernel_sources; source->name; source++)
        if (!strcmp(source->name, name)) {
            *static_name = source->name;
            return source->text;
        }
    return NULL;
}

static npg_status build_failure(const npg_program *program, cl_int code)
{
    char log[800] = "";
    size_t size = 0;
    clGetProgramBuildInfo(program->program, program->device->id, CL_PROGRAM_BUILD_LOG, 0, NULL, &size);
    if (size && size <= sizeof log)
        clGetProgramBuildInfo(program->program, program->device->id, CL_PROGRAM_BUILD_LOG, sizeof log, log,
                              NULL);
    return npg_error_prefix(npg_cl_status(code, "clBuildProgram"), "kernels/%s.cl on %s: %s", program->name,
                            program->device->info.name, log);
}

static npg_status make_kernels(npg_program *program)
{
    CL_TRY(clCreateKernelsInProgram(program->program, KERNELS_MAX, program->kernels, &program->kernel_count));
    for (cl_uint i = 0; i < program->kernel_count; i++)
        CL_TRY(clGetKernelInfo(program->kernels[i], CL_KERNEL_FUNCTION_NAME, sizeof program->kernel_names[i],
                               program->kernel_names[i], NULL));
    return NPG_OK;
}

static npg_status build_program(npg_program *program, const char *text, const char *constants)
{
    char flags[512];
    cl_int code;
    snprintf(flags, sizeof flags, "-cl-std=CL1.2 -cl-mad-enable -cl-no-signed-zeros %s", constants);
    program->program = clCreateProgramWithSource(program->device->context, 1, &text, NULL, &code);
    NPG_TRY(npg_cl_status(code, "clCreateProgramWithSource"));
    code = clBuildProgram(program->program, 1, &program->device->id, flags, NULL, NULL);
    if (code) return build_failure(program, code);
    return make_kernels(program);
}

npg_status npg_program_open(npg_program **out, npg_device *device, const char *name, const char *constants)
{
    npg_program *program;
    const char *static_name, *text = source_of(name, &static_name);
    *out = NULL;
    if (!text) return npg_error(NPG_USAGE, "there are no kernels named %s", name);
    NPG_TRY(npg_alloc(&program, NPG_FOR_DEVICE, sizeof *program));
    program->device = device;
    program->name = static_name;
    npg_status status = build_program(program, text, constants);
    if (status) npg_program_close(&program);
    *out = program;
    return status;
}

void npg_program_close(npg_program **slot)
{
    if (!slot || !*slot) return;
    for (cl_uint i = 0; i < (*slot)->kernel_count; i++) clReleaseKernel((*slot)->kernels[i]);
    if ((*slot)->program) clReleaseProgram((*slot)->program);
    npg_release(slot);
}

/* ---- launches ---- */

static cl_int set_argument(cl_kernel kernel, cl_uint i, const npg_argument *argument)
{
    cl_mem memory;
    switch (argument->kind) {
    case 0: memory = argument->buffer->memory; return clSetKernelArg(kernel, i, sizeof memory, &memory);
    case 1: return clSetKernelArg(kernel, i, sizeof argument->number, &argument->number);
    default: return clSetKernelArg(kernel, i, sizeof argument->real, &argument->real);
    }
}

npg_status npg_launch_on(npg_program *program, const char *name, size_t x, size_t y, size_t local,
                         const npg_argument *arguments, size_t argument_count)
{
    cl_uint k = 0;
    while (k < program->kernel_count && strcmp(program->kernel_names[k], name)) k++;
    if (k == program->kernel_count)
        return npg_error(NPG_USAGE, "kernels/%s.cl has no kernel %s", program->name, name);
    if (!x || !y) return NPG_OK;
    cl_kernel kernel = program->kernels[k];
    for (cl_uint i = 0; i < argument_count; i++)
        NPG_TRY(npg_error_prefix(npg_cl_status(set_argument(kernel, i, arguments + i), "clSetKernelArg"),
                                 "kernel %s, argument %u", name, i));
    if (!local) local = program->device->info.is_cpu ? 1 : 64;
    size_t global[2] = {(x + local - 1) / local * local, y}, groups[2] = {local, 1};
    cl_int code = clEnqueueNDRangeKernel(program->device->queue, kernel, y > 1 ? 2 : 1, NULL, global, groups,
                                         0, NULL, NULL);
    return npg_error_prefix(npg_cl_status(code, "clEnqueueNDRangeKernel"), "kernel %s over %zu x %zu", name,
                            x, y);
}
