/* Pages beside the results of a batch. */
#include "tools/batch/batch_view.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "pipeline/memory.h"
#include "tools/batch/batch_verdict.h"
#include "tools/view/view_page.h"

enum { POINTS_SHOWN = 4000 };

/* When a file of a capture's output was written; 0: there is none. */
static double written_s(const npg_capture *capture, const char *name)
{
    struct stat info;
    char *path;
    if (npg_join_path(&path, capture->output, name)) return 0;
    bool is_there = stat(path, &info) == 0;
    npg_release(&path);
    return is_there ? (double)info.st_mtim.tv_sec + 1e-9 * (double)info.st_mtim.tv_nsec : 0;
}

static npg_status write_view(const npg_capture *capture)
{
    npg_view_facts facts;
    char *path;
    NPG_TRY(npg_join_path(&path, capture->output, NPG_BATCH_VIEW_NAME));
    const npg_view_order order = {.paths = (const char *const *)&capture->output,
                                  .path_count = 1,
                                  .output = path,
                                  .point_limit = POINTS_SHOWN,
                                  .every = 1};
    npg_status status = npg_view_page_write(&facts, &order);
    npg_release(&path);
    return status;
}

npg_status npg_batch_views_write(const npg_batch *batch)
{
    if (!batch->has_views || !npg_view_template_is_there()) return NPG_OK;
    for (size_t i = 0; i < batch->count; i++) {
        const npg_capture *capture = &batch->captures[i];
        double done_s = written_s(capture, "done.json");
        if (!npg_verdict_is_done(&capture->verdict) || done_s <= 0) continue;
        if (written_s(capture, NPG_BATCH_VIEW_NAME) >= done_s) continue;
        npg_status status = write_view(capture);
        if (status == NPG_MEMORY) return status;
        if (status)
            fprintf(stderr, "neupig batch: warning: no page of %s: %s\n", capture->name, npg_error_text());
    }
    return NPG_OK;
}

/* A path as a link: bytes other than letters, digits and "/._-" as %XX. */
static void write_link(npg_file *page, const char *path)
{
    for (const unsigned char *c = (const unsigned char *)path; *c; c++)
        if (isascii(*c) && (isalnum(*c) || strchr("/._-", *c)))
            npg_file_write(page, c, 1);
        else
            npg_file_print(page, "%%%02X", *c);
}

void npg_batch_view_link(npg_file *page, const npg_batch *batch, const npg_capture *capture)
{
    size_t length = strlen(batch->output);
    bool is_inside = !strncmp(capture->output, batch->output, length) && capture->output[length] == '/';
    if (!is_inside || written_s(capture, NPG_BATCH_VIEW_NAME) <= 0) return;
    npg_file_print(page, "<p><a href=\"");
    write_link(page, capture->output + length + 1);
    npg_file_print(page, "/" NPG_BATCH_VIEW_NAME
                         "\">the moving mesh, its time line and where it is wrong</a></p>\n");
}
