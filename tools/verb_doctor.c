/* neupig doctor: what this machine offers, and whether its devices compute right. */
#include <embree3/rtcore.h>
#include <jansson.h>
#include <meshoptimizer.h>
#include <png.h>
#include <stddef.h>
#include <string.h>
#include <unistd.h>
#include <xxhash.h>
#include <zstd.h>

#include "kernels/kernels.h"
#include "tools/cli.h"

typedef struct settings {
    bool json;
} settings;

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_doctor_options[] = {
    /* type      name    place     default */
    NPG_ROW_FLAG("json", AT(json), "no",
        "Print one JSON object instead of text"),
    {0}};
/* clang-format on */

/* ---- devices ---- */

/* The self-test compares every kernel on the device with known answers. */
static json_t *json_of_device(size_t i, const npg_device_info *info)
{
    npg_device *device;
    char number[24];
    snprintf(number, sizeof number, "%zu", i);
    npg_status status = npg_device_open(&device, number, NULL);
    if (!status) status = npg_kernels_self_test(device);
    npg_device_close(&device);
    return json_pack("{s:s,s:s,s:s,s:i,s:I,s:s}", "name", info->name, "platform", info->platform, "version",
                     info->version, "compute_units", info->units, "memory_bytes",
                     (json_int_t)info->memory_bytes, "self_test", status ? npg_error_text() : "ok");
}

/* Empty when there is no driver at all, or none that can be asked: a failure. */
static npg_status list_devices(json_t *list)
{
    npg_device_info info;
    npg_status status;
    for (size_t i = 0; !(status = npg_device_describe(i, &info)); i++)
        json_array_append_new(list, json_of_device(i, &info));
    return status == NPG_END ? NPG_OK : status;
}

/* ---- libraries ---- */

static json_t *version_of(int major, int minor, int patch)
{
    return json_sprintf("%d.%d.%d", major, minor % 100, patch % 100);
}

static json_t *list_libraries(void)
{
    RTCDevice embree = rtcNewDevice(NULL);
    int version = embree ? (int)rtcGetDeviceProperty(embree, RTC_DEVICE_PROPERTY_VERSION) : 0;
    int xxhash = (int)XXH_versionNumber();
    if (embree) rtcReleaseDevice(embree);
    return json_pack(
        "{s:s,s:o,s:s,s:s,s:o,s:s,s:s,s:s,s:o}", "neupig", npg_version(), "embree",
        version_of(version / 10000, version / 100, version), "pcl",
        NPG_PCL_VERSION /* neupig-poisson has it */, "openvdb", NPG_OPENVDB_VERSION, "meshoptimizer",
        version_of(MESHOPTIMIZER_VERSION / 1000, MESHOPTIMIZER_VERSION / 10, MESHOPTIMIZER_VERSION % 10),
        "jansson", jansson_version_str(), "libpng", png_get_libpng_ver(NULL), "zstd", ZSTD_versionString(),
        "xxhash", version_of(xxhash / 10000, xxhash / 100, xxhash));
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
    json_array_foreach(devices, i, value)
    {
        const char *platform, *version, *self_test;
        int units;
        json_int_t bytes;
        json_unpack(value, "{s:s,s:s,s:s,s:i,s:I,s:s}", "name", &name, "platform", &platform, "version",
                    &version, "compute_units", &units, "memory_bytes", &bytes, "self_test", &self_test);
        printf("device %zu: %s\n          %s, %s, %d compute units, %.1f GiB\n          self-test: %s\n", i,
               name, version, platform, units, (double)bytes / 0x1p30, self_test);
    }
}

static npg_status status_of(const json_t *devices)
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

npg_status npg_verb_doctor(const npg_cli *cli)
{
    const settings *s = cli->values;
    json_t *machine = describe_machine(), *libraries = list_libraries(), *devices = json_array();
    npg_status status = list_devices(devices);
    if (s->json)
        npg_cli_print(
            json_pack("{s:O,s:O,s:O}", "machine", machine, "libraries", libraries, "devices", devices));
    else
        print_text(machine, libraries, devices);
    if (!status) status = status_of(devices);
    json_decref(machine);
    json_decref(libraries);
    json_decref(devices);
    return status;
}
