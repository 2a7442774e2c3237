/* Scenes to draw: a mesh, or a cloud as small balls, with colours. */
#ifndef NPG_PICTURE_SCENE_H
#define NPG_PICTURE_SCENE_H

#include "pipeline/frame_box.h"
#include "pipeline/mesh.h"

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
