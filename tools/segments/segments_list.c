/* The list of segments, and the folders they lie in. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "export/export.h"
#include "ingest/ingest.h"
#include "pipeline/file.h"
#include "pipeline/json_file.h"
#include "tools/segments/segments.h"

#define LIST "segments.json"

void npg_segments_clear(npg_segments *s)
{
    for (size_t i = 0; i < s->count; i++) json_decref(s->list[i].alarm);
    npg_release(&s->list);
    npg_frame_files_close(&s->frames);
}

npg_status npg_segment_path(char *path, const npg_segments *s, const npg_segment *segment)
{
    return npg_path_of(path, s->output, strcmp(segment->folder, ".") ? segment->folder : "");
}

int64_t npg_segment_number(const npg_segments *s, int64_t place)
{
    return s->frames->slots[place].number;
}

npg_status npg_segments_insert(npg_segments *s, size_t at, const npg_segment *segment)
{
    NPG_TRY(npg_grow(&s->list, &s->capacity, s->count + 1, sizeof *s->list, NPG_FOR_RUN));
    memmove(s->list + at + 1, s->list + at, (s->count - at) * sizeof *s->list);
    s->list[at] = *segment;
    s->count++;
    return NPG_OK;
}

void npg_segment_name(npg_segment *segment, const npg_segments *s)
{
    int width = npg_number_width(npg_segment_number(s, (int64_t)s->frames->count - 1));
    snprintf(segment->folder, sizeof segment->folder, "segment_%0*lld", width,
             (long long)npg_segment_number(s, segment->first));
}

/* ---- reading ---- */

static int64_t number_in(const json_t *object, const char *key)
{
    return (int64_t)json_integer_value(json_object_get(object, key));
}

static npg_status add_saved(npg_segments *s, const json_t *entry)
{
    const char *folder = json_string_value(json_object_get(entry, "folder"));
    npg_segment segment = {.first = number_in(entry, "first"),
                           .last = number_in(entry, "last"),
                           .shared_first = number_in(entry, "shared_first"),
                           .shared_last = number_in(entry, "shared_last"),
                           .keyframe = number_in(entry, "keyframe_wanted")};
    if (!folder || strchr(folder, '/') || strlen(folder) >= sizeof segment.folder || folder[0] == 0 ||
        !strcmp(folder, ".."))
        return npg_error(NPG_USAGE, "%s/%s is damaged; --restart discards what is there", s->output, LIST);
    strcpy(segment.folder, folder);
    if (json_is_object(json_object_get(entry, "alarm")))
        segment.alarm = json_deep_copy(json_object_get(entry, "alarm"));
    return npg_segments_insert(s, s->count, &segment);
}

static bool is_of_these(const npg_segments *s, const json_t *saved)
{
    const char *selection = json_string_value(json_object_get(saved, "selection"));
    return !s->frames || (selection && !strcmp(selection, s->selection) &&
                          number_in(saved, "frames") == (int64_t)s->frames->count);
}

npg_status npg_segments_load(npg_segments *s)
{
    json_t *saved;
    npg_status status = npg_json_load(&saved, s->output, LIST, NPG_USAGE);
    if (status == NPG_USAGE) npg_error(status, "%s; --restart discards what is there", npg_error_text());
    const json_t *list = json_object_get(saved, "segments");
    for (size_t i = 0; i < json_array_size(list) && !status; i++)
        status = add_saved(s, json_array_get(list, i));
    if (!status && s->count && !is_of_these(s, saved))
        status = npg_error(NPG_USAGE,
                           "%s holds segments of other frames; "
                           "give --restart to discard what is there, or choose another output folder",
                           s->output);
    json_decref(saved);
    return status;
}

/* Whether a folder was done with this word of option alarm. */
static bool is_done_with(const char *folder, const char *word)
{
    json_t *done = npg_json_in(folder, "done.json");
    const char *alarm = json_string_value(npg_json_at(done, "options.alarm"));
    bool is = alarm && !strcmp(alarm, word);
    json_decref(done);
    return is;
}

