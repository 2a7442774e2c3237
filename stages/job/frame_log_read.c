/* Frame log: the lines of an earlier run. */
#include "job/frame_log.h"

#include <errno.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "pipeline/file.h"

npg_status npg_frame_log_each(const char *output, int64_t bytes, npg_json_line_visit *visit, void *user)
{
    char *path;
    NPG_TRY(npg_join_path(&path, output, NPG_FRAME_LOG_NAME));
    npg_status status = npg_json_lines_each(path, bytes, visit, user);
    npg_release(&path);
    return status;
}

/* ---- the log that goes with a state ---- */

npg_status npg_frame_log_sync(const char *output, int64_t bytes, uint64_t *hash)
{
    char *path;
    NPG_TRY(npg_join_path(&path, output, NPG_FRAME_LOG_NAME));
    int fd = open(path, O_RDWR | O_CLOEXEC);
    npg_status status = NPG_OK;
    if (fd < 0 || fdatasync(fd)) status = npg_error_errno(NPG_DISK, "can't sync %s", path);
    if (fd >= 0) close(fd);
    if (!status) status = npg_hash_file(hash, path, (uint64_t)bytes);
    npg_release(&path);
    return status;
}

npg_status npg_frame_log_check(const char *output, int64_t bytes, uint64_t hash)
{
    uint64_t now;
    char *path;
    NPG_TRY(npg_join_path(&path, output, NPG_FRAME_LOG_NAME));
    npg_status status = npg_hash_file(&now, path, (uint64_t)bytes);
    if (!status && now != hash)
        status = npg_error(NPG_BAD_INPUT, "%s was changed since it was written", path);
    npg_release(&path);
    return status;
}

/* ---- appended frames ---- */

typedef struct shortened {
    npg_file *file;
    int64_t below, lines, bytes;
} shortened;

static npg_status keep_line(void *user, const json_t *frame, const char *line, size_t size)
{
    shortened *list = user;
    if (json_integer_value(json_object_get(frame, "index")) >= list->below) return NPG_OK;
    list->lines++;
    list->bytes += (int64_t)size;
    return npg_file_write(list->file, line, size);
}

static npg_status shorten(const char *from, const char *to, int64_t below, int64_t *lines, int64_t *bytes)
{
    struct stat info;
    shortened list = {.below = below};
    if (stat(from, &info)) return npg_error_errno(NPG_DISK, "can't read back %s", from);
    NPG_TRY(npg_file_open(&list.file, to));
    npg_status status = npg_json_lines_each(from, (int64_t)info.st_size, keep_line, &list);
    if (!status)
        status = npg_file_commit(&list.file);
    else
        npg_file_discard(&list.file);
    *lines = list.lines;
    *bytes = list.bytes;
    return status;
}

npg_status npg_frame_log_shorten(const char *output, int64_t below, int64_t *lines, int64_t *bytes)
{
    char *whole, *partial = NULL;
    NPG_TRY(npg_join_path(&whole, output, "frames.jsonl"));
    npg_status status = npg_join_path(&partial, output, NPG_FRAME_LOG_NAME);
    bool is_whole = !status && npg_is_there(whole);
    if (!status) status = shorten(is_whole ? whole : partial, partial, below, lines, bytes);
    if (!status && is_whole && unlink(whole)) status = npg_error_errno(NPG_DISK, "can't remove %s", whole);
    npg_release(&whole);
    npg_release(&partial);
    return status;
}
