/* Page of a batch: one HTML file that needs no other, with pictures.  It is well-formed XML, too. */
#include "tools/batch/batch_page.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "pipeline/json_file.h"
#include "pipeline/memory.h"
#include "tools/batch/batch_segments.h"
#include "tools/batch/batch_verdict.h"
#include "tools/batch/batch_view.h"
#include "tools/progress.h"

static const char head[] =
    "<!DOCTYPE html>\n<html xmlns=\"http://www.w3.org/1999/xhtml\" lang=\"en\">\n"
    "<head>\n<meta charset=\"utf-8\"/>\n"
    "<title>neupig batch</title>\n<style>\n"
    "body { font: 15px/1.45 sans-serif; color: #222; max-width: 66em; margin: 2em auto; padding: 0 1em; }\n"
    "table { border-collapse: collapse; width: 100%; }\n"
    "th, td { text-align: left; padding: .25em .8em .25em 0; border-bottom: 1px solid #ddd; "
    "vertical-align: top; }\n"
    "td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; }\n"
    ".done { color: #1a7f37; } .partial { color: #9a6700; } .bad { color: #b42318; } .open { color: #777; }\n"
    "section { border-top: 2px solid #ddd; margin-top: 2em; }\n"
    "figure { display: inline-block; margin: .5em 1em .5em 0; vertical-align: top; }\n"
    "figcaption { font-size: 13px; color: #555; } .none { width: 20em; font-size: 13px; color: #777; }\n"
    "svg { display: block; max-width: 100%; height: auto; margin: .5em 0; }\n"
    "svg text { font: 11px sans-serif; fill: #555; }\n"
    "svg .axis { fill: none; stroke: #999; } svg .bar { stroke: #9a6700; stroke-dasharray: 5 4; }\n"
    "svg .line { fill: none; stroke: #0b62a8; stroke-width: 1.5; }\n"
    "svg circle.bad, svg circle.skipped { fill: #b42318; } svg circle.worst { fill: #0b62a8; }\n"
    "svg .cut { stroke: #777; stroke-dasharray: 2 3; }\n"
    "code { font-size: 13px; }\n</style>\n</head>\n<body>\n";

/* ---- text ---- */

static const char *entity_of(char c)
{
    switch (c) {
    case '&': return "&amp;";
    case '<': return "&lt;";
    case '>': return "&gt;";
    case '"': return "&quot;";
    default: return (unsigned char)c < 32 || c == 127 ? "?" : NULL;
    }
}

void npg_page_text(npg_file *page, const char *text)
{
    json_t *clean = npg_json_text(text);
    for (const char *c = json_string_value(clean); c && *c; c++) {
        const char *entity = entity_of(*c);
        npg_file_write(page, entity ? entity : c, entity ? strlen(entity) : 1);
    }
    json_decref(clean);
}

static const char *class_of(const npg_verdict *v)
{
    if (!v->is_known) return "open";
    return v->exit_code == 0 ? "done" : v->exit_code == 7 ? "partial" : "bad";
}

static const char *word_of(const npg_verdict *v)
{
    return v->is_known ? v->word : "not run";
}

/* ---- the table ---- */

static void write_sums(npg_file *page, const npg_batch *batch)
{
    size_t done = 0, partial = 0, open = 0;
    for (size_t i = 0; i < batch->count; i++) {
        const npg_verdict *v = &batch->captures[i].verdict;
        done += v->is_known && v->exit_code == 0;
        partial += v->is_known && v->exit_code == 7;
        open += !v->is_known;
    }
    npg_file_print(page, "<h1>neupig batch</h1>\n<p><code>");
    npg_page_text(page, batch->path);
    npg_file_print(page, "</code> &#8594; <code>");
    npg_page_text(page, batch->output);
    npg_file_print(page,
                   "</code></p>\n<p>%zu captures: %zu done, %zu below the bar, %zu failed, %zu not run</p>\n",
                   batch->count, done, partial, batch->count - done - partial - open, open);
}

