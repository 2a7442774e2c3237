/* Segments: a capture whose topology changes, as several runs with a reference each. */
#include "tools/segments/segments.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/file.h"
#include "pipeline/options.h"
#include "pipeline/stage.h"

static int64_t option_number(const npg_options *options, const char *name)
{
    return strtoll(npg_options_get(options, name), NULL, 10);
}

/* ---- the frames of a segment, as --frames has them ---- */

/* By their numbers, as in 0-6,8-13. */
static npg_status frames_text(char **text, const npg_segments *s, int64_t first, int64_t last)
{
    size_t size = 48 * (size_t)(last - first + 1) + 1, used = 0;
    NPG_TRY(npg_alloc(text, NPG_FOR_RUN, size));
    for (int64_t i = first, end; i <= last; i = end + 1) {
        for (end = i; end < last && npg_segment_number(s, end + 1) == npg_segment_number(s, end) + 1;) end++;
        used += (size_t)snprintf(*text + used, size - used, "%s%lld-%lld", used ? "," : "",
                                 (long long)npg_segment_number(s, i), (long long)npg_segment_number(s, end));
    }
    return NPG_OK;
}

/* ---- one segment ---- */

static npg_status set_number(npg_options *options, const char *name, int64_t value)
{
    char text[32];
    snprintf(text, sizeof text, "%lld", (long long)value);
    return npg_options_set(options, name, text);
}

/* What makes the options of the whole those of a segment. */
static npg_status set_segment_options(npg_options *options, const npg_segments *s, const npg_segment *segment)
{
    char *frames, path[NPG_PATH_SIZE];
    if (!strcmp(segment->folder, ".")) return npg_options_set(options, "alarm", "split");
    NPG_TRY(frames_text(&frames, s, segment->first - segment->shared_first,
                        segment->last + segment->shared_last));
    npg_status status = npg_options_set(options, "frames", frames);
    npg_release(&frames);
    NPG_TRY(status);
    NPG_TRY(npg_segment_path(path, s, segment));
    NPG_TRY(npg_options_set(options, "output", path));
    NPG_TRY(set_number(options, "shared-first", segment->shared_first));
    NPG_TRY(set_number(options, "shared-last", segment->shared_last));
    NPG_TRY(set_number(options, "keyframe", segment->keyframe));
    NPG_TRY(npg_options_set(options, "restart", "no"));
    return npg_options_set(options, "alarm", "split");
}

/* With option confine, what stands in the place of one of the folders of OUT must not be a link. */
static npg_status refuse_link(const npg_segments *s, const npg_options *options, const char *name)
{
    npg_settings settings;
    char folder[NPG_PATH_SIZE];
    npg_options_fill(options, npg_run_options, &settings);
    if (!settings.confine || !strcmp(name, ".")) return NPG_OK;
    NPG_TRY(npg_path_of(folder, s->output, name));
    return npg_folder_is_own(folder);
}

static npg_status run_segment(const npg_segments *s, const npg_segment *segment, const npg_options *options,
                              npg_reporter *reporter)
{
    npg_options *own;
    NPG_TRY(refuse_link(s, options, segment->folder));
    NPG_TRY(npg_options_copy(&own, options));
    npg_status status = set_segment_options(own, s, segment);
    if (!status && strcmp(segment->folder, ".") != 0)
        npg_reporter_log(reporter, NPG_LOG_INFO, 0, "segments", "%s: frames %lld to %lld", segment->folder,
                         (long long)npg_segment_number(s, segment->first),
                         (long long)npg_segment_number(s, segment->last));
    if (!status) status = npg_run_once(own, reporter);
    npg_options_close(&own);
    return status;
}

/* ---- cutting ---- */

/* The segment of the keyframe keeps its side of the cut; the result is the other. */
static npg_segment cut_segment(npg_segment *kept, const json_t *topology, int64_t overlap)
{
    npg_segment rest = *kept;
    const json_t *alarm = json_object_get(topology, "alarm");
    int64_t begin = kept->first - kept->shared_first;
    int64_t from = begin + (int64_t)json_integer_value(json_object_get(alarm, "from_index"));
    rest.keyframe = -1;
    rest.alarm = json_deep_copy(alarm);
    if (!strcmp(json_string_value(json_object_get(topology, "direction")), "forward")) {
        rest.first = from;
        kept->last = from - 1;
        rest.shared_first = overlap < from - kept->first ? overlap : from - kept->first;
        kept->shared_last = 0;
    } else {
        rest.last = from;
        kept->first = from + 1;
        rest.shared_last = overlap < kept->last - from ? overlap : kept->last - from;
        kept->shared_first = 0;
    }
    return rest;
}

