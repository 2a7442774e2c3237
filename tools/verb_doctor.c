/* neupig doctor: what this machine offers, and whether its devices compute right. */
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <embree3/rtcore.h>
#include <jansson.h>
#include <meshoptimizer.h>
#include <png.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <xxhash.h>
#include <zstd.h>

#include "cli.h"

typedef struct settings {
    bool json;
} settings;

const npg_option npg_doctor_options[] = {{"json", "Print one JSON object instead of text", NPG_OPTION_FLAG,
                                          offsetof(settings, json), "no", 0, 0, NULL, NULL},
                                         {0}};

enum { DEVICES_MAX = 64, PLATFORMS_MAX = 16 };

/* ---- a small known result ---- */

enum { TEST_ITEMS = 1000 };

static const char test_source[] = "kernel void check(global const float *x, global float *y, float a)\n"
                                  "{\n"
                                  "    size_t i = get_global_id(0);\n"
                                  "    y[i] = fma(a, x[i], (float)i);\n"
                                  "}\n";

static const char *launch(cl_context context, cl_device_id device, cl_command_queue queue, cl_kernel kernel,
                          const float *x, float *y)
{
    cl_int code = CL_SUCCESS, code_y = CL_SUCCESS;
    const float a = 3;
    size_t bytes = TEST_ITEMS * sizeof(float), items = TEST_ITEMS;
    (void)device;
    cl_mem in =
        clCreateBuffer(context, CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR, bytes, (void *)(uintptr_t)x, &code);
    cl_mem out = clCreateBuffer(context, CL_MEM_WRITE_ONLY, bytes, NULL, &code_y);
    const char *fault = NULL;
    if (code || code_y)
        fault = "no buffers";
    else if (clSetKernelArg(kernel, 0, sizeof in, &in) || clSetKernelArg(kernel, 1, sizeof out, &out) ||
             clSetKernelArg(kernel, 2, sizeof a, &a) ||
             clEnqueueNDRangeKernel(queue, kernel, 1, NULL, &items, NULL, 0, NULL, NULL) ||
             clEnqueueReadBuffer(queue, out, CL_TRUE, 0, bytes, y, 0, NULL, NULL))
        fault = "the kernel did not run";
    if (in) clReleaseMemObject(in);
    if (out) clReleaseMemObject(out);
    return fault;
}

static const char *build_and_launch(cl_context context, cl_device_id device, const float *x, float *y)
{
    const char *source = test_source, *fault = NULL;
    cl_int code;
    cl_command_queue queue = clCreateCommandQueue(context, device, 0, &code);
    if (code) return "no command queue";
    cl_program program = clCreateProgramWithSource(context, 1, &source, NULL, &code);
    if (code || clBuildProgram(program, 1, &device, "", NULL, NULL)) fault = "the compiler failed";
    cl_kernel kernel = fault ? NULL : clCreateKernel(program, "check", &code);
    if (!fault) fault = code ? "no kernel" : launch(context, device, queue, kernel, x, y);
    if (kernel) clReleaseKernel(kernel);
    if (program) clReleaseProgram(program);
    clReleaseCommandQueue(queue);
    return fault;
}

/* NULL when the device computed what it should, else what went wrong. */
static const char *test_device(cl_device_id device)
{
    static float x[TEST_ITEMS], y[TEST_ITEMS];
    cl_int code;
    cl_context context = clCreateContext(NULL, 1, &device, NULL, NULL, &code);
    if (code) return "no context";
    for (int i = 0; i < TEST_ITEMS; i++) {
        x[i] = (float)i * 0.5f;
        y[i] = -1;
    }
    const char *fault = build_and_launch(context, device, x, y);
    clReleaseContext(context);
    for (int i = 0; i < TEST_ITEMS && !fault; i++)
        if (y[i] != (float)i * 2.5f) fault = "a wrong result";
    return fault;
}

/* ---- devices ---- */

static void device_text(char *out, size_t size, cl_device_id device, cl_device_info what)
{
    out[0] = 0;
    if (clGetDeviceInfo(device, what, size, out, NULL) != CL_SUCCESS) snprintf(out, size, "?");
}

static json_t *json_of_device(cl_device_id device)
{
    char name[256], version[256], driver[256];
    cl_uint units = 0;
    cl_ulong memory = 0;
    device_text(name, sizeof name, device, CL_DEVICE_NAME);
    device_text(version, sizeof version, device, CL_DEVICE_VERSION);
    device_text(driver, sizeof driver, device, CL_DRIVER_VERSION);
    clGetDeviceInfo(device, CL_DEVICE_MAX_COMPUTE_UNITS, sizeof units, &units, NULL);
    clGetDeviceInfo(device, CL_DEVICE_GLOBAL_MEM_SIZE, sizeof memory, &memory, NULL);
    const char *fault = test_device(device);
    return json_pack("{s:s,s:s,s:s,s:i,s:I,s:s}", "name", name, "version", version, "driver", driver,
                     "compute_units", (int)units, "memory_bytes", (json_int_t)memory, "self_test",
                     fault ? fault : "ok");
}