static void write_segments_cell(npg_file *page, const npg_capture_figures *f)
{
    char text[80];
    npg_batch_segments_text(text, sizeof text, f->segments);
    npg_file_print(page, "<td>%s</td>", text);
}

static void write_row(npg_file *page, const npg_capture *capture, size_t i, const npg_capture_figures *f,
                      bool with_segments)
{
    const npg_verdict *v = &capture->verdict;
    char time[32] = "";
    if (v->is_known) npg_spell_time(time, sizeof time, v->seconds);
    npg_file_print(page, "<tr><td><a href=\"#capture-%zu\">", i);
    npg_page_text(page, capture->name);
    npg_file_print(page, "</a></td><td class=\"%s\">%s</td>", class_of(v), word_of(v));
    if (f->count)
        npg_file_print(page, "<td class=\"number\">%zu of %zu</td>", f->good, f->count);
    else
        npg_file_print(page, "<td></td>");
    if (with_segments) write_segments_cell(page, f);
    if (f->worst < f->count)
        npg_file_print(page, "<td class=\"number\">%.3f</td><td class=\"number\">%.3f in %lld</td>", f->mean,
                       f->frames[f->worst].error, (long long)f->frames[f->worst].number);
    else
        npg_file_print(page, "<td></td><td></td>");
    npg_file_print(page, "<td class=\"number\">%s</td>", time);
    if (v->peak_bytes)
        npg_file_print(page, "<td class=\"number\">%.0f MiB</td></tr>\n", (double)v->peak_bytes / 0x1p20);
    else
        npg_file_print(page, "<td></td></tr>\n");
}

static void write_table(npg_file *page, const npg_batch *batch, const npg_capture_figures *figures)
{
    bool with_segments = npg_batch_has_segments(batch);
    npg_file_print(page,
                   "<table>\n<tr><th>capture</th><th>verdict</th>"
                   "<th class=\"number\">good frames</th>%s"
                   "<th class=\"number\">error, %%</th><th class=\"number\">worst</th>"
                   "<th class=\"number\">time</th><th class=\"number\">memory</th></tr>\n",
                   with_segments ? "<th>segments</th>" : "");
    for (size_t i = 0; i < batch->count; i++)
        write_row(page, &batch->captures[i], i, &figures[i], with_segments);
    npg_file_print(page,
                   "</table>\n<p>The error is the median distance of a frame's points to the surface, "
                   "in per cent of the capture's diagonal%s.</p>\n",
                   with_segments ? ", or of the segment's where it has several" : "");
}

/* ---- a capture ---- */

static npg_status add_mesh(npg_file *page, const npg_capture *capture, const char *name, const char *reach_of,
                           const char *caption)
{
    char *path;
    NPG_TRY(npg_join_path(&path, capture->output, name));
    npg_status status = npg_page_picture(page, path, reach_of, caption);
    npg_release(&path);
    return status;
}

/* One line for each segment: its frames, its keyframe, and why it is one. */
static void write_segments(npg_file *page, const npg_capture_figures *f)
{
    size_t i;
    json_t *segment;
    if (json_array_size(f->segments) < 2) return;
    npg_file_print(page, "<ul>\n");
    json_array_foreach(f->segments, i, segment)
    {
        const char *cause = json_string_value(json_object_get(segment, "cause"));
        npg_file_print(page, "<li><code>");
        npg_page_text(page, json_string_value(json_object_get(segment, "folder")));
        npg_file_print(page, "</code>: frames %lld to %lld, keyframe %lld, ",
                       (long long)json_integer_value(json_object_get(segment, "first_frame")),
                       (long long)json_integer_value(json_object_get(segment, "last_frame")),
                       (long long)json_integer_value(json_object_get(segment, "keyframe")));
        npg_page_text(page, json_string_value(json_object_get(segment, "status")));
        if (cause) npg_file_print(page, "; cut off because ");
        if (cause) npg_page_text(page, cause);
        npg_file_print(page, "</li>\n");
    }
    npg_file_print(page, "</ul>\n");
}

