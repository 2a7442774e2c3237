/* Rig, inside: cameras and poses, images, files of others, and the comparison of sensors. */
#ifndef NPG_RIG_INTERNAL_H
#define NPG_RIG_INTERNAL_H

#include "ingest/ingest_internal.h"

/* ---- cameras ---- */

/* NPG_BAD_INPUT when sizes or focal lengths are none that a camera has; `where` begins the text. */
npg_status npg_camera_check(const npg_camera *camera, const char *where);

/* Pixel that a point of the camera's space falls on; false where it is not in front of the camera. */
bool npg_camera_project(const npg_camera *camera, double pixel[2], const double point[3]);

/* The ray of a pixel as (x, y) = (X / Z, Y / Z); false where the distortion can't be undone there. */
bool npg_camera_ray(const npg_camera *camera, double ray[2], const double pixel[2]);

/* ---- poses ---- */

void npg_pose_identity(double pose[12]);
void npg_pose_apply(double out[3], const double pose[12], const double point[3]);
/* out = a after b; out is neither of them. */
void npg_pose_combine(double out[12], const double a[12], const double b[12]);
void npg_pose_invert(double out[12], const double pose[12]); /* of a rotation; out is not pose */

/* NPG_BAD_INPUT when the 3 x 3 part is no rotation (a scale, a shear, a mirror, numbers that are not finite);
 * what is off by rounding in a file is made exact. */
npg_status npg_pose_check(double pose[12], const char *where);

/* ---- between the files of a rig ---- */

/* Sensors with their shots, each sensor's in order of their numbers. */
npg_status npg_rig_load_json(npg_rig *rig);

/* "<rig's folder>/<name>", a text of the rig's, refused under confine where it leads out; NPG_BAD_INPUT where it is
 * not there and must be. */
npg_status npg_rig_path(npg_rig *rig, char **path, const char *name, bool must_be);

/* What one depth image gave, in the sensor's own axes. */
typedef struct npg_depth_points {
    npg_arena arena; /* of what follows; to be released, also after a failure */
    size_t count;
    float *pos, *normals; /* N x 3 each                             */
    uint8_t *colours;     /* N x 4, sRGB, alpha 0: not seen         */
    uint32_t *pixels;     /* N, y x width + x, growing              */
    bool has_colours;
    bool is_blank;       /* no pixel has a depth, or all have the largest number, which then is none */
    npg_depth_view view; /* but for the pose */
    float *cells;        /* of the view      */
} npg_depth_points;

npg_status npg_depth_points_read(npg_depth_points *points, npg_rig *rig, size_t sensor,
                                 const npg_rig_shot *shot);

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

void npg_image_clear(npg_image *image);

/* Sights: what the sensors of a rig saw in a few frames, on the grids of their images, so that a point of one
 * sensor can be looked up in the image of another. */

/* Points of one sensor in one frame, in its own axes. */
typedef struct npg_rig_sight {
    npg_arena arena;      /* of its arrays: sights are read side by side      */
    bool is_there;        /* there is an image that could be read             */
    size_t point_count;   /* in the image                                     */
    size_t count;         /* that are kept                                    */
    float *pos, *normals; /* N x 3 each                                       */
    uint16_t *columns;    /* N: column in the thinned grid                    */
    uint32_t *rows;       /* (row_count + 1): first point of each row         */
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
