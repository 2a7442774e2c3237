/* Batch manifests (samples/guide/batches.md has one): a capture's own keys win over the defaults, "method" (a name, a
 * file, or an object of keys) is read first, and paths are taken from the manifest's folder. */
#include <jansson.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "pipeline/file.h"
#include "pipeline/json_file.h"
#include "pipeline/memory.h"
#include "tools/batch/batch.h"

#define MANIFEST_LIMIT ((size_t)16 << 20) /* bytes: some hundred thousand captures */

typedef struct manifest {
    npg_batch *batch;
    const npg_batch_given *given;
    char *folder;     /* of the file                                 */
    npg_capture base; /* what "defaults" says; its options are owned */
} manifest;

/* ---- options ---- */

static npg_status set_path(const manifest *m, npg_options *options, const char *key, const json_t *value)
{
    char *path;
    const char *text = json_string_value(value);
    if (!text) return npg_error(NPG_USAGE, "not a path");
    if (!*text) return npg_options_set(options, key, "");
    NPG_TRY(npg_path_from(&m->batch->arena, &path, m->folder, text));
    return npg_options_set(options, key, path);
}

static npg_status set_segments(npg_capture *capture, const json_t *value)
{
    const char *text = json_is_string(value) ? json_string_value(value) : "";
    bool is_auto = !strcmp(text, "auto");
    if (!is_auto && strcmp(text, "one") != 0) return npg_error(NPG_USAGE, "neither \"one\" nor \"auto\"");
    capture->segments = is_auto ? NPG_BATCH_SEGMENTS_AUTO : NPG_BATCH_SEGMENTS_ONE;
    return NPG_OK;
}

static npg_status set_key(const manifest *m, npg_capture *capture, const char *key, const json_t *value)
{
    if (!strcmp(key, "input") || !strcmp(key, "name") || !strcmp(key, "method")) return NPG_OK;
    if (!strcmp(key, "output")) return npg_error(NPG_USAGE, "captures go to folders of the batch's output");
    if (!strcmp(key, "reference")) return set_path(m, capture->options, key, value);
    if (!strcmp(key, "segments")) return set_segments(capture, value);
    if (strcmp(key, "max-time") != 0) return npg_options_set_json(capture->options, key, value);
    capture->max_time_s = json_number_value(value);
    return json_is_number(value) && capture->max_time_s >= 0
               ? NPG_OK
               : npg_error(NPG_USAGE, "not a number of seconds");
}

static npg_status set_method(const manifest *m, npg_capture *capture, const json_t *value)
{
    char *path;
    const char *text = json_string_value(value);
    if (!value) return NPG_OK;
    if (!text || *text == '{' || !strpbrk(text, "./"))
        return npg_options_set_json(capture->options, "method", value);
    NPG_TRY(npg_path_from(&m->batch->arena, &path, m->folder, text));
    return npg_options_set(capture->options, "method", path);
}

/* All of an object, the method first. */
static npg_status set_keys(const manifest *m, npg_capture *capture, json_t *object, const char *place)
{
    const char *key;
    json_t *value;
    npg_status status = set_method(m, capture, json_object_get(object, "method"));
    if (status) return npg_error_prefix(status, "%s.method", place);
    json_object_foreach(object, key, value)
    {
        status = set_key(m, capture, key, value);
        if (status) return npg_error_prefix(status, "%s.%s", place, key);
    }
    return NPG_OK;
}

/* ---- captures ---- */

static bool is_generic(const char *name, size_t length)
{
    static const char *const words[] = {"points", "point_clouds", "points_clouds", "pcl_seqs", "gt", "."};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (strlen(words[i]) == length && !strncmp(words[i], name, length)) return true;
    return memchr(name, '%', length) || memchr(name, '#', length) || memchr(name, '*', length);
}

/* A name from the input's path: the last part of it that says something; a file's without its ending. */
static npg_status name_of(const manifest *m, char **name, const char *input)
{
    char *path;
    struct stat info;
    size_t end = strlen(input), begin;
    for (;; end = begin) {
        while (end && input[end - 1] == '/') end--;
        for (begin = end; begin && input[begin - 1] != '/';) begin--;
        if (begin == end || !is_generic(input + begin, end - begin)) break;
    }
    *name = npg_arena_text(&m->batch->arena, input + begin);
    NPG_TRY(npg_path_from(&m->batch->arena, &path, m->folder, input));
    (*name)[end - begin] = 0;
    char *dot = strrchr(*name, '.');
    if (dot && dot != *name && !input[end] && !stat(path, &info) && S_ISREG(info.st_mode)) *dot = 0;
    return NPG_OK;
}

