/* Image: PNG by libpng and JPEG by libjpeg-turbo, over bytes in memory, with the checks that hold for both.
 *
 * These libraries leave by longjmp where something is wrong: what must survive that lives in a struct of the caller. */
#include <setjmp.h>
#include <stdio.h>
#include <string.h>

#include <jpeglib.h>
#include <png.h>

#include "ingest/rig/rig_internal.h"
#include "pipeline/file.h"

#define SCANS_MAX 100 /* of a progressive file: more only cost time, and real ones have about ten */

/* What a decoder is asked for.  It calls accept() with what the header says, and then decodes. */
typedef struct image_job {
    const char *path;
    const unsigned char *data;
    size_t size;
    npg_image_kind kind;
    size_t width, height; /* wanted; 0: any */
    npg_image *image;
} image_job;

void npg_image_clear(npg_image *image)
{
    npg_release(&image->depth);
    npg_release(&image->bytes);
    *image = (npg_image){0};
}

/* NPG_BAD_INPUT for a size that is not the wanted one or beyond the limit; else the memory of the pixels. */
static npg_status accept(const image_job *job, size_t width, size_t height)
{
    npg_image *image = job->image;
    if (!width || !height || width > NPG_IMAGE_SIDE_MAX || height > NPG_IMAGE_SIDE_MAX)
        return npg_error(NPG_BAD_INPUT, "%s: %zu x %zu pixels; 1 to %d a side can be read", job->path, width,
                         height, NPG_IMAGE_SIDE_MAX);
    if (job->width && (width != job->width || height != job->height))
        return npg_error(NPG_BAD_INPUT, "%s: %zu x %zu pixels, but the camera's intrinsics are of %zu x %zu",
                         job->path, width, height, job->width, job->height);
    image->width = width;
    image->height = height;
    if (job->kind == NPG_IMAGE_DEPTH)
        return npg_alloc_array(&image->depth, NPG_FOR_FILES, width * height, sizeof *image->depth);
    return npg_alloc_array(&image->bytes, NPG_FOR_FILES, width * height,
                           job->kind == NPG_IMAGE_COLOUR ? 3 : 1);
}

/* ---- PNG ---- */

typedef struct png_reader {
    const image_job *job;
    png_structp png;
    png_infop info;
    size_t at;         /* bytes taken */
    npg_status status; /* why decoding ended, where npg_error() has said it */
    char text[128];
    jmp_buf leave;
} png_reader;

static void on_png_error(png_structp png, png_const_charp text)
{
    png_reader *d = png_get_error_ptr(png);
    snprintf(d->text, sizeof d->text, "%s", text);
    longjmp(d->leave, 1);
}

static void on_warning(png_structp png, png_const_charp text)
{
    (void)png, (void)text;
}

static void take_bytes(png_structp png, png_bytep out, size_t size)
{
    png_reader *d = png_get_io_ptr(png);
    if (size > d->job->size - d->at) png_error(png, "the file ends early");
    memcpy(out, d->job->data + d->at, size);
    d->at += size;
}

static npg_status check_kind(const png_reader *d)
{
    static const char *const colours[8] = {[PNG_COLOR_TYPE_GRAY] = "grey",
                                           [PNG_COLOR_TYPE_PALETTE] = "palette",
                                           [PNG_COLOR_TYPE_RGB] = "RGB",
                                           [PNG_COLOR_TYPE_GRAY_ALPHA] = "grey with alpha",
                                           [PNG_COLOR_TYPE_RGB_ALPHA] = "RGBA"};
    int depth = png_get_bit_depth(d->png, d->info), colour = png_get_color_type(d->png, d->info);
    if (d->job->kind != NPG_IMAGE_DEPTH) return NPG_OK;
    if (depth == 16 && colour == PNG_COLOR_TYPE_GRAY) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s: a %d-bit %s PNG; a depth image must be 16-bit grey", d->job->path,
                     depth, colours[colour & 7] ? colours[colour & 7] : "unknown");
}

/* So that rows come as the kind has them. */
static void set_transforms(png_reader *d)
{
    if (d->job->kind == NPG_IMAGE_DEPTH) {
        const uint16_t one = 1;
        if (*(const unsigned char *)&one) png_set_swap(d->png); /* PNG is big-endian */
        return;
    }
    png_set_expand(d->png);
    png_set_strip_16(d->png);
    png_set_strip_alpha(d->png);
    if (d->job->kind == NPG_IMAGE_COLOUR)
        png_set_gray_to_rgb(d->png);
    else if (png_get_color_type(d->png, d->info) & PNG_COLOR_MASK_COLOR)
        png_set_rgb_to_gray_fixed(d->png, PNG_ERROR_ACTION_NONE, PNG_RGB_TO_GRAY_DEFAULT,
                                  PNG_RGB_TO_GRAY_DEFAULT);
}

static void read_rows(png_reader *d)
{
    const npg_image *image = d->job->image;
    size_t channels = d->job->kind == NPG_IMAGE_COLOUR ? 3 : 1;
    size_t row_size = image->width * (d->job->kind == NPG_IMAGE_DEPTH ? 2 : channels);
    unsigned char *rows = image->depth ? (unsigned char *)image->depth : image->bytes;
    int passes = png_set_interlace_handling(d->png);
    png_read_update_info(d->png, d->info);
    if (png_get_rowbytes(d->png, d->info) != row_size) png_error(d->png, "its rows have another length");
    for (int pass = 0; pass < passes; pass++)
        for (size_t y = 0; y < image->height; y++) png_read_row(d->png, rows + y * row_size, NULL);
    png_read_end(d->png, NULL);
}

