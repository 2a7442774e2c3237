/* Log files: one JSON object per line. */
#include "tools/log_file.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/* "2026-11-20T08:46:37.123Z" */
static void spell_now(char *text, size_t size)
{
    struct timespec now;
    struct tm parts;
    clock_gettime(CLOCK_REALTIME, &now);
    gmtime_r(&now.tv_sec, &parts);
    size_t length = strftime(text, size, "%Y-%m-%dT%H:%M:%S", &parts);
    snprintf(text + length, size - length, ".%03ldZ", now.tv_nsec / 1000000);
}

static char *spell_line(json_t *record)
{
    char now[40];
    spell_now(now, sizeof now);
    json_t *line = json_pack("{s:s}", "time", now);
    if (line) json_object_update(line, record);
    char *text = json_dumps(line, JSON_COMPACT | JSON_REAL_PRECISION(6)), *grown = NULL;
    json_decref(line);
    size_t length = text ? strlen(text) : 0;
    if (text) grown = realloc(text, length + 2);
    if (!grown) {
        free(text);
        return NULL;
    }
    memcpy(grown + length, "\n", 2);
    return grown;
}

void npg_log_file_write(int *fd, json_t *record)
{
    char *line = *fd >= 0 && record ? spell_line(record) : NULL;
    if (line) {
        size_t length = strlen(line);
        ssize_t written = write(*fd, line, length);
        if (written != (ssize_t)length) {
            fprintf(stderr, "neupig: the log file can't be written any more: %s\n",
                    written < 0 ? strerror(errno) : "no room for a whole line");
            close(*fd);
            *fd = -1;
        }
    }
    free(line);
    json_decref(record);
}
