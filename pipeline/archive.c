/* Archive: named blocks of bytes in one file that is read whole or not at all. */
#include "pipeline/archive.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "pipeline/file.h"

static const char magic[8] = "NPGARCH1", end_name[NPG_BLOCK_NAME] = "end";

typedef struct block_head {
    char name[NPG_BLOCK_NAME];
    uint64_t size;
} block_head;

/* Blocks begin at multiples of 8, so that what is found can be read as int64_t or double in place. */
static size_t padded(uint64_t size)
{
    return (size_t)((size + 7) / 8 * 8);
}

/* ---- writing ---- */

struct npg_archive_writer {
    npg_file *file;
    XXH3_state_t *hash;
};

static void close_writer(npg_archive_writer **slot)
{
    XXH3_freeState((*slot)->hash);
    npg_release(slot);
}

static void append(npg_archive_writer *writer, const void *data, size_t size)
{
    XXH3_64bits_update(writer->hash, data, size);
    npg_file_write(writer->file, data, size); /* what fails is remembered for the commit */
}

npg_status npg_archive_create(npg_archive_writer **out, const char *path)
{
    npg_archive_writer *writer;
    *out = NULL;
    NPG_TRY(npg_alloc(&writer, NPG_FOR_FILES, sizeof *writer));
    writer->hash = XXH3_createState();
    npg_status status = writer->hash ? NPG_OK : npg_error(NPG_MEMORY, "no memory for a checksum");
    if (!status) status = npg_file_open(&writer->file, path);
    if (!status) {
        XXH3_64bits_reset(writer->hash);
        append(writer, magic, sizeof magic);
    }
    if (status) close_writer(&writer);
    *out = writer;
    return status;
}

npg_status npg_archive_put(npg_archive_writer *writer, const char *name, const void *data, size_t size)
{
    static const char zeros[8];
    block_head head = {.size = size};
    NPG_REQUIRE(strlen(name) < sizeof head.name);
    memcpy(head.name, name, strlen(name));
    append(writer, &head, sizeof head);
    if (size) append(writer, data, size);
    if (padded(size) > size) append(writer, zeros, padded(size) - size);
    return NPG_OK;
}

npg_status npg_archive_commit(npg_archive_writer **slot)
{
    npg_archive_writer *writer = *slot;
    uint64_t hash = XXH3_64bits_digest(writer->hash);
    npg_status status = npg_archive_put(writer, end_name, &hash, sizeof hash);
    if (!status)
        status = npg_file_commit(&writer->file);
    else
        npg_file_discard(&writer->file);
    close_writer(slot);
    return status;
}

void npg_archive_discard(npg_archive_writer **slot)
{
    if (!*slot) return;
    npg_file_discard(&(*slot)->file);
    close_writer(slot);
}

/* ---- reading ---- */

struct npg_archive {
    unsigned char *bytes; /* owned */
    size_t size;
};

static npg_status read_all(int fd, unsigned char *bytes, size_t size, const char *path)
{
    for (size_t at = 0; at < size;) {
        ssize_t got = read(fd, bytes + at, size - at);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) return npg_error_errno(NPG_BAD_INPUT, "can't read %s", path);
        if (got == 0) return npg_error(NPG_BAD_INPUT, "%s became shorter while it was read", path);
        at += (size_t)got;
    }
    return NPG_OK;
}

static npg_status verify(const npg_archive *a, const char *path)
{
    const size_t tail = sizeof(block_head) + sizeof(uint64_t); /* the last block, with the checksum */
    uint64_t hash;
    if (a->size < sizeof magic + tail || memcmp(a->bytes, magic, sizeof magic) != 0)
        return npg_error(NPG_BAD_INPUT, "%s is damaged: it does not begin as an archive", path);
    memcpy(&hash, a->bytes + a->size - sizeof hash, sizeof hash);
    const block_head *end = (const void *)(a->bytes + a->size - tail);
    if (a->size % 8 || memcmp(end->name, end_name, sizeof end_name) != 0 || end->size != sizeof hash)
        return npg_error(NPG_BAD_INPUT, "%s is damaged: its end is missing (%zu bytes)", path, a->size);
    if (XXH3_64bits(a->bytes, a->size - tail) != hash)
        return npg_error(NPG_BAD_INPUT, "%s is damaged: its checksum does not match its content", path);
    return NPG_OK;
}

npg_status npg_archive_open(npg_archive **out, const char *path)
{
    npg_archive *a;
    struct stat info;
    *out = NULL;
    NPG_TRY(npg_alloc(&a, NPG_FOR_FILES, sizeof *a));
    int fd;
    npg_status status = npg_file_open_plain(&fd, path, NPG_BAD_INPUT);
    if (!status && fstat(fd, &info)) status = npg_error_errno(NPG_BAD_INPUT, "can't read %s", path);
    if (!status) a->size = (size_t)info.st_size;
    if (!status) status = npg_alloc(&a->bytes, NPG_FOR_FILES, a->size);
    if (!status) status = read_all(fd, a->bytes, a->size, path);
    if (fd >= 0) close(fd);
    if (!status) status = verify(a, path);
    if (status) npg_archive_close(&a);
    *out = a;
    return status;
}

void npg_archive_close(npg_archive **slot)
{
    if (!slot || !*slot) return;
    npg_release(&(*slot)->bytes);
    npg_release(slot);
}

const void *npg_archive_find(const npg_archive *a, const char *name, size_t *size)
{
    size_t at = sizeof magic;
    while (at + sizeof(block_head) <= a->size) {
        const block_head *head = (const void *)(a->bytes + at);
        at += sizeof *head;
        if (head->size > a->size - at) return NULL;
        if (!strncmp(head->name, name, sizeof head->name)) {
            *size = (size_t)head->size;
            return a->bytes + at;
        }
        at += padded(head->size);
    }
    return NULL;
}

npg_status npg_archive_get(const npg_archive *a, const char *name, void *data, size_t size)
{
    size_t found;
    const void *bytes = npg_archive_find(a, name, &found);
    if (!bytes) return npg_error(NPG_BAD_INPUT, "the block %s is missing", name);
    if (found != size)
        return npg_error(NPG_BAD_INPUT, "the block %s has %zu bytes in place of %zu", name, found, size);
    if (size) memcpy(data, bytes, size);
    return NPG_OK;
}

/* ---- checksums ---- */

static npg_status hash_bytes(XXH3_state_t *state, int fd, const char *path, uint64_t limit)
{
    unsigned char block[16 << 10];
    XXH3_64bits_reset(state);
    for (uint64_t left = limit; left;) {
        ssize_t got = read(fd, block, left < sizeof block ? (size_t)left : sizeof block);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) return npg_error_errno(NPG_DISK, "can't read %s", path);
        if (got == 0 && limit == UINT64_MAX) break;
        if (got == 0)
            return npg_error(NPG_BAD_INPUT, "%s is %llu bytes shorter than it was", path,
                             (unsigned long long)left);
        XXH3_64bits_update(state, block, (size_t)got);
        left -= (uint64_t)got;
    }
    return NPG_OK;
}

npg_status npg_hash_file(uint64_t *hash, const char *path, uint64_t limit)
{
    XXH3_state_t *state = XXH3_createState();
    if (!state) return npg_error(NPG_MEMORY, "no memory for a checksum");
    int fd;
    npg_status status = npg_file_open_plain(&fd, path, NPG_DISK);
    if (!status) status = hash_bytes(state, fd, path, limit);
    if (fd >= 0) close(fd);
    *hash = status ? 0 : XXH3_64bits_digest(state);
    XXH3_freeState(state);
    return status;
}