/* The reference mesh, or that of each of the first segments. */
static npg_status add_references(npg_file *page, const npg_capture *capture, const npg_capture_figures *f)
{
    enum { SHOWN = 6 };
    size_t i;
    json_t *segment;
    if (json_array_size(f->segments) < 2)
        return add_mesh(page, capture, "reference.ply", NULL, "reference mesh");
    json_array_foreach(f->segments, i, segment)
    {
        char name[80], caption[80];
        const char *folder = json_string_value(json_object_get(segment, "folder"));
        if (i == SHOWN) break;
        snprintf(name, sizeof name, "%.40s/reference.ply", folder);
        snprintf(caption, sizeof caption, "reference mesh of %.40s", folder);
        NPG_TRY(add_mesh(page, capture, name, NULL, caption));
    }
    return NPG_OK;
}

/* The worst frame's mesh beside its points, in one view. */
static npg_status add_worst(npg_file *page, const npg_capture *capture, const npg_capture_figures *f)
{
    char caption[128], *mesh = NULL;
    const npg_frame_figures *worst = f->worst < f->count ? &f->frames[f->worst] : NULL;
    if (!worst) return NPG_OK;
    snprintf(caption, sizeof caption, "worst frame: %lld, %.3f %%", (long long)worst->number, worst->error);
    if (!worst->file) {
        npg_file_print(page, "<p class=\"none\">%s; it has no mesh file of its own</p>\n", caption);
        return NPG_OK;
    }
    NPG_TRY(npg_join_path(&mesh, capture->output, worst->file));
    npg_status status = npg_page_picture(page, mesh, worst->source, caption);
    if (!status && worst->source) status = npg_page_picture(page, worst->source, mesh, "its points");
    npg_release(&mesh);
    return status;
}

static npg_status write_capture(npg_file *page, const npg_batch *batch, size_t i,
                                const npg_capture_figures *f)
{
    const npg_capture *capture = &batch->captures[i];
    const npg_verdict *v = &capture->verdict;
    npg_file_print(page, "<section id=\"capture-%zu\">\n<h2>", i);
    npg_page_text(page, capture->name);
    npg_file_print(page, ": <span class=\"%s\">%s</span></h2>\n<p><code>", class_of(v), word_of(v));
    npg_page_text(page, capture->input);
    npg_file_print(page, "</code> &#8594; <code>");
    npg_page_text(page, capture->output);
    npg_file_print(page, "</code>");
    if (v->is_known && v->message[0]) {
        npg_file_print(page, "<br/>");
        npg_page_text(page, v->message);
    }
    npg_file_print(page, "</p>\n");
    npg_batch_view_link(page, batch, capture);
    if (f->count) {
        npg_page_chart(page, f);
        write_segments(page, f);
        NPG_TRY(add_references(page, capture, f));
        NPG_TRY(add_worst(page, capture, f));
    }
    npg_file_print(page, "</section>\n");
    return NPG_OK;
}

npg_status npg_batch_page_write(const npg_batch *batch, const npg_capture_figures *figures)
{
    char *path;
    npg_file *page = NULL;
    NPG_TRY(npg_join_path(&path, batch->output, "batch.html"));
    npg_status status = npg_file_open(&page, path);
    npg_release(&path);
    NPG_TRY(status);
    npg_file_write(page, head, sizeof head - 1);
    write_sums(page, batch);
    write_table(page, batch, figures);
    for (size_t i = 0; i < batch->count && !status; i++) status = write_capture(page, batch, i, &figures[i]);
    npg_file_print(page, "<p>neupig %s</p>\n</body>\n</html>\n", npg_version());
    if (!status) return npg_file_commit(&page);
    npg_file_discard(&page);
    return status;
}
