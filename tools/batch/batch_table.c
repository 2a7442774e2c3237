/* Table of a batch: on the terminal, and in batch.json with the figures of the captures that are done. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/file.h"
#include "pipeline/json_file.h"
#include "pipeline/memory.h"
#include "tools/batch/batch.h"

/* Of a capture that is done: how far its points are from the surface, in per cent of the diagonal. */
typedef struct figures {
    int64_t frames, good, skipped, measured;
    double sum, worst; /* of the median distance of each frame that has one */
    int64_t worst_number;
} figures;

/* ---- reading ---- */

static npg_status add_frame(void *user, const json_t *line, const char *text, size_t size)
{
    figures *f = user;
    const json_t *error = npg_json_at(line, "figures.point_dist_median");
    (void)text, (void)size;
    if (json_is_true(json_object_get(line, "shared"))) return NPG_OK; /* another segment has it as its own */
    f->frames++;
    f->good += json_is_true(json_object_get(line, "good"));
    f->skipped += json_is_true(json_object_get(line, "skipped"));
    if (!json_is_number(error)) return NPG_OK;
    double percent = 100 * json_number_value(error);
    if (!f->measured++ || percent > f->worst) {
        f->worst = percent;
        f->worst_number = json_integer_value(json_object_get(line, "number"));
    }
    f->sum += percent;
    return NPG_OK;
}

static npg_status read_folder(figures *f, const npg_capture *capture, const char *folder)
{
    char path[NPG_PATH_SIZE];
    if (!folder || !npg_path_stays(folder)) return NPG_OK; /* not what a run has written */
    NPG_TRY(npg_path_of(path, capture->output, folder));
    return npg_is_in_folder(path, "frames.jsonl") ? npg_json_lines(path, "frames.jsonl", -1, add_frame, f)
                                                  : NPG_OK;
}

static npg_status read_capture(figures *f, const npg_capture *capture)
{
    json_t *segments = npg_capture_segments(capture);
    npg_status status = segments ? NPG_OK : read_folder(f, capture, ".");
    for (size_t i = 0; i < json_array_size(segments) && !status; i++)
        status = read_folder(f, capture,
                             json_string_value(json_object_get(json_array_get(segments, i), "folder")));
    json_decref(segments);
    if (status) *f = (figures){0};
    return status;
}

/* Figures of captures that are done; those of one that can't be read are said and left out. */
static npg_status read_all(figures *all, npg_batch *batch)
{
    for (size_t i = 0; i < batch->count; i++) {
        npg_capture *capture = &batch->captures[i];
        if (!npg_batch_is_mine(batch, i)) npg_verdict_read(&capture->verdict, capture);
        if (!npg_verdict_is_done(&capture->verdict)) continue;
        npg_status status = read_capture(&all[i], capture);
        if (status == NPG_MEMORY) return status;
        if (status) fprintf(stderr, "neupig batch: warning: %s\n", npg_error_text());
    }
    return NPG_OK;
}

/* ---- text ---- */

/* "2 (from 7)": how many, and with which frames the later ones begin. */
static void print_segments(FILE *out, const npg_capture *capture)
{
    enum { TOLD = 3, WIDTH = 24 };
    char text[80] = "";
    size_t used = 0;
    json_t *segments = npg_capture_segments(capture);
    size_t count = json_array_size(segments);
    if (count) used = (size_t)snprintf(text, sizeof text, "%zu", count);
    for (size_t i = 1; i < count && i <= TOLD; i++)
        used += (size_t)snprintf(
            text + used, sizeof text - used, "%s%lld", i > 1 ? ", " : " (from ",
            (long long)json_integer_value(json_object_get(json_array_get(segments, i), "first_frame")));
    if (count > 1) snprintf(text + used, sizeof text - used, "%s)", count > TOLD + 1 ? " ..." : "");
    json_decref(segments);
    fprintf(out, "%-*s  ", WIDTH, text);
}

