/* done.json: the last file of a run, which says that all the others are there. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "export/exporters/exporters_internal.h"
#include "job/job.h"
#include "pipeline/json_file.h"

static npg_status write_entry(npg_file *file, const json_t *entry, bool *is_first)
{
    char *text = json_dumps(entry, JSON_COMPACT);
    if (!text) return npg_error(NPG_MEMORY, "no memory for done.json");
    npg_status status = npg_file_print(file, "%s\n    ", *is_first ? "" : ",");
    if (!status) status = npg_file_write(file, text, strlen(text));
    *is_first = false;
    free(text);
    return status;
}

static npg_status write_file_entry(npg_file *file, const char *output, const char *name, bool *is_first)
{
    json_t *entry = json_pack("{ss}", "path", name);
    npg_status status = npg_file_facts(entry, output, name);
    if (!status) status = write_entry(file, entry, is_first);
    json_decref(entry);
    return status;
}

/* Sizes and checksums of the meshes or of the other formats' files, from the lines
 * of the list that has them. */
static npg_status write_entries(npg_file *file, const char *output, const char *list_name, bool *is_first)
{
    char *line = NULL, path[NPG_PATH_SIZE];
    size_t capacity = 0;
    npg_status status = NPG_OK;
    NPG_TRY(npg_path_of(path, output, list_name));
    FILE *list = fopen(path, "re");
    if (!list) status = npg_error_errno(NPG_DISK, "can't read back %s", path);
    while (!status && getline(&line, &capacity, list) > 0) {
        json_t *frame = json_loads(line, 0, NULL), *name = json_object_get(frame, "file");
        if (!frame) status = npg_error(NPG_DISK, "%s was changed while the run wrote it", path);
        if (json_is_string(name)) {
            json_t *entry = json_pack("{sO sO sO}", "path", name, "bytes", json_object_get(frame, "bytes"),
                                      "xxh3", json_object_get(frame, "xxh3"));
            status =
                entry ? write_entry(file, entry, is_first) : npg_error(NPG_MEMORY, "no memory for done.json");
            json_decref(entry);
        }
        json_decref(frame);
    }
    if (list && !status && ferror(list)) status = npg_error_errno(NPG_DISK, "can't read back %s", path);
    if (list) fclose(list);
    free(line);
    return status;
}

static npg_status write_done(npg_file *file, const char *output, const json_t *head, bool has_exports)
{
    static const char *const names[] = {"reference.ply", "frames.jsonl", "report.json"};
    bool is_first = true;
    char *text = json_dumps(head, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
    if (!text) return npg_error(NPG_MEMORY, "no memory for done.json");
    size_t size = strlen(text) - 2; /* without the last newline and brace: the files are added */
    npg_status status = npg_file_write(file, text, size);
    free(text);
    if (!status) status = npg_file_print(file, ",\n  \"files\": [");
    for (size_t i = 0; i < sizeof names / sizeof *names && !status; i++)
        status = write_file_entry(file, output, names[i], &is_first);
    if (!status) status = write_entries(file, output, "frames.jsonl", &is_first);
    if (!status && has_exports) status = write_file_entry(file, output, "exports.jsonl", &is_first);
    if (!status && has_exports) status = write_entries(file, output, "exports.jsonl", &is_first);
    return status ? status : npg_file_print(file, "\n  ]\n}\n");
}

/* The frame log is what an interrupted run is resumed from: it goes when nothing is left to resume. */
npg_status npg_done_write(const char *output, json_t *head, bool has_exports)
{
    char path[NPG_PATH_SIZE], log[NPG_PATH_SIZE];
    npg_file *file = NULL;
    npg_status status = npg_path_of(path, output, "done.json");
    if (!status) status = npg_path_of(log, output, NPG_FRAME_LOG_NAME);
    if (!status) status = npg_file_open(&file, path);
    if (!status) status = write_done(file, output, head, has_exports);
    if (!status) {
        status = npg_file_commit(&file);
        if (status) unlink(path); /* whole it may be, but the run that fails at its last step is not done */
    } else {
        npg_file_discard(&file);
    }
    if (!status && unlink(log) && errno != ENOENT) status = npg_error_errno(NPG_DISK, "can't remove %s", log);
    json_decref(head);
    return status;
}
