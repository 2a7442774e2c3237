/* What the fuzz targets share: an input as a file in memory, and a check that ends the process.
 *
 * A target holds its parser to three things whatever the bytes are: the status is one of the documented ones,
 * nothing is left behind, and memory stays within 4 x file + 1 MiB. */
#ifndef NPG_FUZZ_TARGET_H
#define NPG_FUZZ_TARGET_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "pipeline/memory.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static inline void expect(int condition, const char *what)
{
    if (condition) return;
    fprintf(stderr, "%s: %s\n", what, npg_error_text());
    abort();
}

/* One file of the process, with a name that ends as the parser wants it; holds the bytes from now on. */
static inline const char *fuzz_file(int *fd, const char *name, const uint8_t *data, size_t size)
{
    static char path[128];
    static int file = -1;
    if (file < 0) {
        char target[64];
        file = memfd_create("fuzz", MFD_CLOEXEC);
        snprintf(path, sizeof path, "/tmp/npg-fuzz-%d-%s", (int)getpid(), name);
        snprintf(target, sizeof target, "/proc/self/fd/%d", file);
        unlink(path);
        expect(file >= 0 && symlink(target, path) == 0, "the file could not be made");
    }
    expect(ftruncate(file, 0) == 0 && pwrite(file, data, size, 0) == (ssize_t)size,
           "the file can't be written");
    *fd = file;
    return path;
}

/* From here on the library may hold no more than the bound for a file of this size. */
static inline void fuzz_bound(size_t size)
{
    npg_memory_set_limit(npg_memory_used() + 4 * size + ((size_t)1 << 20));
}

static inline void fuzz_end(void)
{
    npg_memory_set_limit(0);
    expect(npg_memory_used() == 0, "memory is still in use");
}

#endif
