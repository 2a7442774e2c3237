/* JSON files that people write: with comments, with the place of an error. */
#include "pipeline/json_file.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "pipeline/memory.h"

/* Blank out comments in place, so that line numbers stay. */
static void blank_comments(char *text)
{
    bool in_string = false;
    for (char *c = text; *c; c++) {
        if (in_string && *c == '\\' && c[1]) {
            c++;
        } else if (*c == '"') {
            in_string = !in_string;
        } else if (!in_string && c[0] == '/' && c[1] == '/') {
            for (; *c && *c != '\n'; c++) *c = ' ';
            if (!*c) break;
        }
    }
}

/* The whole file and a closing zero; takes memory only as the bytes come in. */
static npg_status read_all(char **text, FILE *file, const char *path, size_t limit)
{
    size_t capacity = 0, size = 0, got = 1;
    while (got) {
        NPG_TRY(npg_grow(text, &capacity, size + 4096, 1, NPG_FOR_FILES));
        got = fread(*text + size, 1, capacity - size - 1, file);
        size += got;
        if (ferror(file)) return npg_error(NPG_USAGE, "%s: %s", path, strerror(errno));
        if (size > limit) return npg_error(NPG_USAGE, "%s: larger than %zu MiB", path, limit >> 20);
    }
    (*text)[size] = 0;
    return NPG_OK;
}

static npg_status read_text(char **text, const char *path, size_t limit)
{
    *text = NULL;
    FILE *file = fopen(path, "rb");
    if (!file) return npg_error(NPG_USAGE, "%s: %s", path, strerror(errno));
    npg_status status = read_all(text, file, path, limit);
    fclose(file);
    if (status) npg_release(text);
    return status;
}

npg_status npg_json_parse(json_t **root, char *text, const char *place)
{
    json_error_t error;
    blank_comments(text);
    *root = json_loads(text, JSON_REJECT_DUPLICATES, &error);
    if (*root) return NPG_OK;
    return npg_error(NPG_USAGE, "%s:%d:%d: %s", place, error.line, error.column, error.text);
}

npg_status npg_json_read(json_t **root, char **text, const char *path, size_t limit)
{
    *root = NULL;
    NPG_TRY(read_text(text, path, limit));
    npg_status status = npg_json_parse(root, *text, path);
    if (status) npg_release(text);
    return status;
}
