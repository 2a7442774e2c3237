/* Table of a batch: on the terminal, in batch.json and in batch.html. */
#include "tools/batch/batch_table.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "pipeline/json_file.h"
#include "pipeline/memory.h"
#include "tools/batch/batch_page.h"
#include "tools/batch/batch_segments.h"
#include "tools/batch/batch_verdict.h"
#include "tools/batch/batch_view.h"
#include "tools/progress.h"

/* ---- text ---- */

enum { SEGMENTS_WIDTH = 24 };

static void print_segments(FILE *out, const npg_capture_figures *f)
{
    char text[80];
    npg_batch_segments_text(text, sizeof text, f->segments);
    fprintf(out, "%-*s  ", SEGMENTS_WIDTH, text);
}

static void print_row(FILE *out, const npg_capture *capture, const npg_capture_figures *f, int name_width,
                      bool with_segments)
{
    const npg_verdict *v = &capture->verdict;
    char time[32] = "", frames[64] = "", error[80] = "", memory[32] = "";
    if (v->is_known) npg_spell_time(time, sizeof time, v->seconds);
    if (v->peak_bytes) snprintf(memory, sizeof memory, "%.0f MiB", (double)v->peak_bytes / 0x1p20);
    if (f->count) snprintf(frames, sizeof frames, "%zu of %zu", f->good, f->count);
    if (f->worst < f->count)
        snprintf(error, sizeof error, "%.3f (%.3f in %lld)", f->mean, f->frames[f->worst].error,
                 (long long)f->frames[f->worst].number);
    fprintf(out, "%-*s  %-9s  %-12s  ", name_width, capture->name, v->is_known ? v->word : "not run", frames);
    if (with_segments) print_segments(out, f);
    fprintf(out, "%-24s  %8s  %9s  %s\n", error, time, memory,
            v->is_known && !npg_verdict_is_done(v) ? v->message : "");
}

static void print_table(FILE *out, const npg_batch *batch, const npg_capture_figures *figures)
{
    int width = 7;
    bool with_segments = npg_batch_has_segments(batch);
    for (size_t i = 0; i < batch->count; i++)
        if ((int)strlen(batch->captures[i].name) > width) width = (int)strlen(batch->captures[i].name);
    fprintf(out, "%-*s  %-9s  %-12s  ", width, "capture", "verdict", "good frames");
    if (with_segments) fprintf(out, "%-*s  ", SEGMENTS_WIDTH, "segments");
    fprintf(out, "%-24s  %8s  %9s\n", "error % (worst in frame)", "time", "memory");
    for (size_t i = 0; i < batch->count; i++)
        print_row(out, &batch->captures[i], &figures[i], width, with_segments);
    fprintf(out, "\n%s/batch.html\n%s/batch.json\n", batch->output, batch->output);
}

/* ---- JSON ---- */

static json_t *json_of_capture(const npg_capture *capture, const npg_capture_figures *f)
{
    json_t *object = npg_verdict_json(capture);
    if (!object) return NULL;
    if (!capture->verdict.is_known) json_object_set_new(object, "verdict", json_string("not run"));
    json_object_set_new(object, "was_done", json_boolean(capture->verdict.was_done));
    if (!f->count) return object;
    json_object_set_new(object, "frames", json_integer((json_int_t)f->count));
    json_object_set_new(object, "good", json_integer((json_int_t)f->good));
    json_object_set_new(object, "skipped", json_integer((json_int_t)f->skipped));
    json_object_set_new(object, "error_percent", npg_json_real(f->mean));
    if (f->worst == f->count) return object;
    json_object_set_new(object, "worst_frame", json_integer((json_int_t)f->frames[f->worst].number));
    json_object_set_new(object, "worst_error_percent", npg_json_real(f->frames[f->worst].error));
    return object;
}

static npg_status write_json(const npg_batch *batch, const npg_capture_figures *figures)
{
    json_t *captures = json_array();
    for (size_t i = 0; i < batch->count; i++)
        json_array_append_new(captures, json_of_capture(&batch->captures[i], &figures[i]));
    json_t *root = json_pack("{s:s,s:o,s:o,s:i,s:o}", "neupig", npg_version(), "batch",
                             npg_json_text(batch->path), "output", npg_json_text(batch->output), "exit_code",
                             npg_batch_exit_code(batch, true, false), "captures", captures);
    npg_status status = root ? npg_json_write(batch->output, "batch.json", root)
                             : npg_error(NPG_MEMORY, "no memory for batch.json");
    json_decref(root);
    return status;
}

/* ---- all of it ---- */

/* Figures of captures that are done; those of one that can't be read are said and left out. */
static npg_status read_figures(npg_capture_figures *figures, npg_batch *batch)
{
    for (size_t i = 0; i < batch->count; i++) {
        npg_capture *capture = &batch->captures[i];
        if (!npg_batch_is_mine(batch, i)) npg_verdict_read(&capture->verdict, capture);
        if (!npg_verdict_is_done(&capture->verdict)) continue;
        npg_status status = npg_figures_read(&figures[i], capture);
        if (status == NPG_MEMORY) return status;
        if (status) fprintf(stderr, "neupig batch: warning: %s\n", npg_error_text());
    }
    return NPG_OK;
}

static npg_status report(npg_batch *batch, npg_capture_figures *figures, FILE *out)
{
    NPG_TRY(read_figures(figures, batch));
    NPG_TRY(write_json(batch, figures));
    NPG_TRY(npg_batch_views_write(batch));
    NPG_TRY(npg_batch_page_write(batch, figures));
    if (out) print_table(out, batch, figures);
    return NPG_OK;
}

static npg_status lock(int *fd, const npg_batch *batch)
{
    char *path;
    NPG_TRY(npg_join_path(&path, batch->output, ".batch.lock"));
    npg_status status = NPG_OK;
    *fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (*fd < 0) status = npg_error_errno(NPG_DISK, "can't open %s", path);
    while (!status && flock(*fd, LOCK_EX))
        if (errno != EINTR) status = npg_error_errno(NPG_DISK, "can't lock %s", path);
    npg_release(&path);
    return status;
}

npg_status npg_batch_report(npg_batch *batch, FILE *out)
{
    npg_capture_figures *figures = NULL;
    int fd = -1;
    npg_status status = npg_make_folder(batch->output);
    if (!status) status = lock(&fd, batch);
    if (!status) status = npg_alloc_array(&figures, NPG_FOR_RUN, batch->count, sizeof *figures);
    if (!status) status = report(batch, figures, out);
    for (size_t i = 0; figures && i < batch->count; i++) npg_figures_clear(&figures[i]);
    npg_release(&figures);
    if (fd >= 0) close(fd);
    return status;
}
