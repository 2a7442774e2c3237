/* Dry run of a batch: what its captures hold and would take. */
#include "tools/batch/batch_estimate.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/statvfs.h>

#include "pipeline/file.h"
#include "pipeline/json_file.h"
#include "pipeline/memory.h"
#include "tools/probe/probe_capture.h"
#include "tools/progress.h"

typedef struct sums {
    size_t captures, frames, gaps, bad, with_attention;
    double disk_bytes, memory_bytes, time_s; /* memory: of the largest */
} sums;

typedef struct probed {
    npg_probe probe;
    npg_frame_files *list;
    npg_estimate estimate;
    char cause[1024]; /* why it would fail, "" when it would not */
} probed;

static bool is_on(const npg_options *options, const char *name)
{
    const char *text = npg_options_get(options, name);
    return text && strchr("ytoYTO1", text[0]) && strcmp(text, "off") != 0 && text[0];
}

static npg_status probe_capture(probed *p, const npg_capture *capture)
{
    npg_probe_init(&p->probe);
    if (capture->refusal) {
        snprintf(p->cause, sizeof p->cause, "%s", capture->refusal);
        return NPG_OK;
    }
    npg_status status = npg_capture_list(&p->list, capture->options);
    if (!status) status = npg_probe_files(&p->probe, p->list);
    if (status == NPG_MEMORY) return status;
    if (status) {
        snprintf(p->cause, sizeof p->cause, "%s", npg_error_text());
        return NPG_OK;
    }
    npg_probe_warn_of_all(&p->probe);
    npg_probe_estimate_run(&p->estimate, &p->probe, capture->options);
    if (p->probe.unreadable && !is_on(capture->options, "keep-going"))
        snprintf(p->cause, sizeof p->cause, "%s", p->probe.first_fault);
    return NPG_OK;
}

static void print_row(const npg_capture *capture, probed *p)
{
    char time[32];
    const npg_estimate *e = &p->estimate;
    npg_spell_time(time, sizeof time, e->time_s);
    printf("%-24s  %7zu  %5zu  %9zu  %8.0f MiB  %8.0f MiB  %9s\n", capture->name, p->probe.frames,
           p->list ? p->list->gap_count : 0, npg_probe_counts(&p->probe).median, e->memory_bytes / 0x1p20,
           e->disk_bytes / 0x1p20, time);
    if (p->cause[0]) printf("    would fail: %s\n", p->cause);
    if (capture->segments == NPG_BATCH_SEGMENTS_AUTO)
        printf("    segments: the time is that of one reference; each cut solves frames again\n");
    for (size_t i = 0; i < json_array_size(p->probe.attention); i++)
        printf("    attention: %s\n", json_string_value(json_array_get(p->probe.attention, i)));
}

static void print_line(const npg_capture *capture, probed *p)
{
    const npg_estimate *e = &p->estimate;
    json_t *line = json_pack(
        "{s:s,s:o,s:o,s:I,s:I,s:I,s:f,s:f,s:f,s:O,s:s}", "event", "estimate", "name",
        npg_json_text(capture->name), "input", npg_json_text(capture->input), "frames",
        (json_int_t)p->probe.frames, "gaps", (json_int_t)(p->list ? p->list->gap_count : 0), "points_median",
        (json_int_t)npg_probe_counts(&p->probe).median, "memory_bytes", e->memory_bytes, "disk_bytes",
        e->disk_bytes, "time_s", e->time_s, "attention", p->probe.attention, "would_fail", p->cause);
    bool is_auto = capture->segments == NPG_BATCH_SEGMENTS_AUTO;
    json_object_set_new(line, "segments", json_string(is_auto ? "auto" : "one"));
    char *text = json_dumps(line, JSON_COMPACT | JSON_REAL_PRECISION(6));
    if (text) puts(text);
    free(text);
    json_decref(line);
}

static void add_up(sums *s, const probed *p)
{
    const npg_estimate *e = &p->estimate;
    s->captures++;
    s->frames += p->probe.frames;
    s->gaps += p->list ? p->list->gap_count : 0;
    s->bad += p->cause[0] != 0;
    s->with_attention += json_array_size(p->probe.attention) > 0;
    s->disk_bytes += e->disk_bytes;
    s->time_s += e->time_s;
    if (e->memory_bytes > s->memory_bytes) s->memory_bytes = e->memory_bytes;
}

/* Free bytes where the output is or will be; -1 when that is not known. */
static double free_bytes(const char *output)
{
    struct statvfs facts;
    char path[4096];
    if ((size_t)snprintf(path, sizeof path, "%s", output) >= sizeof path) return -1;
    while (statvfs(path, &facts)) {
        char *slash = strrchr(path, '/');
        if (!slash || slash == path) return -1;
        *slash = 0;
    }
    return (double)facts.f_bavail * (double)facts.f_frsize;
}

static void print_sums(const npg_batch *batch, const sums *s)
{
    char time[32];
    double room = free_bytes(batch->output);
    npg_spell_time(time, sizeof time, s->time_s);
    printf("\n%zu captures, %zu frames, %zu gaps; memory at most %.0f MiB each, disk %.0f MiB in all",
           s->captures, s->frames, s->gaps, s->memory_bytes / 0x1p20, s->disk_bytes / 0x1p20);
    if (room >= 0) printf(" (%.0f MiB are free)", room / 0x1p20);
    printf(", time %s one after the other; usually within a third\n", time);
    if (room >= 0 && room < s->disk_bytes) printf("attention: the disk has too little room\n");
}

npg_status npg_batch_estimate(const npg_batch *batch, bool as_json, int *exit_code)
{
    sums s = {0};
    npg_status status = NPG_OK;
    if (!as_json)
        printf("%-24s  %7s  %5s  %9s  %12s  %12s  %9s\n", "capture", "frames", "gaps", "points", "memory",
               "disk", "time");
    for (size_t i = 0; i < batch->count && !status; i++) {
        probed p = {.list = NULL};
        if (!npg_batch_is_mine(batch, i)) continue;
        status = probe_capture(&p, &batch->captures[i]);
        if (!status) {
            as_json ? print_line(&batch->captures[i], &p) : print_row(&batch->captures[i], &p);
            add_up(&s, &p);
        }
        npg_frame_files_close(&p.list);
        npg_probe_uninit(&p.probe);
    }
    if (!status && !as_json) print_sums(batch, &s);
    double room = free_bytes(batch->output);
    *exit_code = s.bad ? 1 : s.with_attention || (room >= 0 && room < s.disk_bytes) ? 7 : 0;
    return status;
}
