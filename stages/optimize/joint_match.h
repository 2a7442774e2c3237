/* Joint match: a frame's points and the places of the surface that they pull at. */
#ifndef NPG_JOINT_MATCH_H
#define NPG_JOINT_MATCH_H

#include "optimize/joint.h"
#include "optimize/joint_system.h"

/* Searches one frame at a time. */
typedef struct npg_joint_matcher {
    const npg_mesh *mesh; /* loan */
    size_t most;
    npg_surface *surface;
    float *targets, *target_normals, *vert_normals, *dists; /* M x 3, M x 3, W x 3, M */
    npg_surface_hit *hits;                                  /* M */
    npg_arena arrays;                                       /* holds these */
} npg_joint_matcher;

npg_status npg_joint_matcher_open(npg_joint_matcher *matcher, const npg_mesh *mesh, size_t most);
void npg_joint_matcher_close(npg_joint_matcher *matcher);

/* Median distance of the frame's points from the surface: as the standard deviation that it is of in a normal
 * distribution. */
npg_status npg_joint_measure(npg_joint_matcher *matcher, double *spread, const npg_joint_frame *frame);

/* pulls (M) of the frame, *count of them; weights fall beyond `width`.  Points whose normal is opposite to
 * the surface's do not pull. */
npg_status npg_joint_match(npg_joint_matcher *matcher, npg_joint_pull *pulls, size_t *count,
                           const npg_joint_frame *frame, double width);

#endif
