/* File facts: sizes and checksums. */
#include "pipeline/file_facts.h"

#include <stdio.h>
#include <sys/stat.h>

#include "pipeline/file.h"
#include "pipeline/memory.h"

npg_status npg_file_facts(json_t *entry, const char *output, const char *file)
{
    char *path, text[17];
    uint64_t hash;
    struct stat info;
    NPG_TRY(npg_join_path(&path, output, file));
    npg_status status = npg_hash_file(&hash, path, UINT64_MAX);
    if (!status && stat(path, &info)) status = npg_error_errno(NPG_DISK, "can't read back %s", path);
    npg_release(&path);
    NPG_TRY(status);
    snprintf(text, sizeof text, "%016llx", (unsigned long long)hash);
    json_object_set_new(entry, "bytes", json_integer((json_int_t)info.st_size));
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