static json_t *list_devices(void)
{
    json_t *list = json_array();
    cl_platform_id platforms[PLATFORMS_MAX];
    cl_uint platform_count = 0;
    if (clGetPlatformIDs(PLATFORMS_MAX, platforms, &platform_count) != CL_SUCCESS) platform_count = 0;
    for (cl_uint p = 0; p < platform_count && p < PLATFORMS_MAX; p++) {
        cl_device_id devices[DEVICES_MAX];
        cl_uint device_count = 0;
        if (clGetDeviceIDs(platforms[p], CL_DEVICE_TYPE_ALL, DEVICES_MAX, devices, &device_count) !=
            CL_SUCCESS)
            continue;
        for (cl_uint d = 0; d < device_count && d < DEVICES_MAX; d++)
            json_array_append_new(list, json_of_device(devices[d]));
    }
    return list;
}

/* ---- libraries ---- */

static void set_text(json_t *object, const char *name, const char *text)
{
    json_object_set_new(object, name, json_string(text));
}

static void set_version(json_t *object, const char *name, int major, int minor, int patch)
{
    json_object_set_new(object, name, json_sprintf("%d.%d.%d", major, minor, patch));
}

static json_t *list_libraries(void)
{
    json_t *list = json_object();
    RTCDevice embree = rtcNewDevice(NULL);
    int version = embree ? (int)rtcGetDeviceProperty(embree, RTC_DEVICE_PROPERTY_VERSION) : 0;
    set_text(list, "neupig", npg_version());
    set_version(list, "embree", version / 10000, version / 100 % 100, version % 100);
    if (embree) rtcReleaseDevice(embree);
    set_text(list, "pcl", NPG_PCL_VERSION);
    set_text(list, "openvdb", NPG_OPENVDB_VERSION);
    set_version(list, "meshoptimizer", MESHOPTIMIZER_VERSION / 1000, MESHOPTIMIZER_VERSION / 10 % 100,
                MESHOPTIMIZER_VERSION % 10);
    set_text(list, "jansson", jansson_version_str());
    set_text(list, "libpng", png_get_libpng_ver(NULL));
    set_text(list, "zstd", ZSTD_versionString());
    unsigned xxhash = XXH_versionNumber();
    set_version(list, "xxhash", (int)xxhash / 10000, (int)xxhash / 100 % 100, (int)xxhash % 100);
    return list;
}

static json_t *describe_machine(void)
{
    json_int_t pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
    return json_pack("{s:i,s:I}", "cores", (int)sysconf(_SC_NPROCESSORS_ONLN), "memory_bytes", pages * page);
}

/* ---- the verb ---- */

static void print_text(const json_t *machine, const json_t *libraries, json_t *devices)
{
    const char *name;
    json_t *value;
    size_t i;
    printf("machine: %d cores, %.1f GiB\n", (int)json_integer_value(json_object_get(machine, "cores")),
           (double)json_integer_value(json_object_get(machine, "memory_bytes")) / 0x1p30);
    json_object_foreach((json_t *)(uintptr_t)libraries, name, value)
        printf("library: %-14s %s\n", name, json_string_value(value));
    json_array_foreach(devices, i, value) printf(
        "device %zu: %s\n          %s, driver %s, %d compute units, %.1f GiB\n          self-test: %s\n", i,
        json_string_value(json_object_get(value, "name")),
        json_string_value(json_object_get(value, "version")),
        json_string_value(json_object_get(value, "driver")),
        (int)json_integer_value(json_object_get(value, "compute_units")),
        (double)json_integer_value(json_object_get(value, "memory_bytes")) / 0x1p30,
        json_string_value(json_object_get(value, "self_test")));
}

static npg_status judge(const json_t *devices)
{
    if (!json_array_size(devices))
        return npg_error(NPG_DEVICE,
                         "no OpenCL device (on Debian: apt install pocl-opencl-icd for the processor)");
    for (size_t i = 0; i < json_array_size(devices); i++) {
        const json_t *device = json_array_get(devices, i);
        const char *word = json_string_value(json_object_get(device, "self_test"));
        if (strcmp(word, "ok") != 0)
            return npg_error(NPG_DEVICE, "device %zu (%s): self-test: %s", i,
                             json_string_value(json_object_get(device, "name")), word);
    }
    return NPG_OK;
}

int npg_verb_doctor(int argc, char **argv)
{
    settings s;
    npg_cli cli;
    npg_status status = npg_cli_parse(&cli, argv[0], &s, NULL, argc, argv);
    if (status) return npg_cli_end(argv[0], status);
    json_t *machine = describe_machine(), *libraries = list_libraries(), *devices = list_devices();
    if (s.json) {
        json_t *all =
            json_pack("{s:O,s:O,s:O}", "machine", machine, "libraries", libraries, "devices", devices);
        char *text = json_dumps(all, JSON_INDENT(1));
        puts(text ? text : "{}");
        free(text);
        json_decref(all);
    } else {
        print_text(machine, libraries, devices);
    }
    status = judge(devices);
    json_decref(machine);
    json_decref(libraries);
    json_decref(devices);
    return npg_cli_end(argv[0], status);
}
