/* VDB file: what OpenVDB writes, on disk as every other file: whole or not at all,
 * and the same bytes each time. */
#include "job/vdb_file.h"

#include <ctype.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "pipeline/file.h"

#define IDENTITY_AT   21 /* behind magic, versions and a flag */
#define IDENTITY_SIZE 36 /* 8-4-4-4-12 hex digits */

static bool is_identity(const char *text)
{
    for (int i = 0; i < IDENTITY_SIZE; i++) {
        bool is_dash = i == 8 || i == 13 || i == 18 || i == 23;
        if (is_dash ? text[i] != '-' : !isxdigit((unsigned char)text[i])) return false;
    }
    return true;
}

/* As a UUID of version 8, whose bits are the writer's own. */
static npg_status fix_identity(char *bytes, size_t size)
{
    char text[IDENTITY_SIZE + 1];
    const size_t behind = IDENTITY_AT + IDENTITY_SIZE;
    if (size < behind || !is_identity(bytes + IDENTITY_AT))
        return npg_error(NPG_FAILED, "OpenVDB wrote a file with another head than was expected");
    XXH128_hash_t hash = XXH3_128bits(bytes + behind, size - behind);
    unsigned long long high = hash.high64, low = hash.low64;
    snprintf(text, sizeof text, "%08llx-%04llx-8%03llx-9%03llx-%012llx", high >> 32, high >> 16 & 0xffff,
             high & 0xfff, low >> 48 & 0xfff, low & 0xffffffffffff);
    memcpy(bytes + IDENTITY_AT, text, IDENTITY_SIZE);
    return NPG_OK;
}

/* OpenVDB does not tell when a disk is full: it writes to memory, and the bytes go
 * to disk with every check. */
npg_status npg_vdb_file_write(const char *path, uint64_t *hash,
                              npg_status (*save)(void *user, const char *memory_path), void *user)
{
    char memory_path[64], *bytes = MAP_FAILED;
    npg_file *file = NULL;
    struct stat info = {0};
    int fd = memfd_create("neupig-grids", MFD_CLOEXEC);
    if (fd < 0) return npg_error_errno(NPG_FAILED, "can't make a file in memory");
    snprintf(memory_path, sizeof memory_path, "/proc/self/fd/%d", fd);
    npg_status status = save(user, memory_path);
    if (!status && !fstat(fd, &info))
        bytes = mmap(NULL, (size_t)info.st_size, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (!status && bytes == MAP_FAILED)
        status = npg_error_errno(NPG_FAILED, "can't read back a file in memory");
    if (!status) status = fix_identity(bytes, (size_t)info.st_size);
    if (!status) status = npg_file_open(&file, path);
    if (!status) npg_file_write(file, bytes, (size_t)info.st_size);
    if (!status && hash) *hash = XXH3_64bits(bytes, (size_t)info.st_size);
    status = npg_file_end(&file, status);
    if (bytes != MAP_FAILED) munmap(bytes, (size_t)info.st_size);
    close(fd);
    return status;
}