static npg_status add_capture(const manifest *m, npg_capture **capture, json_t *object)
{
    const json_t *input = json_object_get(object, "input"), *given = json_object_get(object, "name");
    char *name;
    if (!json_is_object(object)) return npg_error(NPG_USAGE, "not an object like {\"input\": \"folder\"}");
    if (!input) return npg_error(NPG_USAGE, "has no \"input\"");
    if (!json_is_string(input) || !json_string_length(input))
        return npg_error(NPG_USAGE, "its input is not a path");
    if (!strcmp(json_string_value(input), "-"))
        return npg_error(NPG_USAGE, "its input can't be standard input");
    if (given && !json_is_string(given)) return npg_error(NPG_USAGE, "its name is not a text");
    if (given) return npg_batch_add(m->batch, capture, json_string_value(given));
    NPG_TRY(name_of(m, &name, json_string_value(input)));
    return npg_batch_add(m->batch, capture, name);
}

static npg_status read_capture(const manifest *m, json_t *object, const char *place)
{
    npg_capture *capture;
    npg_status status = npg_error_prefix(add_capture(m, &capture, object), "%s", place);
    if (status) return status;
    capture->max_time_s = m->base.max_time_s;
    capture->segments = m->base.segments;
    npg_options_close(&capture->options);
    NPG_TRY(npg_options_copy(&capture->options, m->base.options));
    NPG_TRY(set_keys(m, capture, object, place));
    return npg_error_prefix(npg_batch_complete(m->batch, capture, m->folder,
                                               json_string_value(json_object_get(object, "input")), m->given),
                            "%s", place);
}

/* ---- the file ---- */

static npg_status check_top(json_t *root)
{
    const char *key;
    json_t *value, *captures = json_object_get(root, "captures"),
                   *defaults = json_object_get(root, "defaults");
    if (!json_is_object(root)) return npg_error(NPG_USAGE, "not a JSON object");
    json_object_foreach(root, key, value)
    {
        bool known = !strcmp(key, "output") || !strcmp(key, "defaults") || !strcmp(key, "captures");
        if (!known)
            return npg_error(NPG_USAGE,
                             "%s: a manifest has \"output\", \"defaults\" and \"captures\"; "
                             "what holds for all captures stands in \"defaults\"",
                             key);
    }
    if (defaults && !json_is_object(defaults)) return npg_error(NPG_USAGE, "defaults: not a JSON object");
    if (!json_is_array(captures)) return npg_error(NPG_USAGE, "captures: not a list of objects");
    if (!json_array_size(captures)) return npg_error(NPG_USAGE, "captures: the list is empty");
    if (json_object_get(defaults, "input") || json_object_get(defaults, "name"))
        return npg_error(NPG_USAGE, "defaults: each capture has its own \"input\" and \"name\"");
    return NPG_OK;
}

static npg_status find_output(const manifest *m, const json_t *root)
{
    const json_t *output = json_object_get(root, "output");
    if (output && (!json_is_string(output) || !json_string_length(output)))
        return npg_error(NPG_USAGE, "output: not a path");
    if (m->batch->output) return NPG_OK;
    if (!output) return npg_error(NPG_USAGE, "no \"output\" here, and no -o DIR");
    return npg_path_from(&m->batch->arena, &m->batch->output, m->folder, json_string_value(output));
}

static npg_status read_all(manifest *m, json_t *root)
{
    json_t *captures = json_object_get(root, "captures");
    NPG_TRY(check_top(root));
    NPG_TRY(find_output(m, root));
    NPG_TRY(npg_options_open(&m->base.options));
    NPG_TRY(set_keys(m, &m->base, json_object_get(root, "defaults"), "defaults"));
    for (size_t i = 0; i < json_array_size(captures); i++) {
        char place[48];
        snprintf(place, sizeof place, "captures[%zu]", i);
        NPG_TRY(read_capture(m, json_array_get(captures, i), place));
    }
    return NPG_OK;
}

npg_status npg_batch_read_manifest(npg_batch *batch, const npg_batch_given *given)
{
    manifest m = {.batch = batch, .given = given};
    json_t *root;
    const char *slash = strrchr(batch->path, '/');
    m.folder = npg_arena_text(&batch->arena, slash ? batch->path : ".");
    NPG_TRY(npg_arena_status(&batch->arena));
    if (slash) m.folder[slash == batch->path ? 1 : slash - batch->path] = 0;
    NPG_TRY(npg_json_read(&root, batch->path, MANIFEST_LIMIT));
    npg_status status = npg_error_prefix(read_all(&m, root), "%s", batch->path);
    npg_options_close(&m.base.options);
    json_decref(root);
    return status;
}
