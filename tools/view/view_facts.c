/* Facts: what a page knows of a result beside meshes and points, as JSON. */
#include <stdio.h>
#include <string.h>

#include "ingest/ingest.h"
#include "pipeline/json_file.h"
#include "pipeline/plan.h"
#include "tools/view/view.h"

/* ---- frames ---- */

static json_t *json_of_frame(const npg_view_frame *frame)
{
    static const char *const copied[] = {"key",         "skipped", "held",   "good",
                                         "unexplained", "points",  "figures"};
    json_t *out = json_pack("{sI sI sb}", "index", (json_int_t)frame->index, "number",
                            (json_int_t)frame->number, "mesh", frame->file != NULL);
    for (size_t i = 0; i < sizeof copied / sizeof *copied && out; i++) {
        json_t *value = json_object_get(frame->line, copied[i]);
        if (value) json_object_set(out, copied[i], value);
    }
    return out;
}

/* ---- windows ---- */

/* All frames of the run, those that are not solved yet as well. */
static int64_t frames_in_all(const npg_view_part *part)
{
    int64_t count = part->count ? part->frames[part->count - 1].index + 1 : 0;
    int64_t listed = (int64_t)json_array_size(json_object_get(part->job, "frames"));
    int64_t done = (int64_t)json_integer_value(json_object_get(part->done, "frames"));
    if (listed > count) count = listed;
    return done > count ? done : count;
}

static int64_t key_of(const npg_view_part *part)
{
    for (size_t i = 0; i < part->count; i++)
        if (json_is_true(json_object_get(part->frames[i].line, "key"))) return part->frames[i].index;
    return -1;
}

/* [[first, last], ...] by index; of frames that were appended the windows are those of one run over all. */
static json_t *json_of_windows(const npg_view_part *part)
{
    json_t *windows = json_array();
    npg_plan plan = {.frame_count = frames_in_all(part), .key = key_of(part)};
    plan.window = npg_plan_window_asked((int64_t)npg_view_number(npg_view_run_options(part), "window", 0),
                                        plan.frame_count);
    plan.overlap = (int64_t)npg_view_number(npg_view_run_options(part), "overlap", 0);
    if (plan.window <= 0 || plan.window > plan.frame_count) plan.window = plan.frame_count;
    if (plan.overlap >= plan.window) plan.overlap = plan.window - 1;
    if (plan.key < 0 || plan.frame_count > 1000000 || plan.overlap < 0) return windows;
    for (int64_t i = 0; i < npg_plan_window_count(&plan, -1); i++) {
        npg_window window = npg_plan_window(&plan, i, -1);
        json_array_append_new(windows, json_pack("[II]", (json_int_t)window.first, (json_int_t)window.last));
    }
    return windows;
}

/* ---- parts ---- */

static json_t *json_of_part(const npg_view_part *part)
{
    const npg_mesh *mesh = part->reference;
    json_t *topology = npg_json_at(part->report, "stages.evaluate.topology"), *frames = json_array();
    json_t *out =
        json_pack("{so sI sI sI sI sf sf sf so so}", "label", npg_json_text(part->label), "vertices",
                  (json_int_t)(mesh ? mesh->vert_count : 0), "faces",
                  (json_int_t)(mesh ? mesh->face_count : 0), "group", (json_int_t)part->group, "frame_count",
                  (json_int_t)frames_in_all(part), "diagonal", part->diagonal, "cover", part->cover_share,
                  "bar", npg_view_number(npg_view_run_options(part), "bars.residual", 0.5), "windows",
                  json_of_windows(part), "frames", frames);
    if (!out) return NULL;
    for (size_t i = 0; i < part->count; i++) json_array_append_new(frames, json_of_frame(&part->frames[i]));
    if (part->origin.known)
        json_object_set_new(
            out, "origin",
            json_pack("[fff]", part->origin.world[0], part->origin.world[1], part->origin.world[2]));
    if (json_is_object(topology)) json_object_set(out, "alarm", topology);
    return out;
}

/* As option up says; else as a rig has it, by the report or (`seen`, or NULL) by itself, where results have its axes. */
static npg_up up_by(const json_t *options, const json_t *report, const char *seen)
{
    const json_t *ingest = json_object_get(json_object_get(report, "stages"), "ingest");
    const char *up = json_string_value(json_object_get(options, "up")),
               *axes = json_string_value(json_object_get(options, "axes"));
    if (report) seen = json_string_value(json_object_get(json_object_get(ingest, "rig"), "up"));
    if (up && !strcmp(up, "z")) return NPG_UP_Z;
    for (int i = 0; seen && axes && !strcmp(axes, "xyz") && npg_up_words[i]; i++)
        if (!strcmp(seen, npg_up_words[i])) return (npg_up)i;
    return NPG_UP_Y;
}

npg_up npg_view_up(const json_t *report)
{
    return up_by(json_object_get(json_object_get(report, "stages"), "export"), report, NULL);
}

/* A run at work has no report yet, but a rig that can be asked. */
static npg_up up_of(const npg_view_part *part)
{
    const char *input = json_string_value(json_object_get(part->job, "input")), *seen = NULL;
    char text[NPG_PATH_SIZE];
    npg_up up;
    snprintf(text, sizeof text, "%s#0", input ? input : "");
    if (!part->report && npg_rig_is_frame(text) && !npg_rig_up_of(&up, text)) seen = npg_up_words[up];
    return up_by(npg_view_run_options(part), part->report, seen);
}

json_t *npg_view_result_json(const npg_view_result *result)
{
    const npg_view_part *first = &result->parts[0];
    const json_t *done = first->done;
    double fps = npg_view_number(npg_view_run_options(first), "fps", 30);
    json_t *parts = json_array(), *warnings = json_array();
    for (size_t i = 0; i < result->part_count; i++) {
        json_array_append_new(parts, json_of_part(&result->parts[i]));
        json_array_append(warnings, json_object_get(result->parts[i].report, "warnings"));
    }
    json_t *out = json_pack("{so so sb sf ss so so}", "name", npg_json_text(result->name), "path",
                            npg_json_text(result->path), "done", result->is_done, "fps",
                            fps > 0 && fps < 1e6 ? fps : 30, "up", npg_up_words[up_of(first)], "parts", parts,
                            "warnings", warnings);
    const json_t *source = result->segments ? result->segments : done;
    if (out && json_is_string(json_object_get(source, "status")))
        json_object_set(out, "status", json_object_get(source, "status"));
    return out;
}
