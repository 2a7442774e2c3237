/* File facts: sizes and checksums. */
#include "pipeline/file_facts.h"

#include <errno.h>
#include <stdio.h>
#include <unistd.h>
#include <xxhash.h>

#include "pipeline/file.h"
#include "pipeline/memory.h"

static npg_status hash_file(XXH64_hash_t *hash, int64_t *size, const char *path)
{
    unsigned char block[16 << 10];
    XXH3_state_t *state = XXH3_createState();
    if (!state) return npg_error(NPG_MEMORY, "no memory for a checksum");
    XXH3_64bits_reset(state);
    int fd;
    npg_status status = npg_file_open_plain(&fd, path, NPG_DISK);
    *size = 0;
    while (!status) {
        ssize_t got = read(fd, block, sizeof block);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) status = npg_error_errno(NPG_DISK, "can't read back %s", path);
        if (got <= 0) break;
        XXH3_64bits_update(state, block, (size_t)got);
        *size += got;
    }
    if (fd >= 0) close(fd);
    *hash = XXH3_64bits_digest(state);
    XXH3_freeState(state);
    return status;
}

npg_status npg_file_facts(json_t *entry, const char *output, const char *file)
{
    char *path, text[17];
    XXH64_hash_t hash;
    int64_t size;
    NPG_TRY(npg_join_path(&path, output, file));
    npg_status status = hash_file(&hash, &size, path);
    npg_release(&path);
    NPG_TRY(status);
    snprintf(text, sizeof text, "%016llx", (unsigned long long)hash);
    json_object_set_new(entry, "bytes", json_integer((json_int_t)size));
    json_object_set_new(entry, "xxh3", json_string(text));
    return NPG_OK;
}

npg_status npg_file_check(const json_t *entry, const char *output, const char *file)
{
    if (!npg_path_stays(file))
        return npg_error(NPG_BAD_INPUT, "%s: the list of frames names %s, which is not in it", output, file);
    json_t *now = json_object();
    npg_status status = npg_file_facts(now, output, file);
    if (!status && (!json_equal(json_object_get(now, "bytes"), json_object_get(entry, "bytes")) ||
                    !json_equal(json_object_get(now, "xxh3"), json_object_get(entry, "xxh3"))))
        status = npg_error(NPG_BAD_INPUT,
                           "%s/%s was changed since it was written; --restart discards what is there", output,
                           file);
    json_decref(now);
    return status == NPG_DISK ? NPG_BAD_INPUT : status;
}
