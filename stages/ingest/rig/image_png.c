/* PNG decoder: libpng over bytes in memory.  libpng leaves by longjmp where something is wrong; what must
 * survive that lives in a struct of the caller. */
#include <png.h>
#include <setjmp.h>
#include <stdio.h>
#include <string.h>

#include "ingest/rig/rig_internal.h"

typedef struct decoder {
    const npg_image_job *job;
    png_structp png;
    png_infop info;
    size_t at;         /* bytes taken */
    npg_status status; /* why decoding ended, where npg_error() has said it */
    char text[128];
    jmp_buf leave;
} decoder;

static void on_error(png_structp png, png_const_charp text)
{
    decoder *d = png_get_error_ptr(png);
    snprintf(d->text, sizeof d->text, "%s", text);
    longjmp(d->leave, 1);
}

static void on_warning(png_structp png, png_const_charp text)
{
    (void)png, (void)text;
}

static void take_bytes(png_structp png, png_bytep out, size_t size)
{
    decoder *d = png_get_io_ptr(png);
    if (size > d->job->size - d->at) png_error(png, "the file ends early");
    memcpy(out, d->job->data + d->at, size);
    d->at += size;
}

static npg_status check_kind(const decoder *d)
{
    static const char *const colours[8] = {[PNG_COLOR_TYPE_GRAY] = "grey",
                                           [PNG_COLOR_TYPE_PALETTE] = "palette",
                                           [PNG_COLOR_TYPE_RGB] = "RGB",
                                           [PNG_COLOR_TYPE_GRAY_ALPHA] = "grey with alpha",
                                           [PNG_COLOR_TYPE_RGB_ALPHA] = "RGBA"};
    int depth = png_get_bit_depth(d->png, d->info), colour = png_get_color_type(d->png, d->info);
    if (d->job->kind != NPG_IMAGE_DEPTH || d->job->header_only) return NPG_OK;
    if (depth == 16 && colour == PNG_COLOR_TYPE_GRAY) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s: a %d-bit %s PNG; a depth image must be 16-bit grey", d->job->path,
                     depth, colours[colour & 7] ? colours[colour & 7] : "unknown");
}

/* So that rows come as the kind has them. */
static void set_transforms(decoder *d)
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

static void read_rows(decoder *d)
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

static void decode(decoder *d)
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
        d->status = npg_image_accept(d->job, png_get_image_width(d->png, d->info),
                                     png_get_image_height(d->png, d->info));
    if (d->status || d->job->header_only) return;
    set_transforms(d);
    read_rows(d);
}

npg_status npg_png_decode(const npg_image_job *job)
{
    decoder d = {.job = job};
    d.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &d, on_error, on_warning);
    if (!d.png) return npg_error(NPG_MEMORY, "%s: no memory for libpng", job->path);
    if (setjmp(d.leave))
        d.status = npg_error(NPG_BAD_INPUT, "%s: byte %zu: %s", job->path, d.at, d.text);
    else
        decode(&d);
    png_destroy_read_struct(&d.png, &d.info, NULL);
    return d.status;
}
