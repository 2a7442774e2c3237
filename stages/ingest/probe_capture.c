/* What a capture holds, what a run would trip over, what it would cost: all of it, as numbers and as text
 * (npg_capture_probe()). */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ingest/ingest_internal.h"

typedef struct job {
    const npg_options *options;
    const char *input;
    npg_frame_files *list; /* NULL for standard input             */
    npg_rig_view *views;   /* per sensor of a rig; owned, or NULL */
    npg_rig_view *before;  /* the same before option align-sensors; owned, or NULL */
    npg_probe probe;
} job;

static bool option_on(const npg_options *options, const char *name)
{
    const char *text = npg_options_get(options, name);
    return text &&
           (!strcmp(text, "yes") || !strcmp(text, "true") || !strcmp(text, "on") || !strcmp(text, "1"));
}

/* ---- reading ---- */

#define APART_MOST    0.004 /* of the depth, between what two sensors see: 1 cm at 2.5 m, more than noise */
#define OVERLAP_LEAST 0.02

static npg_status align_sensors(job *j)
{
    if (!j->list->rig || !option_on(j->options, "align-sensors")) return NPG_OK;
    NPG_TRY(npg_frame_files_compare(j->list, &j->before));
    npg_rig_correct(j->list->rig, j->before);
    return NPG_OK;
}

static void warn_of_sensor(job *j, size_t s, bool is_any_off)
{
    const npg_rig *rig = j->list->rig;
    const npg_rig_view *v = &j->views[s];
    const char *name = rig->sensors[s].name;
    char text[160];
    npg_rig_describe_pose(text, sizeof text, rig, v);
    if (v->verdict == NPG_RIG_OFF)
        npg_probe_warn(&j->probe, "sensor %s: its pose is %s; --align-sensors corrects it", name, text);
    npg_rig_describe_length(text, sizeof text, rig, v->apart);
    if (!is_any_off && v->apart > APART_MOST * v->depth)
        npg_probe_warn(&j->probe, "sensor %s sees surfaces %s beside those that others see: its pose?", name,
                       text);
    if (rig->sensor_count > 1 && v->frames && v->overlap < OVERLAP_LEAST)
        npg_probe_warn(&j->probe, "sensor %s sees almost nothing that others see: its pose?", name);
}

/* A sensor that is off makes the others seem apart from it, too: then only that one is named. */
static void warn_of_sensors(job *j)
{
    bool is_any_off = false;
    size_t count = j->list->rig->sensor_count;
    for (size_t s = 0; s < count; s++) is_any_off = is_any_off || j->views[s].verdict == NPG_RIG_OFF;
    for (size_t s = 0; s < count; s++) warn_of_sensor(j, s, is_any_off);
}

static npg_status read_files(job *j)
{
    NPG_TRY(npg_capture_list(&j->list, j->options, NULL));
    NPG_TRY(align_sensors(j));
    npg_status status = npg_probe_files(&j->probe, j->list);
    if (!status && j->list->rig) status = npg_frame_files_compare(j->list, &j->views);
    if (!status && j->list->rig) warn_of_sensors(j);
    return status;
}

static npg_status read_all(job *j)
{
    npg_status status = strcmp(j->input, "-") ? read_files(j) : npg_probe_stream(&j->probe);
    if (!status && !j->probe.facts->frames) status = npg_error(NPG_BAD_INPUT, "%s: no frames", j->input);
    return status;
}

/* ---- output ---- */

static void print_pose(FILE *out, const job *j, size_t s)
{
    const npg_rig *rig = j->list->rig;
    char text[160];
    if (j->before && j->before[s].verdict == NPG_RIG_OFF) {
        npg_rig_describe_pose(text, sizeof text, rig, &j->before[s]);
        fprintf(out, "pose      %-12s %s, corrected; then\n", rig->sensors[s].name, text);
    }
    npg_rig_describe_pose(text, sizeof text, rig, &j->views[s]);
    fprintf(out, "pose      %-12s %s\n", rig->sensors[s].name, text);
}

/* What no run can make of a capture, or NULL. */
static const char *limit_of(const job *j)
{
    return j->list && j->list->rig && j->list->rig->sensor_count == 1
               ? "one sensor: the surface is an open shell without a back, unless the body turns before it"
               : NULL;
}

