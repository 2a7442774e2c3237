/* done.json: the last file of a run, which says that all the others are there. */
#include <stdlib.h>
#include <string.h>

#include "export/exporters/exporters_internal.h"
#include "job/job.h"
#include "pipeline/json_file.h"

npg_status npg_done_add(npg_done *done, json_t *entry)
{
    npg_status status = npg_file_print(done->file, done->count++ ? ",\n    " : "\n    ");
    if (!status) status = npg_json_print(done->file, entry, JSON_COMPACT);
    json_decref(entry);
    return status;
}

npg_status npg_done_add_file(npg_done *done, const char *output, const char *name)
{
    json_t *entry = json_pack("{ss}", "path", name);
    npg_status status = npg_file_facts(entry, output, name);
    if (!status) return npg_done_add(done, entry);
    json_decref(entry);
    return status;
}

/* Size and checksum of a mesh, or of another format's file, from the line of the list that has them. */
static npg_status add_line(void *user, const json_t *object, const char *line, size_t size)
{
    json_t *name = json_object_get(object, "file");
    (void)line, (void)size;
    if (!json_is_string(name)) return NPG_OK;
    return npg_done_add(user, json_pack("{sO sO sO}", "path", name, "bytes", json_object_get(object, "bytes"),
                                        "xxh3", json_object_get(object, "xxh3")));
}

static npg_status write_done(npg_done *done, const char *output, const json_t *head, bool has_exports)
{
    static const char *const names[] = {"reference.ply", "frames.jsonl", "report.json"};
    char *text = json_dumps(head, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
    if (!text) return npg_error(NPG_MEMORY, "no memory for done.json");
    size_t size = strlen(text) - 2; /* without the last newline and brace: the files are added */
    npg_status status = npg_file_write(done->file, text, size);
    free(text);
    if (!status) status = npg_file_print(done->file, ",\n  \"files\": [");
    for (size_t i = 0; i < sizeof names / sizeof *names && !status; i++)
        status = npg_done_add_file(done, output, names[i]);
    if (!status) status = npg_json_lines_in(output, "frames.jsonl", add_line, done);
    if (!status && has_exports) status = npg_done_add_file(done, output, "exports.jsonl");
    if (!status && has_exports) status = npg_json_lines_in(output, "exports.jsonl", add_line, done);
    return status ? status : npg_file_print(done->file, "\n  ]\n}\n");
}

npg_status npg_done_end(npg_done *done, const char *output, npg_status status)
{
    bool is_whole = !status;
    status = npg_file_end(&done->file, status);
    if (is_whole && status) npg_file_remove(output, "done.json");
    return status;
}

/* The frame log is what an interrupted run is resumed from: it goes when nothing is left to resume. */
npg_status npg_done_write(const char *output, json_t *head, bool has_exports)
{
    npg_done done = {0};
    npg_status status = npg_export_open(&done.file, output, "done.json");
    if (!status) status = npg_done_end(&done, output, write_done(&done, output, head, has_exports));
    json_decref(head);
    return status ? status : npg_file_remove(output, NPG_FRAME_LOG_NAME);
}
