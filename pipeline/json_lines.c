/* JSON lines: reading line by line, so that memory does not grow with the file. */
#include "pipeline/json_lines.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "pipeline/file.h"

static npg_status read_lines(FILE *file, const char *path, int64_t bytes, npg_json_line_visit *visit,
                             void *user)
{
    char *line = NULL;
    size_t capacity = 0;
    npg_status status = NPG_OK;
    for (int64_t at = 0; at < bytes && !status;) {
        ssize_t size = getline(&line, &capacity, file);
        json_t *object = size > 0 ? json_loadb(line, (size_t)size, 0, NULL) : NULL;
        if (!json_is_object(object) || at + size > bytes)
            status = npg_error(NPG_BAD_INPUT, "%s was changed since it was written (byte %lld)", path,
                               (long long)at);
        if (!status) status = visit(user, object, line, (size_t)size);
        at += size;
        json_decref(object);
    }
    free(line);
    return status;
}

npg_status npg_json_lines_each(const char *path, int64_t bytes, npg_json_line_visit *visit, void *user)
{
    int fd;
    NPG_TRY(npg_file_open_plain(&fd, path, NPG_DISK));
    FILE *file = fdopen(fd, "r");
    npg_status status = file ? read_lines(file, path, bytes, visit, user)
                             : npg_error_errno(NPG_DISK, "can't read back %s", path);
    if (file)
        fclose(file);
    else
        close(fd);
    return status;
}
