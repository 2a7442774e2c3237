/* done.json: the last file of a run, which says that all the others are there. */
#include <stdlib.h>
#include <string.h>

#include "export/exporters/exporters_internal.h"
#include "job/job.h"
#include "pipeline/json_file.h"

npg_status npg_done_add(json_t *files, const char *output, const char *name)
{
    json_t *entry = json_pack("{ss}", "path", name);
    json_array_append_new(files, entry);
    return npg_file_facts(entry, output, name);
}

/* Size and checksum of a mesh, or of another format's file, from the line of the list that has them. */
static npg_status add_line(void *user, const json_t *object, const char *line, size_t size)
{
    json_t *name = json_object_get(object, "file");
    (void)line, (void)size;
    if (json_is_string(name))
        json_array_append_new(
            user, json_pack("{sO sO sO sO* sO* sO*}", "path", name, "bytes", json_object_get(object, "bytes"),
                            "xxh3", json_object_get(object, "xxh3"), "form", json_object_get(object, "form"),
                            "first", json_object_get(object, "first"), "frames",
                            json_object_get(object, "frames")));
    return NPG_OK;
}

static npg_status print_done(npg_file *file, const json_t *head, const json_t *files)
{
    const json_t *entry;
    size_t i;
    char *text = json_dumps(head, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
    if (!text) return npg_error(NPG_MEMORY, "no memory for done.json");
    npg_file_write(file, text,
                   strlen(text) - 2); /* without the last newline and brace: the files are added */
    free(text);
    npg_status status = npg_file_print(file, ",\n  \"files\": [");
    json_array_foreach(files, i, entry)
    {
        if (!status) status = npg_file_print(file, i ? ",\n    " : "\n    ");
        if (!status) status = npg_json_print(file, entry, JSON_COMPACT);
    }
    return status ? status : npg_file_print(file, "\n  ]\n}\n");
}

/* What fails at its last step is not done: then the file goes, though it may be whole. */
npg_status npg_done_write(const char *output, const json_t *head, const json_t *files)
{
    npg_file *file;
    NPG_TRY(npg_file_open_in(&file, output, "done.json"));
    npg_status printed = print_done(file, head, files), status = npg_file_end(&file, printed);
    if (!printed && status) npg_file_remove(output, "done.json");
    return status;
}

npg_status npg_done_add_exports(json_t *files, const char *output)
{
    return npg_json_lines(output, NPG_EXPORT_LIST_NAME, -1, add_line, files);
}

static npg_status list_files(json_t *files, const char *output, bool has_exports)
{
    static const char *const names[] = {"reference.ply", "frames.jsonl", "report.json"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) NPG_TRY(npg_done_add(files, output, names[i]));
    NPG_TRY(npg_json_lines(output, "frames.jsonl", -1, add_line, files));
    return has_exports ? npg_done_add_exports(files, output) : NPG_OK;
}

/* The frame log is what an interrupted run is resumed from: it goes when nothing is left to resume. */
npg_status npg_done_end(const char *output, const json_t *head, bool has_exports)
{
    json_t *files = json_array();
    npg_status status = list_files(files, output, has_exports);
    if (!status) status = npg_done_write(output, head, files);
    json_decref(files);
    if (!status) status = npg_file_remove(output, NPG_EXPORT_LIST_NAME);
    return status ? status : npg_file_remove(output, NPG_FRAME_LOG_NAME);
}

const char *npg_done_option(const json_t *done, const char *name)
{
    const char *text = json_string_value(json_object_get(json_object_get(done, "options"), name));
    return text ? text : "";
}