static void decode_png(png_reader *d)
{
    d->info = png_create_info_struct(d->png);
    if (!d->info) png_error(d->png, "no memory");
    png_set_read_fn(d->png, d, take_bytes);
    png_set_user_limits(d->png, NPG_IMAGE_SIDE_MAX, NPG_IMAGE_SIDE_MAX);
    png_set_chunk_malloc_max(d->png, (png_alloc_size_t)1 << 20); /* profiles and texts, which nobody uses */
    png_set_chunk_cache_max(d->png, 64);
    png_read_info(d->png, d->info);
    d->status = check_kind(d);
    if (!d->status)
        d->status =
            accept(d->job, png_get_image_width(d->png, d->info), png_get_image_height(d->png, d->info));
    if (d->status) return;
    set_transforms(d);
    read_rows(d);
}

static npg_status read_png(const image_job *job)
{
    png_reader d = {.job = job};
    d.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &d, on_png_error, on_warning);
    if (!d.png) return npg_error(NPG_MEMORY, "%s: no memory for libpng", job->path);
    if (setjmp(d.leave))
        d.status = npg_error(NPG_BAD_INPUT, "%s: byte %zu: %s", job->path, d.at, d.text);
    else
        decode_png(&d);
    png_destroy_read_struct(&d.png, &d.info, NULL);
    return d.status;
}

/* ---- JPEG ---- */

typedef struct jpeg_reader {
    struct jpeg_error_mgr errors; /* first: libjpeg hands it back */
    struct jpeg_progress_mgr progress;
    struct jpeg_decompress_struct jpeg;
    const image_job *job;
    npg_status status;
    char text[JMSG_LENGTH_MAX];
    jmp_buf leave;
} jpeg_reader;

static void on_jpeg_error(j_common_ptr jpeg)
{
    jpeg_reader *d = (jpeg_reader *)jpeg->err;
    jpeg->err->format_message(jpeg, d->text);
    longjmp(d->leave, 1);
}

/* Warnings mean damaged data that libjpeg would paint over. */
static void on_message(j_common_ptr jpeg, int level)
{
    if (level < 0) on_jpeg_error(jpeg);
}

static void fail(jpeg_reader *d, const char *text)
{
    snprintf(d->text, sizeof d->text, "%s", text);
    longjmp(d->leave, 1);
}

static void on_progress(j_common_ptr jpeg)
{
    jpeg_reader *d = (jpeg_reader *)jpeg->err;
    if (jpeg->is_decompressor && d->jpeg.input_scan_number > SCANS_MAX) fail(d, "too many scans");
}

static void decode_jpeg(jpeg_reader *d)
{
    struct jpeg_decompress_struct *jpeg = &d->jpeg;
    const image_job *job = d->job;
    jpeg_create_decompress(jpeg);
    jpeg->progress = &d->progress;
    jpeg_mem_src(jpeg, job->data, (unsigned long)job->size);
    jpeg_read_header(jpeg, TRUE);
    d->status = accept(job, jpeg->image_width, jpeg->image_height);
    if (d->status) return;
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

static npg_status read_jpeg(const image_job *job)
{
    jpeg_reader d = {.job = job};
    d.jpeg.err = jpeg_std_error(&d.errors);
    d.errors.error_exit = on_jpeg_error;
    d.errors.emit_message = on_message;
    d.progress.progress_monitor = on_progress;
    if (setjmp(d.leave))
        d.status = npg_error(NPG_BAD_INPUT, "%s: %s", job->path, d.text);
    else
        decode_jpeg(&d);
    jpeg_destroy_decompress(&d.jpeg);
    return d.status;
}

/* ---- either ---- */

static npg_status decode(const image_job *job)
{
    static const unsigned char png[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    static const unsigned char jpeg[] = {0xff, 0xd8, 0xff};
    if (job->size >= sizeof png && !memcmp(job->data, png, sizeof png)) return read_png(job);
    if (job->size < sizeof jpeg || memcmp(job->data, jpeg, sizeof jpeg) != 0)
        return npg_error(NPG_BAD_INPUT, "%s: neither PNG nor JPEG", job->path);
    if (job->kind == NPG_IMAGE_DEPTH)
        return npg_error(NPG_BAD_INPUT, "%s: a JPEG can't be a depth image: it must be a 16-bit grey PNG",
                         job->path);
    return read_jpeg(job);
}

npg_status npg_image_read(npg_image *image, const char *path, npg_image_kind kind, size_t width,
                          size_t height)
{
    image_job job = {.path = path, .kind = kind, .width = width, .height = height, .image = image};
    npg_arena scratch = {.purpose = NPG_FOR_FILES};
    *image = (npg_image){0};
    npg_status status = npg_file_whole(&scratch, &job.data, &job.size, path, NPG_IMAGE_FILE_MAX, "image");
    if (!status) status = decode(&job);
    npg_arena_release(&scratch);
    if (status) npg_image_clear(image);
    return status;
}
