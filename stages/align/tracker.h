/* Tracker: a coarse alignment of the reference with one frame's points, from a nearby pose.
 *
 * Gauss-Newton on the nodes of a deformation graph (graph.h):
 *
 *     E = mean_p rho(|x(c_p) - p|_W^2) + mean_s rho(|x(s) - p_s|_W^2)
 *         + stiffness * sum over edges |R_j e_jk + g_j + t_j - (g_k + t_k)|^2 / radius^2 / edges
 *
 * c_p: the point of the deformed surface closest to the target point p; p_s: the target point closest to the
 * sample s; W measures distances along the surface normal fully and along the surface by a small share; rho
 * is the robust weight of Geman and McClure, whose width shrinks step by step; e_jk: the edge g_k - g_j at
 * rest, or as it is held where no sensor sees it (occlusion_prior.h).  Few unknowns, second order: it reaches what
 * gradient descent needs hundreds of steps for; the joint fit then needs to find only what the graph can't
 * express.
 *
 * Not in the paper: it replaces the slow way from the identity (paper, "Deformation Loss", confidence). */
#ifndef NPG_TRACKER_H
#define NPG_TRACKER_H

#include "align/occlusion_prior.h"

typedef struct npg_tracker npg_tracker;

typedef struct npg_tracker_settings {
    size_t nodes;     /* of the graph, about                                   */
    size_t samples;   /* of the surface, and most target points looked at      */
    int steps;        /* at most                                               */
    double stiffness; /* final weight of the edges; it starts ten times higher */
    double along;     /* share of distances along the surface, 0..1            */
} npg_tracker_settings;

/* How well it went, lengths in units. */
typedef struct npg_tracked {
    double point_dist_mean; /* target points -> surface, mean of distances                        */
    double point_dist_sq;   /* the same, mean of squares                                          */
    double chamfer;         /* mean of squared distances, points -> surface and surface -> points */
    double explained;       /* share of the target points that it has a place for                 */
    double change;          /* the last step's largest movement of a node                         */
    int steps;
} npg_tracked;

/* reference: unit coordinates with normals; counted reference kept. */
npg_status npg_tracker_open(npg_tracker **tracker, npg_mesh *reference, const npg_tracker_settings *settings);
void npg_tracker_close(npg_tracker **tracker);
size_t npg_tracker_node_count(const npg_tracker *tracker);

/* Whether the reference has a border. */
bool npg_tracker_is_open(const npg_tracker *tracker);

/* The graph over the whole reference, and the reference; loans. */
const npg_graph *npg_tracker_graph(const npg_tracker *tracker);
const npg_mesh *npg_tracker_reference(const npg_tracker *tracker);

/* What a frame saw, in unit coordinates; loans.  normals (or NULL): points whose normal speaks against the
 * surface's are left out, but for the last steps with a closed surface. */
typedef struct npg_tracker_cloud {
    const float *points, *normals; /* N x 3 */
    size_t count;                  /* N     */
    const float *sensors; /* S x 3: where the points were seen from, not finite where one saw nothing */
    size_t sensor_count;  /* S, 0: not known; the points are taken to be of all sides                 */
} npg_tracker_cloud;

/* How a fit goes about it. */
typedef struct npg_tracker_effort {
    int steps;         /* at most                                          */
    double stiffness;  /* of the first step, in final stiffnesses          */
    double width_unit; /* of the first step's robust weight: what may move */
    double along;      /* times the share of distances along the surface   */
} npg_tracker_effort;

/* Improve pose (K x 12) to explain the points, of which there is one at least.  Where it is known where they
 * were seen from, they are compared with what can be seen of the surface from there (visible.h), and points
 * beyond its border do not pull; all else is carried by the edges, as `poses` has them (NULL: as the pose that
 * the fit starts from).  effort: NULL for the usual one. */
npg_status npg_tracker_fit(npg_tracker *tracker, npg_tracked *tracked, double *pose,
                           const npg_tracker_cloud *cloud, const npg_prior_poses *poses,
                           const npg_tracker_effort *effort);

/* since (K) of the frame that was fitted last, from that of the frame before it: how many frames ago most of
 * what a node carries was seen by a sensor. */
void npg_tracker_since(const npg_tracker *tracker, float *since, const float *before);

/* vert_unit (V x 3) of the reference in a pose. */
void npg_tracker_vertices(const npg_tracker *tracker, float *vert_unit, const double *pose);

#endif
