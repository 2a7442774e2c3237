/* Figures of a capture that is done: how far its points are from the surface, frame by frame. */
#include "batch_figures.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "memory.h"

static npg_status copy_text(char **out, const json_t *value)
{
    const char *text = json_string_value(value);
    return text ? npg_copy_text(out, text) : NPG_OK;
}

static npg_status add_frame(npg_capture_figures *f, const json_t *line)
{
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
    NPG_TRY(copy_text(&frame->file, json_object_get(line, "file")));
    return copy_text(&frame->source, json_object_get(line, "source"));
}

static npg_status read_lines(npg_capture_figures *f, FILE *file, const char *path)
{
    char *line = NULL;
    size_t size = 0;
    npg_status status = NPG_OK;
    while (!status && getline(&line, &size, file) >= 0) {
        json_error_t error;
        json_t *value = json_loads(line, 0, &error);
        if (value)
            status = add_frame(f, value);
        else
            status = npg_error(NPG_BAD_INPUT, "%s: line %zu: %s", path, f->count + 1, error.text);
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

npg_status npg_figures_read(npg_capture_figures *f, const npg_capture *capture)
{
    char *path;
    const char *bar = npg_options_get(capture->options, "max-residual");
    *f = (npg_capture_figures){.mean = (double)NAN, .bar = bar ? strtod(bar, NULL) : (double)NAN};
    NPG_TRY(npg_join_path(&path, capture->output, "frames.jsonl"));
    npg_status status = NPG_OK;
    FILE *file = fopen(path, "re");
    if (file) {
        status = read_lines(f, file, path);
        fclose(file);
    } else if (errno != ENOENT) {
        status = npg_error_errno(NPG_BAD_INPUT, "%s", path);
    }
    npg_release(&path);
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
    f->count = f->capacity = f->worst = 0;
}