/* What the run that ended at the change left goes first: killed in between, it is made again. */
static npg_status split_segment(npg_segments *s, size_t at, const npg_options *options,
                                npg_reporter *reporter)
{
    char folder[NPG_PATH_SIZE];
    npg_segment *segment = &s->list[at];
    NPG_TRY(npg_segment_path(folder, s, segment));
    json_t *topology = npg_json_in(folder, "topology.json");
    if (!topology) return npg_error(NPG_DISK, "can't read back %s/topology.json", folder);
    int64_t key = segment->first - segment->shared_first +
                  (int64_t)json_integer_value(json_object_get(topology, "key_index"));
    NPG_TRY(npg_segment_remove(s, segment));
    npg_segment rest = cut_segment(segment, topology, option_number(options, "overlap"));
    segment->keyframe = npg_segment_number(s, key);
    npg_segment_name(segment, s);
    npg_segment_name(&rest, s);
    json_decref(topology);
    npg_reporter_log(reporter, NPG_LOG_INFO, 0, "segments", "a new reference for frames %lld to %lld",
                     (long long)npg_segment_number(s, rest.first),
                     (long long)npg_segment_number(s, rest.last));
    npg_status status = npg_segments_insert(s, rest.first > segment->first ? at + 1 : at, &rest);
    if (status) json_decref(rest.alarm);
    return status ? status : npg_segments_save(s);
}

/* ---- all of them ---- */

/* Done before without segments, and there was an alarm: what it left makes way for the segments. */
static npg_status solve_again(const npg_segments *s, const npg_options *options, npg_reporter *reporter)
{
    npg_reporter_log(reporter, NPG_LOG_INFO, 0, "segments",
                     "%s was done with one reference, which does not explain all frames: it is solved again",
                     s->output);
    NPG_TRY(npg_segment_remove(s, &s->list[0]));
    return run_segment(s, &s->list[0], options, reporter);
}

static npg_status solve_all(npg_segments *s, const npg_options *options, npg_reporter *reporter)
{
    for (size_t i = 0; i < s->count;) {
        npg_status status = run_segment(s, &s->list[i], options, reporter);
        if (status == NPG_PARTIAL && !strcmp(s->list[i].folder, ".") && npg_segments_was_alarmed(s))
            status = solve_again(s, options, reporter);
        if (status == NPG_CHANGED) {
            NPG_TRY(split_segment(s, i, options, reporter));
            i = 0; /* those before are found done at once */
            continue;
        }
        if (status && status != NPG_PARTIAL) return status;
        s->list[i++].is_partial = status == NPG_PARTIAL;
    }
    return NPG_OK;
}

static npg_status load_or_begin(npg_segments *s, const npg_options *options)
{
    bool restarts = !strcmp(npg_options_get(options, "restart"), "yes");
    npg_segment whole = {
        .last = (int64_t)s->frames->count - 1, .keyframe = option_number(options, "keyframe"), .folder = "."};
    npg_status status = npg_segments_load(s);
    if (status && !(status == NPG_USAGE && restarts)) return status;
    if (restarts && s->count) NPG_TRY(npg_segments_remove(s));
    if (s->count && !restarts) return NPG_OK;
    for (size_t i = 0; i < s->count; i++) json_decref(s->list[i].alarm);
    s->count = 0;
    return npg_segments_insert(s, 0, &whole);
}

static npg_status run_all(npg_segments *s, const npg_options *options, npg_reporter *reporter)
{
    bool is_partial = false;
    NPG_TRY(npg_capture_list(&s->frames, options, s->selection));
    NPG_TRY(load_or_begin(s, options));
    NPG_TRY(solve_all(s, options, reporter));
    for (size_t i = 0; i < s->count; i++) is_partial |= s->list[i].is_partial;
    NPG_TRY(npg_segments_conclude(s, is_partial));
    return is_partial ? NPG_PARTIAL : NPG_OK;
}

npg_status npg_segments_run(const npg_options *options, npg_reporter *reporter)
{
    npg_segments s = {.output = npg_options_get(options, "output"),
                      .selection = npg_options_get(options, "frames")};
    int lock = -1;
    const char *input = npg_options_get(options, "input");
    npg_status status = NPG_OK;
    if (!input[0] || !strcmp(input, "-"))
        status =
            npg_error(NPG_USAGE, "segments = auto reads frames again; a live source can't give them again");
    if (!status) status = npg_file_lock(&lock, s.output, ".segments.lock", false);
    if (!status) status = run_all(&s, options, reporter);
    if (lock >= 0) close(lock);
    npg_segments_clear(&s);
    npg_reporter_end(reporter, status, npg_options_get(options, "output"));
    return status;
}

npg_status npg_segments_require_none(const npg_options *options)
{
    npg_segments s = {.output = npg_options_get(options, "output"), .selection = NULL};
    npg_status status = npg_segments_load(&s);
    bool are_many = s.count > 1, restarts = !strcmp(npg_options_get(options, "restart"), "yes");
    if (!status && are_many && !restarts)
        status = npg_error(NPG_USAGE,
                           "%s holds a capture in %zu segments: give --segments auto to continue it, "
                           "--restart to discard it, or choose another output folder",
                           s.output, s.count);
    if (!status && restarts && s.count) status = npg_segments_remove(&s);
    npg_segments_clear(&s);
    return status;
}
