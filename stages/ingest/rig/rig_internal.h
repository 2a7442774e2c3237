#ifndef NPG_INGEST_RIG_INTERNAL_H
#define NPG_INGEST_RIG_INTERNAL_H

#include <stdint.h>

#include "ingest/rig/rig.h"
#include "pipeline/status.h"

/* Image: depth, mask and colour images of a rig, decoded whole; libpng and libjpeg-turbo do the work.
 *
 * Size and kind are checked from the header, before anything is decoded. */

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

/* Sights: what the sensors of a rig saw in a few frames, on the grids of their images, so that a point of one
 * sensor can be looked up in the image of another. */

/* Points of one sensor in one frame, in its own axes. */
typedef struct npg_rig_sight {
    bool is_there;        /* there is an image that could be read             */
    size_t point_count;   /* in the image                                     */
    size_t count;         /* that are kept                                    */
    float *pos, *normals; /* N x 3 each, owned                                */
    uint16_t *columns;    /* N: column in the thinned grid; owned             */
    uint32_t *rows;       /* (row_count + 1): first point of each row; owned  */
    size_t row_count;
    size_t step;     /* pixels of the image per cell of the thinned grid      */
    double pose[12]; /* sensor to world, as npg_rig_pose() has it             */
} npg_rig_sight;

typedef struct npg_rig_sights {
    const npg_rig *rig;
    size_t frame_count, sensor_count;
    npg_rig_sight *of; /* frame_count x sensor_count, owned                       */
    double depth;      /* mean distance from sensor to point, in the rig's unit   */
    double centre[3];  /* mean of all points, world                            */
} npg_rig_sights;

/* A point of one sensor and the place of another's surface that lies before the same pixel. */
typedef struct npg_rig_sight_pair {
    double own[3], other[3]; /* world                                       */
    double normal[3];        /* of both surfaces, unit: the mean of the two */
    double off;              /* normal . (own - other)                      */
} npg_rig_sight_pair;

/* Read the images of `count` frames (places in the rig).  An image that can't be read counts as missing.
 * NPG_MEMORY. */
npg_status npg_rig_sights_open(npg_rig_sights *sights, npg_rig *rig, const size_t *frames, size_t count);
void npg_rig_sights_close(npg_rig_sights *sights);

const npg_rig_sight *npg_rig_sights_of(const npg_rig_sights *sights, size_t frame, size_t sensor);

/* Look point i of sight a up in sight b, with the poses (sensor to world) of both.  false where b sees
 * nothing there, another surface (normals apart, or further off than `reach`), or either sees it from the
 * side. */
bool npg_rig_sight_match(npg_rig_sight_pair *pair, const npg_rig_sight *a, size_t i, const double pose_a[12],
                         const npg_rig_sight *b, const npg_camera *camera_b, const double pose_b[12],
                         double reach);

/* ---- distances ---- */

#define NPG_RIG_BINS 1024

/* A histogram of sizes from 0 to `reach`. */
typedef struct npg_rig_bins {
    double reach;
    uint64_t count[NPG_RIG_BINS];
} npg_rig_bins;

void npg_rig_bins_add(npg_rig_bins *bins, double size);

/* 1.4826 times the median: the standard deviation of normal residuals whose sizes these are, whatever a few
 * wrong pairs among them say; 0 without any. */
double npg_rig_bins_deviation(const npg_rig_bins *bins);

/* Rig alignment: one rigid correction per sensor that brings the surfaces which several sensors see together,
 * the same in all frames, and how well they determine it. */

#define NPG_ALIGN_REACH                                                                                      \
    0.025 /* of the depth: surfaces further apart are different ones, or a pose is far off */

/* A correction: x' = pose x in the world, and the deviation (rms length) of its two halves. */
typedef struct npg_correction {
    double pose[12];
    double shift, turn;       /* of the sensor's position, in the rig's unit; angle, radians */
    double shift_sd, turn_sd; /* standard deviations; infinite where nothing was solved      */
} npg_correction;

/* Least sum over all pairs (npg_rig_sight_match) of rho(n . (C_a p - C_b q)), over the corrections C
 * of the sensors that are free; those of the others stay as they are given.  corrections (one per sensor) are
 * where it starts, and what comes out; at least one sensor must not be free.
 *
 * rho is Huber's, at 1.345 of the residuals' robust deviation, and cuts off at five of them.  Gauss-Newton
 * with new pairs in each step.  A weak prior (4 % of the depth, 3 degrees) holds what nothing determines.
 * The deviations are the larger of two: from the normal equations and the residuals' deviation (twice its
 * square, for each pixel is in about two pairs), and from how much the frames' own gradients differ
 * (sandwich), which knows of errors that neighbouring pixels share.  NPG_MEMORY. */
npg_status npg_rig_solve(npg_correction *corrections, const npg_rig_sights *sights, const bool *is_free);

#endif
