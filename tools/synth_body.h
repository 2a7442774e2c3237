/* Synthetic bodies: a closed surface of fixed topology and its exact motion. */
#ifndef NPG_SYNTH_BODY_H
#define NPG_SYNTH_BODY_H

#include "mesh.h"

enum { NPG_BODY_WALKER, NPG_BODY_BAR, NPG_BODIES }; /* the words of --body */

typedef struct npg_body npg_body;

/* The body at rest, meshed with cells of `cell` metres.  Metres, y up.  One closed manifold, outward faces.
 */
npg_status npg_body_open(npg_body **body, int kind, double cell);
void npg_body_close(npg_body **body);

/* Its surface at rest; a loan. */
const npg_mesh *npg_body_rest(const npg_body *body);

/* The positions of its V vertices (V x 3) at a phase of the motion: one cycle per unit, starting at rest's
 * neighbourhood.  travel: metres the walker goes forward per cycle. */
void npg_body_pose(const npg_body *body, float *vert_pos, double phase, double travel);

/* ---- between the files of a body ---- */

/* Signed distance of a rest shape, negative inside; Lipschitz constant about 1. */
typedef double npg_distance_fn(const double p[3], const void *user);

/* Mesh the zero set inside the box lo..hi by marching tetrahedra, then even out the triangles while keeping
 * them on the surface.  NPG_FAILED unless the result is one closed manifold. */
npg_status npg_body_mesh(npg_mesh **mesh, npg_distance_fn *distance, const void *user, const double lo[3],
                         const double hi[3], double cell);

/* The walker's bones. */
enum { NPG_BONES = 13 };
double npg_walker_distance(const double p[3], const void *user);
int npg_walker_nearest_bone(const double p[3]);

/* Rotation (row-major) and shift of every bone from rest to a phase: p' = R p + t. */
typedef struct npg_rigid {
    double rotation[9], shift[3];
} npg_rigid;
void npg_walker_pose(npg_rigid bones[NPG_BONES], double phase, double travel);

#endif