bool npg_segments_was_alarmed(const npg_segments *s)
{
    json_t *report = npg_json_in(s->output, "report.json");
    const json_t *topology = npg_json_at(report, "stages.evaluate.topology");
    bool was = is_done_with(s->output, "report") && (json_is_object(json_object_get(topology, "forward")) ||
                                                     json_is_object(json_object_get(topology, "backward")));
    json_decref(report);
    return was;
}

/* ---- files ---- */

static npg_status remove_in(const char *folder, const char *name)
{
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, folder, name));
    return npg_folder_remove(path);
}

/* ---- other verbs ---- */

/* "OUT/segment_0000 (frames 0 to 6), ...", as many as there is room for. */
static void describe_segments(char *text, size_t size, const json_t *list, const char *output)
{
    size_t used = 0;
    for (size_t i = 0; i < json_array_size(list) && used < size; i++) {
        const json_t *entry = json_array_get(list, i);
        const char *folder = json_string_value(json_object_get(entry, "folder"));
        used += (size_t)snprintf(text + used, size - used, "%s%s/%s (frames %lld to %lld)", i ? ", " : "",
                                 output, folder ? folder : "", (long long)number_in(entry, "first_frame"),
                                 (long long)number_in(entry, "last_frame"));
    }
}

npg_status npg_segments_refuse(const char *folder, const char *verb, bool is_alone)
{
    json_t *saved = npg_json_in(folder, LIST);
    const json_t *list = json_object_get(saved, "segments");
    npg_status status = NPG_OK;
    char text[512];
    if (json_array_size(list) > 1 && !is_alone) {
        describe_segments(text, sizeof text, list, folder);
        status = npg_error(NPG_USAGE,
                           "%s holds a capture in %zu segments with a reference each; "
                           "neupig %s takes one of them: %s",
                           folder, json_array_size(list), verb, text);
    } else if (json_array_size(list) > 1) {
        status = npg_error(NPG_USAGE,
                           "%s holds a capture in %zu segments, and neupig %s continues with one reference: "
                           "run the frames that came later into a folder of their own "
                           "(neupig run INPUT -o NEW --segments auto --frames FIRST:), "
                           "or all of them again (--restart)",
                           folder, json_array_size(list), verb);
    } else if (is_alone && !list &&
               is_done_with(folder, "split")) { /* one of several, whose list lies elsewhere */
        status = npg_error(NPG_USAGE,
                           "%s is one segment of a capture; neupig %s would separate it from the others: "
                           "run the frames that came later into a folder of their own",
                           folder, verb);
    }
    json_decref(saved);
    return status;
}

npg_status npg_segments_drop_outdated(const char *output)
{
    json_t *saved = npg_json_in(output, LIST), *done = npg_json_in(output, "done.json");
    bool is_old = saved && number_in(saved, "frames") != number_in(done, "frames");
    json_decref(saved);
    json_decref(done);
    return is_old ? remove_in(output, LIST) : NPG_OK;
}

/* ---- writing ---- */

static json_t *json_of(const npg_segments *s, const npg_segment *segment)
{
    return json_pack("{ss sI sI sI sI sI sI sI sO?}", "folder", segment->folder, "first",
                     (json_int_t)segment->first, "last", (json_int_t)segment->last, "first_frame",
                     (json_int_t)npg_segment_number(s, segment->first), "last_frame",
                     (json_int_t)npg_segment_number(s, segment->last), "shared_first",
                     (json_int_t)segment->shared_first, "shared_last", (json_int_t)segment->shared_last,
                     "keyframe_wanted", (json_int_t)segment->keyframe, "alarm", segment->alarm);
}

static json_t *json_of_all(const npg_segments *s)
{
    json_t *list = json_array();
    for (size_t i = 0; i < s->count; i++) json_array_append_new(list, json_of(s, &s->list[i]));
    return json_pack("{ss sI so}", "selection", s->selection, "frames", (json_int_t)s->frames->count,
                     "segments", list);
}

npg_status npg_segments_save(const npg_segments *s)
{
    json_t *saved = json_of_all(s);
    npg_status status = npg_json_write(s->output, LIST, saved);
    json_decref(saved);
    return status;
}

/* ---- removing ---- */