/* What `run --axes` turns to y up. */
static const char *const up_axes[] = {"xyz", "xz-y", "x-y-z", "x-zy"};

static void print_sensors(FILE *out, const job *j)
{
    const npg_rig *rig = j->list ? j->list->rig : NULL;
    for (size_t s = 0; rig && j->views && s < rig->sensor_count; s++) {
        const npg_rig_view *v = &j->views[s];
        fprintf(out, "sensor    %-12s %zu images, %zu points each", rig->sensors[s].name,
                rig->sensors[s].shot_count, v->frames ? v->points / v->frames : 0);
        char text[160];
        npg_rig_describe_length(text, sizeof text, rig, v->apart);
        if (rig->sensor_count > 1)
            fprintf(out, "; overlap %.0f %%, there %s beside the others", 100 * v->overlap, text);
        fputc('\n', out);
    }
    for (size_t s = 0; rig && j->views && rig->sensor_count > 1 && s < rig->sensor_count; s++)
        print_pose(out, j, s);
    if (limit_of(j)) fprintf(out, "limit     %s\n", limit_of(j));
    if (!rig) return;
    npg_up up = npg_rig_up(rig);
    fprintf(out, "up        %s, as the sensors stand", npg_up_words[up]);
    if (up != NPG_UP_Y) fprintf(out, "; run --axes %s gives results with y up", up_axes[up]);
    fputc('\n', out);
}

static json_t *json_of_sensors(const job *j)
{
    json_t *list = json_array();
    const npg_rig *rig = j->list->rig;
    for (size_t s = 0; s < rig->sensor_count; s++) {
        const npg_rig_view *v = &j->views[s];
        json_t *one = json_pack("{so sI sI sf sf}", "name", npg_json_text(rig->sensors[s].name), "images",
                                (json_int_t)rig->sensors[s].shot_count, "points",
                                (json_int_t)(v->frames ? v->points / v->frames : 0), "overlap", v->overlap,
                                "apart", v->apart);
        npg_rig_report_pose(one, v);
        if (j->before) {
            json_t *before = json_object();
            npg_rig_report_pose(before, &j->before[s]);
            json_object_set_new(one, "before", before);
        }
        json_array_append_new(list, one);
    }
    return list;
}

static npg_status set_json(job *j)
{
    const npg_probe *p = &j->probe;
    npg_capture_facts *f = p->facts;
    const double *lo = f->box_low, *hi = f->box_high;
    json_t *box = lo[0] <= hi[0] ? json_pack("{s:[fff],s:[fff],s:f}", "low", lo[0], lo[1], lo[2], "high",
                                             hi[0], hi[1], hi[2], "diagonal", npg_bounds_diagonal(&p->bounds))
                                 : json_null();
    json_t *all = json_pack(
        "{s:s,s:I,s:I,s:I,s:O,s:{s:I,s:I,s:I,s:I},s:I,s:I,s:o,s:I,s:f,s:O,s:{s:I,s:I,s:f,s:f,s:f},s:O}",
        "input", j->input, "frames", (json_int_t)f->frames, "gaps", (json_int_t)f->missing, "unreadable",
        (json_int_t)f->unreadable, "formats", p->formats, "points", "least", (json_int_t)f->points_least,
        "median", (json_int_t)f->points_median, "most", (json_int_t)f->points_most, "total",
        (json_int_t)f->points_total, "not_finite", (json_int_t)f->not_finite, "frames_with_normals",
        (json_int_t)f->with_normals, "box", box, "bytes", (json_int_t)f->bytes, "read_s", p->read_s,
        "attention", p->attention, "estimate", "vertices", (json_int_t)f->vertices, "window",
        (json_int_t)f->window, "memory_bytes", f->memory_bytes, "disk_bytes", f->disk_bytes, "time_s",
        f->time_s, "per_frame", p->per_frame);
    if (j->views) json_object_set_new(all, "sensors", json_of_sensors(j));
    if (limit_of(j)) json_object_set_new(all, "limit", json_string(limit_of(j)));
    if (j->list && j->list->rig)
        json_object_set_new(all, "up", json_string(npg_up_words[npg_rig_up(j->list->rig)]));
    char *text = json_dumps(all, JSON_INDENT(1) | JSON_REAL_PRECISION(10));
    npg_status status = text ? npg_copy_text((char **)&f->json, text) : npg_error(NPG_MEMORY, "no memory");
    free(text);
    json_decref(all);
    return status;
}

