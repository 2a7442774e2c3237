/* JSON: files that people write, with comments and the place of an error; files that the program writes and reads
 * back; and values from data that JSON can't hold as it is. */
#include "pipeline/json_file.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "pipeline/file.h"
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

npg_status npg_json_parse(json_t **root, char *text, const char *place)
{
    json_error_t error;
    blank_comments(text);
    *root = json_loads(text, JSON_REJECT_DUPLICATES, &error);
    if (*root) return NPG_OK;
    return npg_error(NPG_USAGE, "%s:%d:%d: %s", place, error.line, error.column, error.text);
}

npg_status npg_json_read(json_t **root, const char *path, size_t limit)
{
    struct stat info;
    size_t room = 0;
    char nothing[] = "", *text = NULL;
    *root = NULL;
    FILE *file = fopen(path, "rb");
    bool is_read = file && !fstat(fileno(file), &info);
    bool is_large = is_read && (size_t)info.st_size > limit;
    bool has_text = is_read && !is_large && getdelim(&text, &room, 0, file) >= 0; /* an empty file has none */
    if (is_read && !is_large && !has_text) is_read = !ferror(file);
    npg_status status = is_large   ? npg_error(NPG_USAGE, "%s: larger than %zu MiB", path, limit >> 20)
                        : !is_read ? npg_error(NPG_USAGE, "%s: %s", path, strerror(errno))
                                   : npg_json_parse(root, has_text ? text : nothing, path);
    if (file) fclose(file);
    free(text);
    return status;
}

/* ---- values ---- */

/* Length of the UTF-8 sequence that begins at text, 0 if it is none. */
static size_t sequence_length(const char *text)
{
    for (size_t length = 1; length <= 4 && strnlen(text, length) == length; length++) {
        json_t *sequence = json_stringn(text, length);
        json_decref(sequence);
        if (sequence) return length;
    }
    return 0;
}

json_t *npg_json_text(const char *text)
{
    if (!text) return json_null();
    json_t *value = json_string(text);
    if (value) return value;
    char *copy;
    if (npg_copy_text(&copy, text)) return NULL;
    for (char *c = copy; *c;) {
        size_t length = sequence_length(c);
        if (!length) *c = '?';
        c += length ? length : 1;
    }
    value = json_string(copy);
    npg_release(&copy);
    return value;
}

json_t *npg_json_real(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

json_t *npg_json_place(const double at[3])
{
    return json_pack("[ooo]", npg_json_real(at[0]), npg_json_real(at[1]), npg_json_real(at[2]));
}

npg_status npg_json_print(npg_file *file, const json_t *value, size_t flags)
{
    char *text = json_dumps(value, flags);
    if (!text) return npg_error(NPG_MEMORY, "no memory for a file's text");
    npg_status status = npg_file_write(file, text, strlen(text));
    free(text);
    return status;
}

npg_status npg_json_write(const char *folder, const char *name, const json_t *value)
{
    npg_file *file;
    NPG_TRY(npg_file_open_in(&file, folder, name));
    npg_status status = npg_json_print(file, value, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    if (!status) npg_file_write(file, "\n", 1);
    return npg_file_end(&file, status);
}

/* ---- lines ---- */

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

npg_status npg_json_lines(const char *folder, const char *name, int64_t bytes, npg_json_line_visit *visit,
                          void *user)
{
    char path[NPG_PATH_SIZE];
    struct stat info;
    int fd;
    NPG_TRY(npg_path_of(path, folder, name));
    NPG_TRY(npg_file_open_plain(&fd, path, NPG_DISK));
    if (bytes < 0) bytes = fstat(fd, &info) ? 0 : (int64_t)info.st_size;
    FILE *file = fdopen(fd, "r");
    npg_status status = file ? read_lines(file, path, bytes, visit, user)
                             : npg_error_errno(NPG_DISK, "can't read back %s", path);
    if (file)
        fclose(file);
    else
        close(fd);
    return status;
}

/* ---- what lists say of files ---- */

npg_status npg_file_facts(json_t *entry, const char *output, const char *file)
{
    char path[NPG_PATH_SIZE], text[17];
    uint64_t hash;
    struct stat info;
    NPG_TRY(npg_path_of(path, output, file));
    NPG_TRY(npg_hash_file(&hash, path, UINT64_MAX));
    if (stat(path, &info)) return npg_error_errno(NPG_DISK, "can't read back %s", path);
    snprintf(text, sizeof text, "%016llx", (unsigned long long)hash);
    json_object_set_new(entry, "bytes", json_integer((json_int_t)info.st_size));
    json_object_set_new(entry, "xxh3", json_string(text));
    return NPG_OK;
}

npg_status npg_file_check(const json_t *entry, const char *output, const char *file)
{
    if (!npg_path_stays(file))
        return npg_error(NPG_BAD_INPUT, "%s: the list of files names %s, which is not in it", output, file);
    if (!npg_is_in_folder(output, file)) return npg_error(NPG_BAD_INPUT, "%s/%s is missing", output, file);
    json_t *now = json_object();
    npg_status status = npg_file_facts(now, output, file);
    if (!status && (!json_equal(json_object_get(now, "bytes"), json_object_get(entry, "bytes")) ||
                    !json_equal(json_object_get(now, "xxh3"), json_object_get(entry, "xxh3"))))
        status = npg_error(NPG_BAD_INPUT, "%s/%s was changed since it was written", output, file);
    json_decref(now);
    return status == NPG_DISK ? NPG_BAD_INPUT : status;
}

npg_status npg_json_load(json_t **value, const char *folder, const char *name, npg_status damaged)
{
    char path[NPG_PATH_SIZE];
    json_error_t error;
    int fd;
    *value = NULL;
    NPG_TRY(npg_path_of(path, folder, name));
    if (access(path, F_OK) && (errno == ENOENT || errno == ENOTDIR)) return NPG_OK;
    NPG_TRY(npg_file_open_plain(&fd, path, damaged));
    *value = json_loadfd(fd, 0, &error);
    close(fd);
    if (json_is_object(*value)) return NPG_OK;
    json_decref(*value);
    *value = NULL;
    return npg_error(damaged, "%s is damaged (line %d: %s)", path, error.line, error.text);
}

json_t *npg_json_in(const char *folder, const char *name)
{
    char path[NPG_PATH_SIZE];
    return npg_path_of(path, folder, name) ? NULL : json_load_file(path, 0, NULL);
}

json_t *npg_json_at(const json_t *object, const char *names)
{
    char name[64];
    for (const char *at = names; *at && object; at += *at == '.') {
        size_t length = strcspn(at, ".");
        snprintf(name, sizeof name, "%.*s", (int)length, at);
        object = json_object_get(object, name);
        at += length;
    }
    return (json_t *)object;
}
