/* Figures of a capture that is done: how far its points are from the surface, frame by frame. */
#include "tools/batch/batch_figures.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/file.h"
#include "pipeline/memory.h"
#include "tools/batch/batch_segments.h"

static npg_status copy_text(char **out, const json_t *value)
{
    const char *text = json_string_value(value);
    return text ? npg_copy_text(out, text) : NPG_OK;
}

/* A path that a segment's list has, seen from the capture's output. */
static npg_status set_file(char **out, const char *folder, const json_t *value)
{
    const char *text = json_string_value(value);
    if (!text || !strcmp(folder, ".")) return copy_text(out, value);
    return npg_join_path(out, folder, text);
}

static npg_status add_frame(npg_capture_figures *f, const json_t *line, const char *folder)
{
    if (json_is_true(json_object_get(line, "shared"))) return NPG_OK; /* another segment has it as its own */
    NPG_TRY(npg_grow(&f->frames, &f->capacity, f->count + 1, sizeof *f->frames, NPG_FOR_FILES));
    npg_frame_figures *frame = &f->frames[f->count++];
    const json_t *error = json_object_get(json_object_get(line, "figures"), "point_dist_median");
    *frame =
        (npg_frame_figures){.number = json_integer_value(json_object_get(line, "number")),
                            .error = json_is_number(error) ? 100 * json_number_value(error) : (double)NAN,
                            .good = json_is_true(json_object_get(line, "good")),
                            .skipped = json_is_true(json_object_get(line, "skipped"))};
    f->good += frame->good;
    f->skipped += frame->skipped;
    NPG_TRY(set_file(&frame->file, folder, json_object_get(line, "file")));
    return copy_text(&frame->source, json_object_get(line, "source"));
}

static npg_status read_lines(npg_capture_figures *f, FILE *file, const char *path, const char *folder)
{
    char *line = NULL;
    size_t size = 0, number = 0;
    npg_status status = NPG_OK;
    while (!status && getline(&line, &size, file) >= 0) {
        json_error_t error;
        json_t *value = json_loads(line, 0, &error);
        number++;
        if (value)
            status = add_frame(f, value, folder);
        else
            status = npg_error(NPG_BAD_INPUT, "%s: line %zu: %s", path, number, error.text);
        json_decref(value);
    }
    free(line);
    return status;
}

static void sum_up(npg_capture_figures *f)
{
    double sum = 0;
    size_t counted = 0;
    f->worst = f->count;
    for (size_t i = 0; i < f->count; i++) {
        if (!isfinite(f->frames[i].error)) continue;
        if (f->worst == f->count || f->frames[i].error > f->frames[f->worst].error) f->worst = i;
        sum += f->frames[i].error;
        counted++;
    }
    f->mean = counted ? sum / (double)counted : (double)NAN;
}

/* folder: "." or a segment's. */
static npg_status read_folder(npg_capture_figures *f, const npg_capture *capture, const char *folder)
{
    char *place, *path;
    NPG_TRY(strcmp(folder, ".") ? npg_join_path(&place, capture->output, folder)
                                : npg_copy_text(&place, capture->output));
    npg_status status = npg_join_path(&path, place, "frames.jsonl");
    npg_release(&place);
    NPG_TRY(status);
    FILE *file = fopen(path, "re");
    if (file) {
        status = read_lines(f, file, path, folder);
        fclose(file);
    } else if (errno != ENOENT) {
        status = npg_error_errno(NPG_BAD_INPUT, "%s", path);
    }
    npg_release(&path);
    return status;
}

npg_status npg_figures_read(npg_capture_figures *f, const npg_capture *capture)
{
    const char *bar = npg_options_get(capture->options, "max-residual");
    npg_status status = NPG_OK;
    *f = (npg_capture_figures){.mean = (double)NAN,
                               .bar = bar ? strtod(bar, NULL) : (double)NAN,
                               .segments = npg_batch_segments(capture)};
    if (!f->segments) status = read_folder(f, capture, ".");
    for (size_t i = 0; i < json_array_size(f->segments) && !status; i++)
        status = read_folder(f, capture,
                             json_string_value(json_object_get(json_array_get(f->segments, i), "folder")));
    sum_up(f);
    if (status) npg_figures_clear(f);
    return status;
}

void npg_figures_clear(npg_capture_figures *f)
{
    for (size_t i = 0; i < f->count; i++) {
        npg_release(&f->frames[i].file);
        npg_release(&f->frames[i].source);
    }
    npg_release(&f->frames);
    json_decref(f->segments);
    f->segments = NULL;
    f->count = f->capacity = f->worst = 0;
}
