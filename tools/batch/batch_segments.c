/* Segments of a capture, as the batch's verdicts, tables and pages show them. */
#include "tools/batch/batch_segments.h"

#include <stdio.h>
#include <string.h>

#include "pipeline/file.h"
#include "pipeline/memory.h"

static bool is_folder_name(const char *name)
{
    return name && *name && !strchr(name, '/') && strcmp(name, "..") != 0;
}

static json_t *number_of(const json_t *entry, const char *key)
{
    return json_integer(json_integer_value(json_object_get(entry, key)));
}

/* NULL: not what a run has written. */
static json_t *json_of(const json_t *entry)
{
    json_t *folder = json_object_get(entry, "folder"), *status = json_object_get(entry, "status"),
           *cause = json_object_get(json_object_get(entry, "alarm"), "cause");
    if (!is_folder_name(json_string_value(folder)) || !json_is_string(status)) return NULL;
    return json_pack("{sO so so so sO sO?}", "folder", folder, "first_frame", number_of(entry, "first_frame"),
                     "last_frame", number_of(entry, "last_frame"), "keyframe", number_of(entry, "keyframe"),
                     "status", status, "cause", json_is_string(cause) ? cause : NULL);
}

json_t *npg_batch_segments(const npg_capture *capture)
{
    char *path;
    if (capture->segments != NPG_BATCH_SEGMENTS_AUTO) return NULL;
    if (npg_join_path(&path, capture->output, "segments.json")) return NULL;
    json_t *saved = json_load_file(path, 0, NULL), *list = json_object_get(saved, "segments");
    json_t *segments = json_array_size(list) ? json_array() : NULL;
    for (size_t i = 0; segments && i < json_array_size(list); i++)
        if (json_array_append_new(segments, json_of(json_array_get(list, i)))) {
            json_decref(segments);
            segments = NULL;
        }
    json_decref(saved);
    npg_release(&path);
    return segments;
}

bool npg_batch_has_segments(const npg_batch *batch)
{
    for (size_t i = 0; i < batch->count; i++)
        if (batch->captures[i].segments == NPG_BATCH_SEGMENTS_AUTO) return true;
    return false;
}

void npg_batch_segments_text(char *text, size_t size, const json_t *segments)
{
    enum { TOLD = 3 };
    size_t count = json_array_size(segments), used;
    text[0] = 0;
    if (!count) return;
    used = (size_t)snprintf(text, size, "%zu%s", count, count > 1 ? " (from " : "");
    for (size_t i = 1; i < count && i <= TOLD && used < size; i++)
        used += (size_t)snprintf(
            text + used, size - used, "%s%lld", i > 1 ? ", " : "",
            (long long)json_integer_value(json_object_get(json_array_get(segments, i), "first_frame")));
    if (count > 1 && used < size) snprintf(text + used, size - used, "%s)", count > TOLD + 1 ? " ..." : "");
}
