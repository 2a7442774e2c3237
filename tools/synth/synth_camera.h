/* Synthetic depth cameras: where they stand, and what a mesh looks like from there. */
#ifndef NPG_SYNTH_CAMERA_H
#define NPG_SYNTH_CAMERA_H

#include "tools/synth/synth_points.h"

/* Pixel (x, y) has its centre at x + 0.5, y + 0.5; y goes up. */
typedef struct npg_synth_camera {
    double eye[3], right[3], up[3], ahead[3];
    double focal; /* pixels */
    int64_t width, height;
} npg_synth_camera;

typedef struct npg_synth_picture {
    double *depth;  /* H x W, along `ahead`; infinity where nothing is seen; owned */
    uint32_t *face; /* H x W: the face seen; owned                                 */
} npg_synth_picture;

/* The i-th of a ring of capture->cameras. */
npg_synth_camera npg_synth_camera_of_ring(const npg_scan *capture, int64_t i);

npg_status npg_synth_picture_open(npg_synth_picture *picture, const npg_synth_camera *camera);
void npg_synth_picture_close(npg_synth_picture *picture);

/* Draw the mesh from scratch. */
void npg_synth_draw(npg_synth_picture *picture, const npg_synth_camera *camera, const npg_mesh *mesh);

/* The point at a depth behind pixel `at` (y * width + x). */
void npg_synth_unproject(double pos[3], const npg_synth_camera *camera, int64_t at, double depth);

/* Whether a face, seen at pos, turns its front to the camera; its unit normal. */
bool npg_synth_is_front(double normal[3], const npg_synth_camera *camera, const npg_mesh *mesh, uint32_t face,
                        const double pos[3]);

#endif
