/* Pictures: meshes and clouds drawn to a PNG, without a display. */
#ifndef NPG_PICTURE_H
#define NPG_PICTURE_H

#include "pipeline/frame_box.h"

typedef struct npg_picture_settings {
    int64_t width, height;     /* of a tile, pixels; width 0: as what is drawn needs                   */
    int64_t columns;           /* tiles in a row                                                       */
    int64_t samples;           /* rays per pixel and axis                                              */
    double azimuth, elevation; /* of the eye, degrees; azimuth 0: along -z from the front, 90: from +x */
    bool is_z_up;              /* then from the front is along +y                                      */
    int colour;                /* 0 plain, 1 the file's, 2 normals, 3 identity: by place in the first mesh */
    double point_size;         /* radius of a cloud's points, in diagonals                             */
} npg_picture_settings;

typedef struct npg_picture {
    int64_t width, height; /* pixels                                                               */
    size_t points_total, points_drawn; /* of the cloud with the most: no more than 200 000 are drawn     */
} npg_picture;

/* Draw each file (a mesh or a cloud) into one tile; all share one camera.  NPG_USAGE: larger than 2^28 pixels;
 * NPG_BAD_INPUT, NPG_DISK, NPG_MEMORY. */
npg_status npg_picture_write(npg_picture *picture, const char *path, char *const *files, size_t count,
                             const npg_picture_settings *settings);

#endif
