/* Programs and launches.
 *
 * A device owns the programs that were opened on it: the same text and constants are built once.  Built
 * programs are kept on disk as the driver's binaries, for to hand a driver the text again costs it a pass of
 * its compiler's front end even when its own cache has the rest.  In memory and on disk a program is known by
 * the hash of all that it is made from, never by its name alone. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

#include "kernels/runtime/device_internal.h"
#include "pipeline/file.h"

#define CONSTANTS_MAX 384        /* letters of the build constants; half of them from the tuning */
#define BINARY_MAX    (1u << 28) /* bytes; a larger file is none of ours */

struct npg_program {
    npg_program *next;
    npg_device *device; /* loan */
    const char *name;   /* of the source, static */
    char constants[CONSTANTS_MAX];
    uint64_t key; /* hash of text, flags, constants, device and driver */
    bool is_from_text;
    cl_program program;
    cl_kernel kernels[NPG_KERNELS_MAX];
    char kernel_names[NPG_KERNELS_MAX][48];
    cl_uint kernel_count;
};

#define CL_TRY(call) NPG_TRY(npg_cl_status(call, #call))
/* Multiply-adds may be fused; but numbers may be infinite or NaN (no -cl-fast-relaxed-math): a fit that
 * diverges must show. */
#define FLAGS "-cl-std=CL1.2 -cl-mad-enable -cl-no-signed-zeros "

static const npg_kernel_source *source_of(const char *name)
{
    for (const npg_kernel_source *source = npg_kernel_sources; source->name; source++)
        if (!strcmp(source->name, name)) return source;
    return NULL;
}

static uint64_t key_of(const npg_device_info *info, const char *text, const char *constants)
{
    const char *parts[] = {text, FLAGS, constants, info->name, info->platform, info->version, info->driver};
    XXH64_hash_t hash = 0;
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++)
        hash = XXH64(parts[i], strlen(parts[i]) + 1, hash);
    return hash;
}

/* ---- binaries on disk ---- */

/* What stands before the driver's bytes. */
typedef struct binary_head {
    char magic[8];
    uint64_t key;        /* of the program */
    uint64_t size, hash; /* of the bytes that follow */
} binary_head;

static const char binary_magic[8] = "npgcl 2";

/* The key decides which file it is; false: there is no cache. */
static bool binary_path(char *out, size_t size, const npg_program *program)
{
    char name[64];
    snprintf(name, sizeof name, "%s-%016llx.program", program->name, (unsigned long long)program->key);
    return npg_kernel_cache_path(out, size, name);
}

/* The bytes, or NULL when there is no file that is whole and this program's. */
static unsigned char *read_binary(const char *path, uint64_t key, size_t *size)
{
    binary_head head;
    unsigned char *bytes = NULL;
    FILE *file = fopen(path, "rb");
    if (!file) return NULL;
    bool good = fread(&head, sizeof head, 1, file) == 1 &&
                !memcmp(head.magic, binary_magic, sizeof head.magic) && head.key == key && head.size &&
                head.size < BINARY_MAX && !npg_alloc(&bytes, NPG_FOR_DEVICE, head.size);
    good = good && fread(bytes, 1, head.size, file) == head.size && fgetc(file) == EOF &&
           XXH64(bytes, head.size, 0) == head.hash;
    fclose(file);
    if (!good) npg_release(&bytes);
    *size = good ? head.size : 0;
    return bytes;
}

static bool create_from_binary(npg_program *program)
{
    char path[NPG_CACHE_PATH];
    size_t size;
    cl_int code = 0, status = 0;
    if (!binary_path(path, sizeof path, program)) return false;
    unsigned char *bytes = read_binary(path, program->key, &size);
    if (!bytes) return false;
    const unsigned char *loan = bytes;
    program->program = clCreateProgramWithBinary(program->device->context, 1, &program->device->id, &size,
                                                 &loan, &status, &code);
    npg_release(&bytes);
    if (!code && !status) return true;
    if (program->program) clReleaseProgram(program->program);
    program->program = NULL;
    return false;
}

static npg_status write_binary(const char *path, uint64_t key, const unsigned char *bytes, size_t size)
{
    npg_file *file;
    binary_head head = {.key = key, .size = size, .hash = XXH64(bytes, size, 0)};
    memcpy(head.magic, binary_magic, sizeof head.magic);
    NPG_TRY(npg_file_open(&file, path));
    npg_file_write(file, &head, sizeof head);
    npg_file_write(file, bytes, size);
    return npg_file_commit(&file);
}

/* A cache that can't be written costs time, nothing else. */
static void store_binary(const npg_program *program)
{
    char path[NPG_CACHE_PATH];
    size_t size = 0;
    unsigned char *bytes;
    if (!npg_kernel_cache_is_ours() || !binary_path(path, sizeof path, program)) return;
    if (clGetProgramInfo(program->program, CL_PROGRAM_BINARY_SIZES, sizeof size, &size, NULL) || !size)
        return;
    if (npg_alloc(&bytes, NPG_FOR_DEVICE, size)) return;
    if (!clGetProgramInfo(program->program, CL_PROGRAM_BINARIES, sizeof bytes, &bytes, NULL))
        write_binary(path, program->key, bytes, size);
    npg_release(&bytes);
}

