/* Image: the file's bytes, what kind it is, and the checks that hold for all kinds. */
#include "ingest/rig/rig_internal.h"

#include <string.h>

void npg_image_clear(npg_image *image)
{
    npg_release(&image->depth);
    npg_release(&image->bytes);
    *image = (npg_image){0};
}

npg_status npg_image_accept(const npg_image_job *job, size_t width, size_t height)
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
    if (job->header_only) return NPG_OK;
    if (job->kind == NPG_IMAGE_DEPTH)
        return npg_alloc_array(&image->depth, NPG_FOR_FILES, width * height, sizeof *image->depth);
    return npg_alloc_array(&image->bytes, NPG_FOR_FILES, width * height,
                           job->kind == NPG_IMAGE_COLOUR ? 3 : 1);
}

static npg_status decode(const npg_image_job *job)
{
    static const unsigned char png[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    static const unsigned char jpeg[] = {0xff, 0xd8, 0xff};
    if (job->size >= sizeof png && !memcmp(job->data, png, sizeof png)) return npg_png_decode(job);
    if (job->size < sizeof jpeg || memcmp(job->data, jpeg, sizeof jpeg) != 0)
        return npg_error(NPG_BAD_INPUT, "%s: neither PNG nor JPEG", job->path);
    if (job->kind == NPG_IMAGE_DEPTH && !job->header_only)
        return npg_error(NPG_BAD_INPUT, "%s: a JPEG can't be a depth image: it must be a 16-bit grey PNG",
                         job->path);
    return npg_jpeg_decode(job);
}

static npg_status read_bytes(unsigned char **data, size_t *size, const char *path)
{
    npg_source *source;
    NPG_TRY(npg_source_open_file(&source, path));
    uint64_t left = npg_source_left(source);
    npg_status status = left > NPG_IMAGE_FILE_MAX
                            ? npg_error(NPG_BAD_INPUT, "%s: no image file, or one of more than %zu MiB", path,
                                        NPG_IMAGE_FILE_MAX >> 20)
                            : npg_source_read(source, data, (size_t)left, size);
    npg_source_close(&source);
    return status;
}

static npg_status read_image(npg_image_job job)
{
    unsigned char *data = NULL;
    *job.image = (npg_image){0};
    npg_status status = read_bytes(&data, &job.size, job.path);
    job.data = data;
    if (!status) status = decode(&job);
    npg_release(&data);
    if (status) npg_image_clear(job.image);
    return status;
}

npg_status npg_image_read(npg_image *image, const char *path, npg_image_kind kind, size_t width,
                          size_t height)
{
    return read_image(
        (npg_image_job){.path = path, .kind = kind, .width = width, .height = height, .image = image});
}

npg_status npg_image_size(size_t *width, size_t *height, const char *path)
{
    npg_image image;
    NPG_TRY(read_image((npg_image_job){.path = path, .header_only = 1, .image = &image}));
    *width = image.width;
    *height = image.height;
    return NPG_OK;
}
