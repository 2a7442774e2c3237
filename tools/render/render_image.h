/* Pictures: cameras that fit a box, tiles traced by rays, PNG files. */
#ifndef NPG_RENDER_IMAGE_H
#define NPG_RENDER_IMAGE_H

#include "tools/render/render_scene.h"

typedef struct npg_eye {
    double position[3];
    double axes[9];          /* rows of unit length: to the right, up, ahead      */
    double slope_x, slope_y; /* half the picture's width and height at distance 1 */
} npg_eye;

typedef struct npg_image {
    int64_t width, height;
    uint8_t *pixels; /* height x width x 3, RGB, owned */
} npg_image;

/* Turn the eye: azimuth in degrees (0: along -z from the front, 90: from +x) and elevation;
 * up: 1 for y, 2 for z. */
void npg_eye_turn(npg_eye *eye, double azimuth, double elevation, int up);

/* Place a turned eye so that all of `reach` (along its axes) is in the picture; *aspect is width / height of
 * what it sees (in: 0 to choose it). */
void npg_eye_fit(npg_eye *eye, double *aspect, const npg_bounds *reach);

npg_status npg_image_open(npg_image *image, int64_t width, int64_t height);
void npg_image_close(npg_image *image);

/* Draw the scene into the tile whose corner is at (left, top).  samples: rays per pixel and axis. */
npg_status npg_image_draw(npg_image *image, const npg_scene *scene, const npg_eye *eye, int64_t left,
                          int64_t top, int64_t width, int64_t height, int64_t samples);

/* The picture as the bytes of a PNG file; *bytes (a pointer variable's address) is to be given to
 * npg_release(). */
npg_status npg_image_encode(const npg_image *image, void *bytes, size_t *size);

/* NPG_DISK with path and cause. */
npg_status npg_image_write(const npg_image *image, const char *path);

#endif
