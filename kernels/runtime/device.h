/* Device: an OpenCL device with one in-order queue, its buffers, programs and launches.
 *
 * Threads: a device and all that belongs to it is used by one thread at a time.  Failures are NPG_DEVICE with
 * the OpenCL call and error by name, or NPG_MEMORY. */
#ifndef NPG_DEVICE_H
#define NPG_DEVICE_H

#include <stdbool.h>

#include "kernels/runtime/tuning.h"
#include "pipeline/memory.h"

typedef struct npg_device npg_device;
typedef struct npg_program npg_program;

typedef struct npg_device_info {
    char name[128], platform[128], version[128], driver[128];
    bool is_cpu;
    int units;           /* compute units      */
    int vector;          /* floats in a vector */
    size_t memory_bytes; /* global memory      */
} npg_device_info;

/* The i-th device of all platforms; NPG_END after the last, NPG_DEVICE when there is no platform at all
 * or a driver can't be asked. */
npg_status npg_device_describe(size_t i, npg_device_info *info);

/* Open a device.  spec: "auto" or "" (the first CPU device, else the first), "cpu", "gpu", its number in the
 * list, or a part of its name.  NPG_DEVICE names the devices there are when none fits.  Compiled kernels are
 * kept on disk, in a folder that one process uses at a time.  tuning: a loan; NULL: that for its kind of device. */
npg_status npg_device_open(npg_device **device, const char *spec, const npg_tuning *tuning);
void npg_device_close(npg_device **device);
const npg_device_info *npg_device_facts(const npg_device *device);
const npg_tuning *npg_device_tuning(const npg_device *device);

/* Wait for everything launched so far; reports what failed on the device. */
npg_status npg_device_finish(npg_device *device);

/* A buffer on the device; size bytes, zeroed, counted under NPG_FOR_DEVICE. */
typedef struct npg_buffer {
    npg_device *device; /* loan                        */
    void *memory;       /* cl_mem, NULL while not open */
    size_t size;        /* bytes                       */
} npg_buffer;

npg_status npg_buffer_open(npg_buffer *buffer, npg_device *device, size_t size);
void npg_buffer_close(npg_buffer *buffer);

/* Copy between host and device, both waiting until done.  Reading waits for all launches before it. */
npg_status npg_buffer_write(npg_buffer *buffer, size_t offset, const void *data, size_t size);
npg_status npg_buffer_read(const npg_buffer *buffer, size_t offset, void *data, size_t size);
npg_status npg_buffer_zero(npg_buffer *buffer);

/* An open buffer with these contents. */
npg_status npg_buffer_from(npg_buffer *buffer, npg_device *device, const void *data, size_t size);

/* Build kernels/<name>.cl with the given build constants ("-DW1=512 ...", may be "") and those of the tuning.
 * The device owns the program; the same text and constants opened twice are the same one, which lasts until the
 * device is closed. */
npg_status npg_program_open(npg_program **program, npg_device *device, const char *name,
                            const char *constants);

/* One argument of a kernel. */
typedef struct npg_argument {
    const npg_buffer *buffer; /* or NULL: a number */
    enum { NPG_ARGUMENT_BUFFER, NPG_ARGUMENT_INT, NPG_ARGUMENT_FLOAT } kind;
    int32_t number;
    float real;
} npg_argument;

#define NPG_BUF(b)                                                                                           \
    (npg_argument)                                                                                           \
    {                                                                                                        \
        .buffer = (b), .kind = NPG_ARGUMENT_BUFFER                                                           \
    }
#define NPG_INT(n)                                                                                           \
    (npg_argument)                                                                                           \
    {                                                                                                        \
        .kind = NPG_ARGUMENT_INT, .number = (int32_t)(n)                                                     \
    }
#define NPG_REAL(x)                                                                                          \
    (npg_argument)                                                                                           \
    {                                                                                                        \
        .kind = NPG_ARGUMENT_FLOAT, .real = (float)(x)                                                       \
    }

/* Queue a kernel over x (by y) work-items.  local is the work-group's extent in x: 0 takes that
 * of the tuning (x is rounded up: kernels check their bounds). */
npg_status npg_launch_on(npg_program *program, const char *kernel, size_t x, size_t y, size_t local,
                         const npg_argument *arguments, size_t argument_count);

#define NPG_LAUNCH(program, kernel, x, y, ...)                                                               \
    npg_launch_on(program, kernel, x, y, 0, (npg_argument[]){__VA_ARGS__},                                   \
                  sizeof((npg_argument[]){__VA_ARGS__}) / sizeof(npg_argument))

/* The same for kernels that share their work out to groups of so many work-items. */
#define NPG_LAUNCH_GROUPS(program, kernel, groups, items, ...)                                               \
    npg_launch_on(program, kernel, (groups) * (items), 1, items, (npg_argument[]){__VA_ARGS__},              \
                  sizeof((npg_argument[]){__VA_ARGS__}) / sizeof(npg_argument))

#endif
