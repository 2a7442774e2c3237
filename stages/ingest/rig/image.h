/* Image: depth, mask and colour images of a rig, decoded whole; libpng and libjpeg-turbo do the work.
 *
 * Size and kind are checked from the header, before anything is decoded. */
#ifndef NPG_IMAGE_H
#define NPG_IMAGE_H

#include <stdint.h>

#include "pipeline/status.h"

#define NPG_IMAGE_SIDE_MAX 16384               /* pixels; larger sensors than this do not exist */
#define NPG_IMAGE_FILE_MAX ((size_t)256 << 20) /* bytes of a file                              */

typedef enum npg_image_kind {
    NPG_IMAGE_DEPTH, /* one channel of 16 bits; PNG alone: JPEG would change the depths */
    NPG_IMAGE_MASK,  /* one channel of 8 bits, made from colours where the file has them */
    NPG_IMAGE_COLOUR /* three channels of 8 bits, sRGB; grey becomes three equal ones    */
} npg_image_kind;

typedef struct npg_image {
    size_t width, height;
    uint16_t *depth; /* H x W, or NULL; owned     */
    uint8_t *bytes;  /* H x W x (1 or 3), or NULL; owned */
} npg_image;

/* Decode a PNG or JPEG (its first bytes decide).  width and height: what it must have; 0: anything up to
 * NPG_IMAGE_SIDE_MAX.  NPG_BAD_INPUT names the file: another size, a depth image that is no 16-bit grey PNG,
 * damage.  NPG_MEMORY.  *image is empty after a failure.  Thread-safe. */
npg_status npg_image_read(npg_image *image, const char *path, npg_image_kind kind, size_t width,
                          size_t height);

/* Width and height from the header alone; errors as above. */
npg_status npg_image_size(size_t *width, size_t *height, const char *path);

void npg_image_clear(npg_image *image);

/* ---- between image.c, image_png.c and image_jpeg.c ---- */

/* What a decoder is asked for.  A decoder fills image->width and height, calls npg_image_accept() and then
 * decodes; with header_only it stops there. */
typedef struct npg_image_job {
    const char *path;
    const unsigned char *data;
    size_t size;
    npg_image_kind kind;
    size_t width, height; /* wanted; 0: any */
    int header_only;
    npg_image *image;
} npg_image_job;

/* NPG_BAD_INPUT for a size that is not the wanted one or beyond the limit; else the memory of the pixels
 * (none with header_only). */
npg_status npg_image_accept(const npg_image_job *job, size_t width, size_t height);

npg_status npg_png_decode(const npg_image_job *job);
npg_status npg_jpeg_decode(const npg_image_job *job);

#endif
