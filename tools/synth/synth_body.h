/* Synthetic bodies: a closed surface and its exact motion; some change their topology once. */
#ifndef NPG_SYNTH_BODY_H
#define NPG_SYNTH_BODY_H

#include "pipeline/mesh.h"

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

#endif
