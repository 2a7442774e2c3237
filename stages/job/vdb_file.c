/* VDB file: what OpenVDB writes, on disk as every other file: whole or not at all,
 * and the same bytes each time. */
#include "job/vdb_file.h"

#include <ctype.h>
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>
#include <xxhash.h>

#include "pipeline/file.h"

#define IDENTITY_AT   21 /* behind magic, versions and a flag */
#define IDENTITY_SIZE 36 /* 8-4-4-4-12 hex digits */
#define BLOCK         (16 << 10)

/* XXH3 of a file in memory from a place on; with `file` its bytes go there, too. */
static npg_status pass_bytes(XXH128_hash_t *wide, uint64_t *hash, npg_file *file, int fd, off_t from)
{
    unsigned char block[BLOCK];
    XXH3_state_t *state = XXH3_createState(), *wide_state = XXH3_createState();
    npg_status status = state && wide_state ? NPG_OK : npg_error(NPG_MEMORY, "no memory for a checksum");
    if (!status) XXH3_64bits_reset(state);
    if (!status) XXH3_128bits_reset(wide_state);
    for (off_t at = from; !status;) {
        ssize_t got = pread(fd, block, sizeof block, at);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) status = npg_error_errno(NPG_FAILED, "can't read back a file in memory");
        if (got <= 0) break;
        XXH3_64bits_update(state, block, (size_t)got);
        XXH3_128bits_update(wide_state, block, (size_t)got);
        if (file) npg_file_write(file, block, (size_t)got);
        at += got;
    }
    if (!status) *hash = XXH3_64bits_digest(state);
    if (!status) *wide = XXH3_128bits_digest(wide_state);
    XXH3_freeState(state);
    XXH3_freeState(wide_state);
    return status;
}

static bool is_identity(const char *text)
{
    for (int i = 0; i < IDENTITY_SIZE; i++) {
        bool is_dash = i == 8 || i == 13 || i == 18 || i == 23;
        if (is_dash ? text[i] != '-' : !isxdigit((unsigned char)text[i])) return false;
    }
    return true;
}

/* As a UUID of version 8, whose bits are the writer's own. */
static npg_status fix_identity(int fd)
{
    char text[IDENTITY_SIZE + 1] = "";
    XXH128_hash_t wide;
    uint64_t hash;
    if (pread(fd, text, IDENTITY_SIZE, IDENTITY_AT) != IDENTITY_SIZE || !is_identity(text))
        return npg_error(NPG_FAILED, "OpenVDB wrote a file with another head than was expected");
    NPG_TRY(pass_bytes(&wide, &hash, NULL, fd, IDENTITY_AT + IDENTITY_SIZE));
    unsigned long long high = wide.high64, low = wide.low64;
    snprintf(text, sizeof text, "%08llx-%04llx-8%03llx-9%03llx-%012llx", high >> 32, high >> 16 & 0xffff,
             high & 0xfff, low >> 48 & 0xfff, low & 0xffffffffffff);
    if (pwrite(fd, text, IDENTITY_SIZE, IDENTITY_AT) != IDENTITY_SIZE)
        return npg_error_errno(NPG_FAILED, "can't write a file in memory");
    return NPG_OK;
}

/* OpenVDB does not tell when a disk is full: it writes to memory, and the bytes go
 * to disk with every check. */
npg_status npg_vdb_file_write(const char *path, uint64_t *hash,
                              npg_status (*save)(void *user, const char *memory_path), void *user)
{
    char memory_path[64];
    npg_file *file = NULL;
    XXH128_hash_t wide;
    uint64_t own_hash;
    int fd = memfd_create("neupig-grids", MFD_CLOEXEC);
    if (fd < 0) return npg_error_errno(NPG_FAILED, "can't make a file in memory");
    snprintf(memory_path, sizeof memory_path, "/proc/self/fd/%d", fd);
    npg_status status = save(user, memory_path);
    if (!status) status = fix_identity(fd);
    if (!status) status = npg_file_open(&file, path);
    if (!status) status = pass_bytes(&wide, hash ? hash : &own_hash, file, fd, 0);
    status = npg_file_end(&file, status);
    close(fd);
    return status;
}
