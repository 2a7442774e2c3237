/* Device: opening OpenCL devices, buffers. */
#include "kernels/runtime/device.h"

#include <ctype.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "kernels/runtime/device_internal.h"
#include "pipeline/child.h"
#include "pipeline/file.h"

#define CL_TRY(call) NPG_TRY(npg_cl_status(call, #call))

/* ---- errors ---- */

static const char *name_of(cl_int code)
{
    static const struct {
        cl_int code;
        const char *name;
    } names[] = {
        {-1, "CL_DEVICE_NOT_FOUND"},
        {-2, "CL_DEVICE_NOT_AVAILABLE"},
        {-3, "CL_COMPILER_NOT_AVAILABLE"},
        {-4, "CL_MEM_OBJECT_ALLOCATION_FAILURE"},
        {-5, "CL_OUT_OF_RESOURCES"},
        {-6, "CL_OUT_OF_HOST_MEMORY"},
        {-11, "CL_BUILD_PROGRAM_FAILURE"},
        {-30, "CL_INVALID_VALUE"},
        {-34, "CL_INVALID_CONTEXT"},
        {-38, "CL_INVALID_MEM_OBJECT"},
        {-45, "CL_INVALID_PROGRAM_EXECUTABLE"},
        {-46, "CL_INVALID_KERNEL_NAME"},
        {-48, "CL_INVALID_KERNEL"},
        {-49, "CL_INVALID_ARG_INDEX"},
        {-50, "CL_INVALID_ARG_VALUE"},
        {-51, "CL_INVALID_ARG_SIZE"},
        {-52, "CL_INVALID_KERNEL_ARGS"},
        {-54, "CL_INVALID_WORK_GROUP_SIZE"},
        {-55, "CL_INVALID_WORK_ITEM_SIZE"},
        {-61, "CL_INVALID_BUFFER_SIZE"},
        {-1001, "CL_PLATFORM_NOT_FOUND_KHR"},
    };
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (names[i].code == code) return names[i].name;
    return "OpenCL error";
}

npg_status npg_cl_status(cl_int code, const char *what)
{
    if (code == CL_SUCCESS) return NPG_OK;
    bool is_memory = code == CL_MEM_OBJECT_ALLOCATION_FAILURE || code == CL_OUT_OF_RESOURCES ||
                     code == CL_OUT_OF_HOST_MEMORY;
    return npg_error(is_memory ? NPG_MEMORY : NPG_DEVICE, "%s: %s (%d)", what, name_of(code), code);
}

/* ---- where compiled kernels are kept ----
 *
 * PoCL's cache is not safe between processes and goes stale between versions, so each version of neupig has its own
 * folders, numbered, and a process locks the first one that is free until it ends. */

#define SLOTS 256 /* processes at work at the same time, at most */

static unsigned long long hash_of_sources(void)
{
    XXH64_hash_t hash = 0;
    for (const npg_kernel_source *source = npg_kernel_sources; source->name; source++)
        hash = XXH64(source->text, strlen(source->text), hash);
    return hash;
}

/* Compiled kernels are run: where others may put some of theirs is no place for them. */
static bool is_own(const char *folder)
{
    struct stat info;
    return !npg_make_folder(folder) && !lstat(folder, &info) && S_ISDIR(info.st_mode) &&
           info.st_uid == getuid() && !(info.st_mode & S_IWOTH);
}

/* Lock the first folder below a base that no other process has, until this one ends. */
static bool enter_below(const char *base)
{
    char folder[4096];
    int fd;
    if (!is_own(base)) return false;
    for (int slot = 0; slot < SLOTS; slot++) {
        snprintf(folder, sizeof folder, "%s/%s-%016llx/%d", base, npg_version(), hash_of_sources(), slot);
        npg_status status = npg_file_lock(&fd, folder, "lock", false);
        if (!status) return !setenv("POCL_CACHE_DIR", folder, 1);
        if (fd >= 0) close(fd);
        if (status != NPG_USAGE) return false;
    }
    return false;
}

/* A cache folder that the user has set (POCL_CACHE_DIR) is left alone.  NPG_DISK when no folder can be made. */
static npg_status choose_folder(void)
{
    const char *cache = getenv("XDG_CACHE_HOME"), *home = getenv("HOME"), *temp = getenv("TMPDIR");
    char base[2048] = "";
    if (getenv("POCL_CACHE_DIR")) return NPG_OK;
    if (cache && cache[0] == '/')
        snprintf(base, sizeof base, "%s/neupig", cache);
    else if (home && home[0] == '/')
        snprintf(base, sizeof base, "%s/.cache/neupig", home);
    if (base[0] && enter_below(base)) return NPG_OK;
    snprintf(base, sizeof base, "%s/neupig-%ld", temp && temp[0] == '/' ? temp : "/tmp", (long)getuid());
    return enter_below(base) ? NPG_OK : npg_error(NPG_DISK, "%s: no place for compiled kernels", base);
}

/* ---- whether the drivers can be asked for their devices at all ---- */

#define TIME_LIMIT_S 60 /* the first contact with a GPU that sleeps takes up to ten seconds */

/* Where drivers read what processors, memory and devices there are: what of it is not here. */
static const char *missing_mount(void)
{
    if (access("/sys/devices/system/cpu", R_OK | X_OK))
        return "; /sys is not mounted here (mount -t sysfs sysfs /sys)";
    if (access("/proc/self", R_OK | X_OK)) return "; /proc is not mounted here (mount -t proc proc /proc)";
    return "";
}

/* In a process of its own (devices_main.c): a driver that can't work on a machine may end the process that asks, as
 * PoCL does in a root without /sys, and a library must not end its host.  NPG_DEVICE with the driver's last line and
 * what is missing; errors that a driver returns are left to the caller's own call. */
static npg_status ask_drivers(void)
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

/* Before the first OpenCL call, once per process when all is well: about 30 ms. */
static npg_status prepare(void)
{
    static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
    static bool is_ready;
    pthread_mutex_lock(&lock);
    npg_status status = is_ready ? NPG_OK : choose_folder();
    if (!status && !is_ready) status = ask_drivers();
    is_ready = !status;
    pthread_mutex_unlock(&lock);
    return status;
}

/* ---- finding devices ---- */

/* ids: of NPG_DEVICES_MAX places. */
static npg_status all_devices(cl_device_id *ids, size_t *count)
{
    cl_platform_id platforms[NPG_PLATFORMS_MAX];
    cl_uint platform_count = 0, found;
    *count = 0;
    NPG_TRY(prepare());
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
    NPG_TRY(choose_device(device, spec));
    device->tuning = tuning ? tuning : tuning_of_kind(&device->info);
    device->context = clCreateContext(NULL, 1, &device->id, NULL, NULL, &code);
    NPG_TRY(npg_cl_status(code, "clCreateContext"));
    device->queue = clCreateCommandQueue(device->context, device->id, 0, &code);
    return npg_cl_status(code, "clCreateCommandQueue");
}

npg_status npg_device_open(npg_device **out, const char *spec, const npg_tuning *tuning)
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
