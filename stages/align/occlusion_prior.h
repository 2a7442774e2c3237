/* Occlusion prior: how the parts of the body that no sensor sees in a frame are arranged.
 *
 * What is seen has points; all else has only the edges of the graph, and those draw it to the keyframe's
 * pose: an arm that goes behind the body goes back to where it was in the keyframe.  So an edge from node j
 * to node k of which nothing is seen has the direction that it had, in the frame of its end j, in a pose
 * nearby, and not the one at rest:
 *
 *     e_jk = (1 - PRIOR h) (g_k - g_j) + PRIOR h R_j^T (x_k - x_j)       x_k = g_k + t_k, of that pose
 *
 * h in 0..1: how much of what both ends carry is hidden; PRIOR: occlusion_prior.h.  Of a hidden part with a known pose on
 * either side in time both have a say: s frames after a sensor saw it last, the pose on the far side has s
 * times the weight of the one on the near side.  Frame by frame from the far side that goes evenly in time
 * from where the part was seen last to where it is seen next.  Not in the paper. */
#ifndef NPG_OCCLUSION_PRIOR_H
#define NPG_OCCLUSION_PRIOR_H

#include "align/graph.h"

/* What hidden parts are held by; loans. */
typedef struct npg_prior_poses {
    const double *pose;     /* K x 12: of a frame nearby, or of this one as it was found before */
    const double *far_pose; /* K x 12: of the next frame on the other side, or NULL */
    const float *since;     /* K: frames since what a node carries was seen last; beside `far_pose` */
} npg_prior_poses;

typedef struct npg_occlusion_prior {
    uint32_t (*pairs)[2]; /* P: the graph's edges and the links of its pieces (component_links.h), sorted */
    uint8_t *is_link;     /* P */
    size_t pair_count;    /* P */
    float (*edges)[3];    /* 2P: of each pair, from its first node and from its second */
    float *seen;          /* K: share of what a node carries that is seen, 0..1 */
    float *bound;         /* K, scratch */
    double share;         /* PRIOR */
} npg_occlusion_prior;

/* Room for a graph's pairs and nodes, the arena's; all is seen.  NPG_MEMORY. */
npg_status npg_prior_open(npg_occlusion_prior *prior, npg_arena *arena, const npg_graph *graph);

/* The edges as they are in the poses that hold them, of a frame that so many sensors saw. */
void npg_prior_take(npg_occlusion_prior *prior, const npg_graph *graph, const npg_prior_poses *poses,
                    size_t sensor_count);

/* Which nodes carry what is seen: is_seen (count) of these vertices of the graph. */
void npg_prior_see(npg_occlusion_prior *prior, const npg_graph *graph, const uint32_t *verts,
                   const uint8_t *is_seen, size_t count);

/* e_jk of pair e / 2, from its second node to its first where e is odd.  Returns what it counts: 1, and of a
 * link the share h, a hundredth at least. */
double npg_prior_edge(double edge[3], const npg_occlusion_prior *prior, const npg_graph *graph, size_t e);

/* since (K) of a frame from that of the frame before it: 0 where most of what a node carries is seen. */
void npg_prior_count(const npg_occlusion_prior *prior, float *since, const float *before, size_t node_count);

#endif
