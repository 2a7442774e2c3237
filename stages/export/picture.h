#ifndef NPG_EXPORT_PICTURE_H
#define NPG_EXPORT_PICTURE_H

#include "pipeline/frame_box.h"
#include "pipeline/mesh.h"

/* Pictures: meshes and clouds drawn to a PNG, without a display. */

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

/* Scenes to draw: a mesh, or a cloud as small balls, with colours. */

enum { NPG_COLOUR_PLAIN, NPG_COLOUR_VERTEX, NPG_COLOUR_NORMAL, NPG_COLOUR_IDENTITY };

typedef struct npg_scene {
    npg_mesh *mesh; /* what rays meet, with vertex normals; owned */
    float *colours; /* V x 3, 0..1, owned                         */
    float
        *ball_middle; /* clouds: the middle of each ball, owned; ball b has faces 8 b .. 8 b + 7; else NULL */
    size_t shown, total; /* clouds: points drawn and points there */
} npg_scene;

/* Read only what a file fills of the space, along three axes (rows of unit length); points that are not
 * finite are left out.  Added to *reach. */
npg_status npg_scene_measure(npg_bounds *reach, const char *path, npg_origin *origin, const double axes[9]);

/* Read a file to draw it.  ball_radius: of a cloud's points, in the file's unit.  first: the mesh whose
 * positions give the identity colours (NULL: this one's own); used when the vertex counts are equal. */
npg_status npg_scene_open(npg_scene *scene, const char *path, npg_origin *origin, double ball_radius,
                          int colour, const npg_mesh *first);
void npg_scene_close(npg_scene *scene);

#endif
