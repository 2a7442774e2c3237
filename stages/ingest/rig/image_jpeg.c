/* JPEG decoder: libjpeg-turbo over bytes in memory, with its errors brought back by longjmp. */
#include <setjmp.h>
#include <stdio.h>
#include <string.h>

#include <jpeglib.h>

#include "ingest/rig/rig_internal.h"

#define SCANS_MAX 100 /* of a progressive file: more only cost time, and real ones have about ten */

typedef struct decoder {
    struct jpeg_error_mgr errors; /* first: libjpeg hands it back */
    struct jpeg_progress_mgr progress;
    struct jpeg_decompress_struct jpeg;
    const npg_image_job *job;
    npg_status status;
    char text[JMSG_LENGTH_MAX];
    jmp_buf leave;
} decoder;

static void on_error(j_common_ptr jpeg)
{
    decoder *d = (decoder *)jpeg->err;
    jpeg->err->format_message(jpeg, d->text);
    longjmp(d->leave, 1);
}

/* Warnings mean damaged data that libjpeg would paint over. */
static void on_message(j_common_ptr jpeg, int level)
{
    if (level < 0) on_error(jpeg);
}

static void on_progress(j_common_ptr jpeg)
{
    decoder *d = (decoder *)jpeg->err;
    if (!jpeg->is_decompressor || d->jpeg.input_scan_number <= SCANS_MAX) return;
    snprintf(d->text, sizeof d->text, "more than %d scans", SCANS_MAX);
    longjmp(d->leave, 1);
}

static void fail(decoder *d, const char *text)
{
    snprintf(d->text, sizeof d->text, "%s", text);
    longjmp(d->leave, 1);
}

static void decode(decoder *d)
{
    struct jpeg_decompress_struct *jpeg = &d->jpeg;
    const npg_image_job *job = d->job;
    jpeg_create_decompress(jpeg);
    jpeg->progress = &d->progress;
    jpeg_mem_src(jpeg, job->data, (unsigned long)job->size);
    jpeg_read_header(jpeg, TRUE);
    d->status = npg_image_accept(job, jpeg->image_width, jpeg->image_height);
    if (d->status || job->header_only) return;
    if (jpeg->num_components != 1 && jpeg->num_components != 3) fail(d, "neither grey nor three colours");
    jpeg->out_color_space = job->kind == NPG_IMAGE_COLOUR ? JCS_RGB : JCS_GRAYSCALE;
    jpeg_start_decompress(jpeg);
    size_t row_size = job->image->width * (job->kind == NPG_IMAGE_COLOUR ? 3 : 1);
    if (jpeg->output_width != job->image->width || jpeg->output_height != job->image->height ||
        (size_t)jpeg->output_components * jpeg->output_width != row_size)
        fail(d, "its rows have another length");
    while (jpeg->output_scanline < jpeg->output_height) {
        JSAMPROW row = job->image->bytes + jpeg->output_scanline * row_size;
        jpeg_read_scanlines(jpeg, &row, 1);
    }
    jpeg_finish_decompress(jpeg);
}

npg_status npg_jpeg_decode(const npg_image_job *job)
{
    decoder d = {.job = job};
    d.jpeg.err = jpeg_std_error(&d.errors);
    d.errors.error_exit = on_error;
    d.errors.emit_message = on_message;
    d.progress.progress_monitor = on_progress;
    if (setjmp(d.leave))
        d.status = npg_error(NPG_BAD_INPUT, "%s: %s", job->path, d.text);
    else
        decode(&d);
    jpeg_destroy_decompress(&d.jpeg);
    return d.status;
}