static void print_text(FILE *out, const job *j)
{
    const npg_probe *p = &j->probe;
    const npg_capture_facts *f = p->facts;
    const double *lo = f->box_low, *hi = f->box_high;
    const char *format;
    json_t *value;
    size_t i;
    fprintf(out, "frames    %zu", f->frames);
    json_object_foreach(p->formats, format, value)
        fprintf(out, ", %s %d", format, (int)json_integer_value(value));
    fprintf(out, "; missing %zu, unreadable %zu\n", f->missing, f->unreadable);
    fprintf(out, "points    %zu to %zu per frame, median %zu; %zu not finite\n", f->points_least,
            f->points_most, f->points_median, f->not_finite);
    fprintf(out, "normals   in %zu of %zu frames\n", f->with_normals, f->frames - f->unreadable);
    if (lo[0] <= hi[0])
        fprintf(out, "box       %.6g %.6g %.6g .. %.6g %.6g %.6g, diagonal %.6g\n", lo[0], lo[1], lo[2],
                hi[0], hi[1], hi[2], npg_bounds_diagonal(&p->bounds));
    fprintf(out, "files     %.1f MiB, read in %.2f s\n", (double)f->bytes / 0x1p20, p->read_s);
    fprintf(out,
            "estimate  memory %.0f MiB, disk %.0f MiB, time %.0f s "
            "(%zu vertices, windows of %zu frames; bodies that move fast take twice the time)\n",
            f->memory_bytes / 0x1p20, f->disk_bytes / 0x1p20, f->time_s, f->vertices, f->window);
    print_sensors(out, j);
    json_array_foreach(p->attention, i, value) fprintf(out, "attention %s\n", json_string_value(value));
}

/* Unreadable frames are bad input unless the run would continue without them. */
static npg_status status_of(const job *j)
{
    if (j->probe.facts->unreadable && !option_on(j->options, "keep-going"))
        return npg_error(NPG_BAD_INPUT, "%s", j->probe.first_fault);
    return j->probe.facts->attention ? NPG_PARTIAL : NPG_OK;
}

static npg_status set_text(const job *j)
{
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    if (out) print_text(out, j);
    bool is_whole = out && fclose(out) == 0;
    npg_status status =
        is_whole ? npg_copy_text((char **)&j->probe.facts->text, text) : npg_error(NPG_MEMORY, "no memory");
    free(text);
    return status;
}

static npg_status look(job *j)
{
    NPG_TRY(read_all(j));
    npg_probe_finish(&j->probe, j->options);
    NPG_TRY(set_json(j));
    return set_text(j);
}

npg_status npg_capture_probe(npg_capture_facts **out, const npg_options *options)
{
    NPG_REQUIRE(out && options);
    NPG_TRY(npg_alloc(out, NPG_FOR_FILES, sizeof **out));
    (*out)->struct_size = sizeof **out;
    job j = {.options = options,
             .input = npg_options_get(options, "input"),
             .probe = {.facts = *out,
                       .bounds = npg_bounds_empty(),
                       .last = npg_bounds_empty(),
                       .formats = json_object(),
                       .attention = json_array(),
                       .per_frame = json_array()}};
    npg_status status = look(&j);
    if (status)
        npg_capture_facts_close(out);
    else
        status = status_of(&j);
    npg_release(&j.views);
    npg_release(&j.before);
    npg_frame_files_close(&j.list);
    npg_release(&j.probe.counts);
    json_decref(j.probe.formats);
    json_decref(j.probe.attention);
    json_decref(j.probe.per_frame);
    return status;
}

void npg_capture_facts_close(npg_capture_facts **slot)
{
    if (!slot || !*slot) return;
    npg_release((char **)&(*slot)->text);
    npg_release((char **)&(*slot)->json);
    npg_release(slot);
}
