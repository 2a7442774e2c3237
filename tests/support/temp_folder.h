/* A folder of a test's own, and small helpers to look into files. */
#ifndef NPG_TEST_TEMP_FOLDER_H
#define NPG_TEST_TEMP_FOLDER_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct temp_folder {
    char path[256];
} temp_folder;

static inline int open_temp_folder(temp_folder *folder)
{
    const char *base = getenv("TMPDIR");
    snprintf(folder->path, sizeof folder->path, "%s/npg-test-XXXXXX", base && *base ? base : "/tmp");
    return mkdtemp(folder->path) ? 0 : -1;
}

static inline void close_temp_folder(temp_folder *folder)
{
    char command[600];
    snprintf(command, sizeof command, "chmod -R u+rwx '%s'; rm -rf '%s'", folder->path, folder->path);
    if (system(command)) fprintf(stderr, "can't remove %s\n", folder->path);
}

/* "<folder>/<name>", valid until the fourth next call. */
static inline const char *in_folder(const temp_folder *folder, const char *name)
{
    static char paths[4][512];
    static unsigned next;
    char *path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", folder->path, name);
    return path;
}

static inline int exists(const char *path)
{
    struct stat info;
    return lstat(path, &info) == 0;
}

/* The whole file as text, to be freed; NULL if it can't be read. */
static inline char *text_of_file(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (!file) return NULL;
    char *text = calloc(1, 1 << 22);
    size_t size = fread(text, 1, (1 << 22) - 1, file);
    text[size] = 0;
    fclose(file);
    return text;
}

static inline int write_text_file(const char *path, const char *text)
{
    FILE *file = fopen(path, "wb");
    if (!file) return -1;
    fputs(text, file);
    return fclose(file);
}

#endif
