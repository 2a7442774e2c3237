/* Synthetic captures: bodies, what a scanner sees of them, and rigs of depth cameras. */
#ifndef NPG_SYNTH_H
#define NPG_SYNTH_H

#include "pipeline/memory.h"
#include "pipeline/mesh.h"

/* ---- bodies: a closed surface and its exact motion; some change their topology once ---- */

/* The words of --body.  HANDS: a walker whose right hand has grown into its hip and leaves it at the change.
 * TWO: the bar, beside which a ball appears at the change.  GONE: the bar with a ball
 * that disappears there. */
enum { NPG_BODY_WALKER, NPG_BODY_BAR, NPG_BODY_HANDS, NPG_BODY_TWO, NPG_BODY_GONE, NPG_BODIES };

typedef struct npg_body npg_body;

/* The body at rest, meshed with cells of `cell` metres.  Metres, y up.  Closed manifold parts, outward faces.
 * is_changed: as it is from the change on (bodies that change). */
npg_status npg_body_open(npg_body **body, int kind, bool is_changed, double cell);
void npg_body_close(npg_body **body);

/* Whether a kind changes its topology. */
bool npg_body_changes(int kind);

/* Its surface at rest; a loan. */
const npg_mesh *npg_body_rest(const npg_body *body);

/* A moment of the motion. */
typedef struct npg_moment {
    double phase;  /* cycles, starting at rest's neighbourhood            */
    double travel; /* metres that a walking figure goes forward per cycle */
    double since;  /* frames since the change; only for a changed body    */
} npg_moment;

/* The positions of its V vertices (V x 3) at a moment. */
void npg_body_pose(const npg_body *body, float *vert_pos, const npg_moment *moment);

/* ---- between the files of a body ---- */

/* Signed distance of a rest shape, negative inside; Lipschitz constant about 1. */
typedef double npg_distance_fn(const double p[3], const void *user);

/* Mesh the zero set inside the box lo..hi by marching tetrahedra, then even out the triangles while keeping
 * them on the surface.  NPG_FAILED unless the result is one closed manifold. */
npg_status npg_body_mesh(npg_mesh **mesh, npg_distance_fn *distance, const void *user, const double lo[3],
                         const double hi[3], double cell);

/* The walker's bones. */
enum { NPG_BONES = 13 };

/* Rotation (row-major) and shift of every bone from rest to a pose: p' = R p + t. */
typedef struct npg_bone_pose {
    double rotation[9], shift[3];
} npg_bone_pose;

/* user: the pose the distance is of, NPG_BONES of npg_bone_pose; NULL: at rest. */
double npg_walker_distance(const double p[3], const void *user);
int npg_walker_nearest_bone(const double p[3], const npg_bone_pose *pose);

/* The walker's gait; with at_hip >= 0 that of the body HANDS, its right hand on the hip by that share. */
void npg_walker_pose(npg_bone_pose bones[NPG_BONES], double phase, double travel, double at_hip);

/* at = motion after the inverse of `rest`: what takes a surface that lies in the pose `rest` to `motion`. */
void npg_bone_between(npg_bone_pose *at, const npg_bone_pose *rest, const npg_bone_pose *motion);

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

npg_status npg_scanned_add(npg_scanned *points, const double pos[3], const double normal[3]);

/* All surface points that a ring of cameras sees, one per pixel, in the order of cameras and pixels. */
npg_status npg_cameras_see(npg_scanned *points, const npg_scan *capture, const npg_mesh *mesh,
                           uint64_t frame);

/* ---- depth cameras: where they stand, and what a mesh looks like from there ---- */

/* Pixel (x, y) has its centre at x + 0.5, y + 0.5; y goes up. */
typedef struct npg_synth_camera {
    double eye[3], right[3], up[3], ahead[3];
    double focal; /* pixels */
    int64_t width, height;
} npg_synth_camera;

typedef struct npg_synth_picture {
    double *depth;  /* H x W, along `ahead`; infinity where nothing is seen */
    uint32_t *face; /* H x W: the face seen                                 */
} npg_synth_picture;

/* The i-th of a ring of capture->cameras. */
npg_synth_camera npg_synth_camera_of_ring(const npg_scan *capture, int64_t i);

npg_synth_picture npg_synth_picture_take(npg_arena *arena, const npg_synth_camera *camera);

/* Draw the mesh from scratch. */
void npg_synth_draw(npg_synth_picture *picture, const npg_synth_camera *camera, const npg_mesh *mesh);

/* The point at a depth behind pixel `at` (y * width + x). */
void npg_synth_unproject(double pos[3], const npg_synth_camera *camera, int64_t at, double depth);

/* Whether a face, seen at pos, turns its front to the camera; its unit normal. */
bool npg_synth_is_front(double normal[3], const npg_synth_camera *camera, const npg_mesh *mesh, uint32_t face,
                        const double pos[3]);

/* ---- rigs: depth and colour images of a textured body, with rig.json (samples/guide/rigs.md) ---- */

/* The texture: colour of a place of the body at rest (metres), sRGB. */
void npg_synth_colour(uint8_t rgba[4], const double rest[3]);

/* FOLDER/rig.json and a folder per camera of the ring. */
npg_status npg_synth_rig_begin(const char *folder, const npg_scan *capture);

/* Images of one frame of every camera: mesh is the body posed, rest the same vertices at rest; noise_m:
 * Gaussian deviation of the depths. */
npg_status npg_synth_rig_frame(const char *folder, const npg_scan *capture, const npg_mesh *mesh,
                               const npg_mesh *rest, int64_t frame, double noise_m);

#endif
