/* Synthetic captures: from an exact surface to the points a scanner would have seen. */
#ifndef NPG_SYNTH_POINTS_H
#define NPG_SYNTH_POINTS_H

#include "pipeline/mesh.h"

typedef struct npg_scan {
    int64_t point_count; /* N per frame                              */
    bool vary;           /* N / 2 .. N instead, drawn for each frame */
    double noise; /* Gaussian, deviation in % of the diagonal; along the ray with cameras, else each axis */
    double outliers; /* % of the points replaced by uniform ones in 1.2 x the frame's box */
    int64_t holes;   /* balls of 6 % of the diagonal cut out of every frame               */
    int64_t cameras; /* 0: the whole surface; else a ring of that many depth cameras      */
    int64_t width;   /* of a camera's picture, pixels ...                                 */
    int64_t height;  /* ... and its height; 0: the same                                   */
    uint64_t seed;
    double diagonal;  /* of the first frame's box */
    double centre[3]; /* what the cameras look at */
} npg_scan;

typedef struct npg_scanned {
    size_t count, room_pos, room_normals;
    float *pos, *normals; /* count x 3, owned */
} npg_scanned;

void npg_scanned_close(npg_scanned *points);

/* The points of one frame of a moving surface.  points is emptied first.
 * NPG_BAD_INPUT when no camera sees it. */
npg_status npg_scan_frame(npg_scanned *points, const npg_scan *capture, const npg_mesh *mesh, uint64_t frame);

/* ---- between the files of a capture ---- */

#define NPG_FOR_CAMERAS 10 /* key of the cameras' random stream */

npg_status npg_scanned_add(npg_scanned *points, const double pos[3], const double normal[3]);

/* All surface points that a ring of cameras sees, one per pixel, in the order of cameras and pixels. */
npg_status npg_cameras_see(npg_scanned *points, const npg_scan *capture, const npg_mesh *mesh,
                           uint64_t frame);

#endif
