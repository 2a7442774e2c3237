/* Programs and launches.
 *
 * A device owns the programs that were opened on it: the same text and constants are built once.  What a driver
 * keeps of them on disk is its own (device.c): to hand it the texts again costs 0.2 processor seconds. */
#include <stdio.h>
#include <string.h>

#include "kernels/runtime/device_internal.h"

#define CONSTANTS_MAX 384 /* letters of the build constants; half of them from the tuning */

struct npg_program {
    npg_program *next;
    npg_device *device; /* loan */
    const char *name;   /* of the source, static */
    char constants[CONSTANTS_MAX];
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

static npg_program *find_program(const npg_device *device, const char *name, const char *constants)
{
    npg_program *program = device->programs;
    while (program && (strcmp(program->name, name) || strcmp(program->constants, constants)))
        program = program->next;
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
    *out = find_program(device, name, all);
    if (*out) return NPG_OK;
    NPG_TRY(npg_alloc(&program, NPG_FOR_DEVICE, sizeof *program));
    program->device = device;
    program->name = source->name;
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

void npg_programs_close(npg_device *device)
{
    while (device->programs) {
        npg_program *program = device->programs;
        device->programs = program->next;
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