/* ---- building ---- */

static npg_status build_failure(const npg_program *program, cl_int code)
{
    char log[800] = ""; /* as much as goes into an error text */
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
    CL_TRY(clCreateKernelsInProgram(program->program, NPG_KERNELS_MAX, program->kernels,
                                    &program->kernel_count));
    for (cl_uint i = 0; i < program->kernel_count; i++)
        CL_TRY(clGetKernelInfo(program->kernels[i], CL_KERNEL_FUNCTION_NAME, sizeof program->kernel_names[i],
                               program->kernel_names[i], NULL));
    return NPG_OK;
}

static npg_status build_program(npg_program *program, const char *text)
{
    char flags[sizeof FLAGS + CONSTANTS_MAX];
    cl_int code = 0;
    snprintf(flags, sizeof flags, "%s%s", FLAGS, program->constants);
    if (create_from_binary(program)) {
        if (!clBuildProgram(program->program, 1, &program->device->id, flags, NULL, NULL))
            return make_kernels(program);
        clReleaseProgram(program->program);
    }
    program->is_from_text = true;
    program->program = clCreateProgramWithSource(program->device->context, 1, &text, NULL, &code);
    NPG_TRY(npg_cl_status(code, "clCreateProgramWithSource"));
    code = clBuildProgram(program->program, 1, &program->device->id, flags, NULL, NULL);
    return code ? build_failure(program, code) : make_kernels(program);
}

static void release_program(npg_program *program)
{
    for (cl_uint i = 0; i < program->kernel_count; i++) clReleaseKernel(program->kernels[i]);
    if (program->program) clReleaseProgram(program->program);
    npg_release(&program);
}

static npg_program *find_program(const npg_device *device, uint64_t key)
{
    npg_program *program = device->programs;
    while (program && program->key != key) program = program->next;
    return program;
}

npg_status npg_program_open(npg_program **out, npg_device *device, const char *name, const char *constants)
{
    char tuned[CONSTANTS_MAX / 2], all[CONSTANTS_MAX];
    const npg_kernel_source *source = source_of(name);
    npg_program *program;
    *out = NULL;
    if (!source) return npg_error(NPG_USAGE, "there are no kernels named %s", name);
    npg_tuning_constants(tuned, sizeof tuned, device->tuning, name);
    snprintf(all, sizeof all, "%s %s", tuned, constants);
    uint64_t key = key_of(&device->info, source->text, all);
    *out = find_program(device, key);
    if (*out) return NPG_OK;
    NPG_TRY(npg_alloc(&program, NPG_FOR_DEVICE, sizeof *program));
    program->device = device;
    program->name = source->name;
    program->key = key;
    memcpy(program->constants, all, sizeof all);
    npg_status status = build_program(program, source->text);
    if (status) {
        release_program(program);
    } else {
        program->next = device->programs;
        *out = device->programs = program;
    }
    return status;
}

void npg_program_close(npg_program **slot)
{
    if (slot) *slot = NULL;
}

void npg_device_distrust(npg_device *device)
{
    char path[NPG_CACHE_PATH];
    device->is_distrusted = true;
    if (!npg_kernel_cache_is_ours()) return;
    for (npg_program *program = device->programs; program; program = program->next)
        if (!program->is_from_text && binary_path(path, sizeof path, program)) remove(path);
}

void npg_programs_close(npg_device *device)
{
    while (device->programs) {
        npg_program *program = device->programs;
        device->programs = program->next;
        if (program->is_from_text && !device->is_distrusted) store_binary(program);
        release_program(program);
    }
}

/* ---- launches ---- */

static cl_int set_argument(cl_kernel kernel, cl_uint i, const npg_argument *argument)
{
    cl_mem memory;
    switch (argument->kind) {
    case NPG_ARGUMENT_BUFFER:
        memory = argument->buffer->memory;
        return clSetKernelArg(kernel, i, sizeof memory, &memory);
    case NPG_ARGUMENT_INT: return clSetKernelArg(kernel, i, sizeof argument->number, &argument->number);
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
    if (!local) local = (size_t)program->device->tuning->local;
    size_t global[2] = {(x + local - 1) / local * local, y}, groups[2] = {local, 1};
    cl_int code = clEnqueueNDRangeKernel(program->device->queue, kernel, y > 1 ? 2 : 1, NULL, global, groups,
                                         0, NULL, NULL);
    return npg_error_prefix(npg_cl_status(code, "clEnqueueNDRangeKernel"), "kernel %s over %zu x %zu", name,
                            x, y);
}