static void print_row(FILE *out, const npg_capture *capture, const figures *f, int name_width,
                      bool with_segments)
{
    const npg_verdict *v = &capture->verdict;
    char time[32] = "", frames[64] = "", error[80] = "", memory[32] = "";
    if (v->is_known) npg_spell_time(time, sizeof time, v->seconds);
    if (v->peak_bytes) snprintf(memory, sizeof memory, "%.0f MiB", (double)v->peak_bytes / 0x1p20);
    if (f->frames) snprintf(frames, sizeof frames, "%lld of %lld", (long long)f->good, (long long)f->frames);
    if (f->measured)
        snprintf(error, sizeof error, "%.3f (%.3f in %lld)", f->sum / (double)f->measured, f->worst,
                 (long long)f->worst_number);
    fprintf(out, "%-*s  %-9s  %-12s  ", name_width, capture->name, v->is_known ? v->word : "not run", frames);
    if (with_segments) print_segments(out, capture);
    fprintf(out, "%-24s  %8s  %9s  %s\n", error, time, memory,
            v->is_known && !npg_verdict_is_done(v) ? v->message : "");
}

static void print_table(FILE *out, const npg_batch *batch, const figures *all)
{
    int width = 7;
    bool with_segments = false;
    for (size_t i = 0; i < batch->count; i++) {
        int length = (int)strlen(batch->captures[i].name);
        if (length > width) width = length;
        with_segments |= batch->captures[i].segments == NPG_BATCH_SEGMENTS_AUTO;
    }
    fprintf(out, "%-*s  %-9s  %-12s  %s%-24s  %8s  %9s\n", width, "capture", "verdict", "good frames",
            with_segments ? "segments                  " : "", "error % (worst in frame)", "time", "memory");
    for (size_t i = 0; i < batch->count; i++)
        print_row(out, &batch->captures[i], &all[i], width, with_segments);
    fprintf(out, "\n%s/batch.json\n", batch->output);
}

/* ---- JSON ---- */

static json_t *json_of_capture(const npg_capture *capture, const figures *f)
{
    json_t *object = npg_verdict_json(capture);
    if (!object) return NULL;
    if (!capture->verdict.is_known) json_object_set_new(object, "verdict", json_string("not run"));
    json_object_set_new(object, "was_done", json_boolean(capture->verdict.was_done));
    if (f->frames)
        json_object_update_new(
            object, json_pack("{sI sI sI so}", "frames", f->frames, "good", f->good, "skipped", f->skipped,
                              "error_percent",
                              npg_json_real(f->measured ? f->sum / (double)f->measured : (double)NAN)));
    if (f->measured)
        json_object_update_new(object, json_pack("{sI so}", "worst_frame", f->worst_number,
                                                 "worst_error_percent", npg_json_real(f->worst)));
    return object;
}

static npg_status write_json(const npg_batch *batch, const figures *all)
{
    json_t *captures = json_array();
    for (size_t i = 0; i < batch->count; i++)
        json_array_append_new(captures, json_of_capture(&batch->captures[i], &all[i]));
    json_t *root =
        json_pack("{s:s,s:o,s:o,s:i,s:o}", "neupig", npg_version(), "batch", npg_json_text(batch->path),
                  "output", npg_json_text(batch->output), "exit_code",
                  npg_status_exit_code(npg_batch_status(batch, true, false)), "captures", captures);
    npg_status status = root ? npg_json_write(batch->output, "batch.json", root)
                             : npg_error(NPG_MEMORY, "no memory for batch.json");
    json_decref(root);
    return status;
}

/* ---- all of it ---- */

npg_status npg_batch_report(npg_batch *batch, FILE *out)
{
    npg_arena scratch = {.purpose = NPG_FOR_RUN};
    figures *all = npg_arena_take(&scratch, batch->count, sizeof *all);
    int fd = -1;
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_file_lock(&fd, batch->output, ".batch.lock", true);
    if (!status) status = read_all(all, batch);
    if (!status) status = write_json(batch, all);
    if (!status && out) print_table(out, batch, all);
    npg_arena_release(&scratch);
    if (fd >= 0) close(fd);
    return status;
}
