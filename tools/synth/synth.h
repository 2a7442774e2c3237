/* Synthetic captures: bodies, what a scanner sees of them, and rigs of depth cameras. */
#ifndef NPG_SYNTH_H
#define NPG_SYNTH_H

#include "geometry/geometry.h"
#include "pipeline/memory.h"
#include "pipeline/mesh.h"
#include "tools/cli.h"

/* ---- figures: a closed surface and its exact motion ---- */

/* The walker's bones. */
enum { NPG_BONES = 13 };

/* A surface at rest, and what its motion needs. */
typedef struct npg_body {
    npg_mesh *rest; /* metres, y up; closed manifold parts, outward faces */
    float *weights; /* V x NPG_BONES, rows sum to 1; of walking figures   */
} npg_body;

/* A moment of the motion. */
typedef struct npg_moment {
    double phase;  /* cycles, starting at rest's neighbourhood            */
    double travel; /* metres that a walking figure goes forward per cycle */
    double since;  /* frames since the change; negative before it         */
} npg_moment;

/* What moves: the command's walker, or a test's (tests/support/bodies.c). */
typedef struct npg_figure {
    /* The surface, meshed with cells of `cell` metres: before the change, or from it on. */
    npg_status (*open)(npg_body *body, double cell, bool is_changed);
    /* The positions of its V vertices (V x 3) at a moment. */
    void (*pose)(const npg_body *body, float *vert_pos, const npg_moment *moment);
    int64_t change; /* the frame in which its topology changes; -1: half way, INT64_MAX: never */
} npg_figure;

extern const npg_figure npg_walker;

/* A figure, its surface, and the mesh that is posed, with normals; begins zeroed but for the kind. */
typedef struct npg_moving {
    const npg_figure *kind;
    npg_body body;
    npg_mesh *mesh; /* owned */
} npg_moving;

/* In place of what was open. */
npg_status npg_moving_open(npg_moving *moving, double cell, bool is_changed);
void npg_moving_pose(npg_moving *moving, const npg_moment *moment);
void npg_moving_close(npg_moving *moving);

/* The verb, of any figure; figure->change is then the frame. */
npg_status npg_synth(const npg_cli *cli, npg_figure *figure);

/* ---- what figures are made of ---- */

/* Signed distance of a rest shape, negative inside; Lipschitz constant about 1. */
typedef double npg_distance_fn(const double p[3], const void *user);

/* Mesh the zero set inside the box lo..hi by marching tetrahedra, then even out the triangles while keeping
 * them on the surface.  NPG_FAILED unless the result is one closed manifold. */
npg_status npg_body_mesh(npg_mesh **mesh, npg_distance_fn *distance, const void *user, const double lo[3],
                         const double hi[3], double cell);

/* Rotation (row-major) and shift of every bone from rest to a pose: p' = R p + t. */
typedef struct npg_bone_pose {
    double rotation[9], shift[3];
} npg_bone_pose;

/* Angles of a bone (about x, y, z; radians) at a moment. */
typedef void npg_gait_fn(double angles[3], int bone, const npg_moment *moment);
npg_gait_fn npg_walker_gait;

/* Where a gait takes the bones. */
void npg_walker_bones(npg_bone_pose bones[NPG_BONES], npg_gait_fn *gait, const npg_moment *moment);

/* A walking figure's surface and weights, as its bones lie in `pose`; NULL: at rest. */
npg_status npg_walker_open(npg_body *body, double cell, const npg_bone_pose *pose);

/* Bend it: every vertex goes with its bones, by its weights. */
void npg_walker_bend(const npg_body *body, float *vert_pos, const npg_bone_pose bones[NPG_BONES]);

/* ---- captures: from an exact surface to the points a scanner would have seen ---- */

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

/* ---- depth cameras: where they stand, and what they see ---- */

/* Pixel (x, y) has its centre at x + 0.5, y + 0.5; y goes up. */
typedef struct npg_synth_camera {
    double eye[3], right[3], up[3], ahead[3];
    double focal; /* pixels */
    int64_t width, height;
} npg_synth_camera;

/* The i-th of a ring of capture->cameras. */
npg_synth_camera npg_synth_camera_of_ring(const npg_scan *capture, int64_t i);

/* What each pixel (y * width + x) sees of a surface; t is the depth along `ahead`.  hits: H x W. */
npg_status npg_synth_look(npg_ray_hit *hits, const npg_surface *surface, const npg_synth_camera *camera);

/* ---- rigs: depth and colour images of a textured body, with rig.json (samples/guide/rigs.md) ---- */

/* The texture: colour of a place of the body at rest (metres), sRGB. */
void npg_synth_colour(uint8_t rgba[4], const double rest[3]);

/* Images of one frame of every camera; with the first FOLDER/rig.json and a folder per camera of the ring.  mesh is the
 * body posed, rest the same vertices at rest; noise_m: Gaussian deviation of the depths. */
npg_status npg_synth_rig_frame(const char *folder, const npg_scan *capture, const npg_mesh *mesh,
                               const npg_mesh *rest, int64_t frame, double noise_m);

#endif