/* OUT itself may hold more than what a run left. */
npg_status npg_segment_remove(const npg_segments *s, const npg_segment *segment)
{
    if (strcmp(segment->folder, ".") != 0) return remove_in(s->output, segment->folder);
    NPG_TRY(remove_in(s->output, "job"));
    NPG_TRY(npg_folder_clear(s->output));
    char meshes[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(meshes, s->output, "meshes"));
    rmdir(meshes); /* stays where it holds files of others */
    return remove_in(s->output, "topology.json");
}

npg_status npg_segments_remove(const npg_segments *s)
{
    NPG_TRY(remove_in(s->output, "done.json"));
    for (size_t i = 0; i < s->count; i++)
        if (strcmp(s->list[i].folder, ".") != 0) NPG_TRY(remove_in(s->output, s->list[i].folder));
    return remove_in(s->output, LIST);
}

/* ---- the end ---- */

/* What a reader wants to know of a segment without opening its folder. */
static npg_status add_report(json_t *entry, const npg_segments *s, const npg_segment *segment)
{
    char folder[NPG_PATH_SIZE];
    NPG_TRY(npg_segment_path(folder, s, segment));
    json_t *report = npg_json_in(folder, "report.json");
    if (!report) return npg_error(NPG_DISK, "can't read back %s/report.json", folder);
    json_object_set(entry, "status", json_object_get(report, "status"));
    json_object_set(entry, "keyframe", npg_json_at(report, "stages.keyframe.key.number"));
    json_object_set(entry, "topology", npg_json_at(report, "stages.evaluate.topology"));
    json_decref(report);
    return NPG_OK;
}

/* What is there and says the same stays as it is: a capture that was done is not touched. */
static npg_status write_if_new(const npg_segments *s, const char *name, const json_t *value)
{
    json_t *before = npg_json_in(s->output, name);
    bool is_same = before && json_equal(before, value);
    json_decref(before);
    return is_same ? NPG_OK : npg_json_write(s->output, name, value);
}

static npg_status write_done(const npg_segments *s, bool is_partial)
{
    json_t *files = json_array();
    npg_status status = NPG_OK;
    for (size_t i = 0; i <= s->count && !status; i++) {
        char name[64] = LIST;
        if (i) snprintf(name, sizeof name, "%s/done.json", s->list[i - 1].folder);
        json_t *entry = json_pack("{ss}", "path", name);
        status = npg_file_facts(entry, s->output, name);
        json_array_append_new(files, entry);
    }
    json_t *done = json_pack("{ss ss si sI sI so}", "neupig", npg_version(), "status",
                             is_partial ? "partial" : "ok", "exit_code", is_partial ? 7 : 0, "frames",
                             (json_int_t)s->frames->count, "segments", (json_int_t)s->count, "files", files);
    if (!status) status = write_if_new(s, "done.json", done);
    /* whole it may be, but what fails at its last step is not done */
    if (status) npg_file_remove(s->output, "done.json");
    json_decref(done);
    return status;
}

/* The frames that each two neighbours share. */
static json_t *json_of_overlaps(const npg_segments *s)
{
    json_t *overlaps = json_array();
    for (size_t i = 1; i < s->count; i++) {
        const npg_segment *a = &s->list[i - 1], *b = &s->list[i];
        json_t *frames = json_array();
        for (int64_t k = b->first - b->shared_first; k <= a->last + a->shared_last; k++)
            json_array_append_new(frames, json_integer(npg_segment_number(s, k)));
        json_array_append_new(overlaps,
                              json_pack("{s[ss] so}", "between", a->folder, b->folder, "frames", frames));
    }
    return overlaps;
}

npg_status npg_segments_conclude(const npg_segments *s, bool is_partial)
{
    json_t *saved = json_of_all(s), *list = json_object_get(saved, "segments");
    npg_status status = NPG_OK;
    for (size_t i = 0; i < s->count && !status; i++)
        status = add_report(json_array_get(list, i), s, &s->list[i]);
    json_object_set_new(saved, "overlaps", json_of_overlaps(s));
    json_object_set_new(saved, "status", json_string(is_partial ? "partial" : "ok"));
    if (!status) status = write_if_new(s, LIST, saved);
    json_decref(saved);
    return !status && s->count > 1 ? write_done(s, is_partial) : status;
}
