/* Frame log: the lines of an earlier run. */
#include "job/job_internal.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "pipeline/file.h"

npg_status npg_frame_log_each(const char *output, int64_t bytes, npg_json_line_visit *visit, void *user)
{
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, output, NPG_FRAME_LOG_NAME));
    return npg_json_lines_each(path, bytes, visit, user);
}

/* ---- the log that goes with a state ---- */

npg_status npg_frame_log_sync(const char *output, int64_t bytes, uint64_t *hash)
{
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, output, NPG_FRAME_LOG_NAME));
    int fd = open(path, O_RDWR | O_CLOEXEC);
    npg_status status = NPG_OK;
    if (fd < 0 || fdatasync(fd)) status = npg_error_errno(NPG_DISK, "can't sync %s", path);
    if (fd >= 0) close(fd);
    return status ? status : npg_hash_file(hash, path, (uint64_t)bytes);
}

npg_status npg_frame_log_check(const char *output, int64_t bytes, uint64_t hash)
{
    uint64_t now;
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, output, NPG_FRAME_LOG_NAME));
    NPG_TRY(npg_hash_file(&now, path, (uint64_t)bytes));
    return now == hash ? NPG_OK : npg_error(NPG_BAD_INPUT, "%s was changed since it was written", path);
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
    status = npg_file_end(&list.file, status);
    *lines = list.lines;
    *bytes = list.bytes;
    return status;
}

npg_status npg_frame_log_shorten(const char *output, int64_t below, int64_t *lines, int64_t *bytes)
{
    char whole[NPG_PATH_SIZE], partial[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(whole, output, "frames.jsonl"));
    NPG_TRY(npg_path_of(partial, output, NPG_FRAME_LOG_NAME));
    NPG_TRY(shorten(npg_is_there(whole) ? whole : partial, partial, below, lines, bytes));
    return npg_file_remove(output, "frames.jsonl");
}
