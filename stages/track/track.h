/* Track: a surface into one frame, from a pose nearby. */
#ifndef NPG_TRACK_H
#define NPG_TRACK_H

#include "geometry/geometry.h"
#include "geometry/sensor_space.h"
#include "pipeline/chunk.h"
#include "pipeline/memory.h"
#include "pipeline/mesh.h"
#include "pipeline/stage.h"

/* Graph: a deformation graph over the reference surface; few nodes that carry all vertices along.
 *
 * Based on: Robert Sumner, Johannes Schmid, Mark Pauly, Embedded Deformation for Shape Manipulation, 2007.
 *
 *     x(v) = sum_k w_k(v) (R_k (v - g_k) + g_k + t_k)
 *
 * Nodes g_k lie on the surface, about a radius apart; the weights w_k(v) fall off with the distance along the
 * surface, so that parts which only touch do not hold each other. */

#define NPG_GRAPH_BIND 4 /* nodes that carry a vertex */

typedef struct npg_graph {
    npg_arena arena;                           /* of all arrays                                       */
    size_t node_count, vert_count, edge_count; /* K, V, E                                             */
    double radius;                             /* distance between nodes, about                       */
    float *node_pos;                           /* K x 3                                               */
    uint32_t *vert_node;                       /* V x 4, UINT32_MAX where there are fewer             */
    float *vert_weight;                        /* V x 4, sum 1                                        */
    uint32_t (*edges)[2];                      /* pairs of nodes that carry a vertex together, sorted */
} npg_graph;

/* About node_target nodes.  The mesh is a loan during the call. */
npg_status npg_graph_open(npg_graph **graph, const npg_mesh *mesh, size_t node_target);
void npg_graph_close(npg_graph **graph);

/* The same nodes, carrying only these vertices of the whole (count). */
npg_status npg_graph_take(npg_graph **part, const npg_graph *whole, const uint32_t *verts, size_t count);

/* A pose: for each node the rotation (row-major 3 x 3) and the translation, 12 doubles. */
#define NPG_POSE_SIZE 12
static inline size_t npg_pose_bytes(size_t node_count)
{
    return node_count * NPG_POSE_SIZE * sizeof(double);
}

/* All nodes at rest.  pose: K x 12. */
void npg_pose_rest(double *pose, size_t node_count);

/* The pose in which vertices (V x 3) that are at `rest` in the graph come nearest to where they are `placed`: each
 * node moves as the vertices that it carries do, in the sense of least squares.  NPG_MEMORY. */
npg_status npg_pose_of(double *pose, const npg_graph *graph, const float *rest, const float *placed);

/* Where a point that the nodes carry goes. */
void npg_pose_point(double out[3], const npg_graph *graph, const double *pose, const float rest[3],
                    const uint32_t nodes[NPG_GRAPH_BIND], const float weights[NPG_GRAPH_BIND]);

/* A pose as affine maps in single precision, for many points: rows (K x 16) holds each node's 3 x 4 matrix by
 * columns of four, [R | g + t - R g], the fourth number of a column 0. */
#define NPG_POSE_ROW 16
void npg_pose_rows(float *rows, const npg_graph *graph, const double *pose);

/* vert_pos (V x 3) of the vertices rest (V x 3) in a pose given by its rows. */
void npg_pose_vertices(float *restrict vert_pos, const npg_graph *graph, const float *restrict rows,
                       const float *restrict rest);

/* Pose: what is done with a pose (graph.c) as such: taken on, moved as a whole, compared with another. */

/* x -> rotation x + translation. */
typedef struct npg_rigid {
    double rotation[3][3], translation[3];
} npg_rigid;

/* Coordinate `row` of R x + t. */
static inline double npg_rigid_at(const npg_rigid *m, const float x[3], int row)
{
    const double *r = m->rotation[row];
    return r[0] * (double)x[0] + r[1] * (double)x[1] + r[2] * (double)x[2] + m->translation[row];
}

/* Make the rows of a matrix that is nearly a rotation orthonormal again (Gram and Schmidt). */
void npg_pose_straighten(double rotation[9]);

/* next = the pose after `now`, if the motion since `before` goes on:
 * next_k = now_k before_k^-1 now_k.  K x 12 each. */
void npg_pose_extrapolate(double *next, const double *now, const double *before, size_t node_count);

/* moved = the pose (K x 12) as it is after the whole body has moved by `motion`:
 * R_k' = R R_k,  g_k + t_k' = R (g_k + t_k) + t. */
void npg_pose_move(double *moved, const npg_graph *graph, const double *pose, const npg_rigid *motion);

/* Where the pose has the nodes (K x 3): g_k + t_k. */
void npg_pose_places(float *places, const npg_graph *graph, const double *pose);

/* The motion that takes the nodes of one pose closest to those of another, least squares.  NPG_MEMORY. */
npg_status npg_pose_between(npg_rigid *motion, const npg_graph *graph, const double *from, const double *to);

/* bend = sqrt(mean_k |R g_k + t - (g_k + t_k)|^2), in units, of the rigid motion (R, t) that makes it least:
 * how far the pose is from moving the body as one piece.  NPG_MEMORY. */
npg_status npg_pose_bend(double *bend, const npg_graph *graph, const double *pose);

/* Turns and moves each node by its steps (K x 6: omega, then a move; exp(omega) by Rodrigues' formula), all scaled alike
 * where one is too large for a linearised turn.  steps: as they were taken, after it.  Returns the largest move. */
double npg_pose_step(double *pose, double *steps, size_t node_count);

/* Visible: which places of a surface sensors can see, in the pose at work.
 *
 * A sensor sees a place that faces it and has none of the surface before it.  What no sensor sees must not be
 * drawn to the points: they are of another side of the body. */

#define NPG_SEEN_OFFSET 0.004 /* units: surface nearer than this hides nothing from a sensor */

/* Room for a number of places; the arena's, which knows whether there was enough. */
typedef struct npg_visible {
    npg_ray *rays;
    npg_ray_hit *hits;
} npg_visible;

void npg_visible_open(npg_visible *visible, npg_arena *arena, size_t place_count);

/* Whether a place with this unit normal faces one of the sensors (S x 3): the cosine to the way there is
 * above `least`.  A sensor that is not finite saw nothing. */
bool npg_faces_sensor(const float *sensors, size_t sensor_count, const float place[3], const double normal[3],
                      double least);

/* is_seen[i] (N): whether a sensor sees places[i] (N x 3) of the surface, with the normals of its vertices
 * (verts[i]: which one it is; NULL: the i-th); all are where no sensor is known (sensor_count 0).  offset:
 * surface nearer than that hides nothing.  All in the same coordinates.  NPG_MEMORY. */
npg_status npg_visible_find(npg_visible *visible, uint8_t *is_seen, const npg_surface *surface,
                            const float *sensors, size_t sensor_count, const float *places,
                            const uint32_t *verts, const float *vert_normals, size_t count, double offset);

/* Viewpoints: from where a cloud was seen, if nobody says so.
 *
 * Of directions d_k all around, C is a choice from which the points can be seen past the surface: again and again
 * the one that sees the most of those which no other does, and the least of the surface that has none,
 *
 *     k = argmax_k |{i : i not seen from C, i seen from d_k}| - (the same of bare vertices, in points of the others),
 *
 * of those that add more than NPG_FEW of the points: what a sensor sees has some.  Not the sensors' own places, but
 * what looks where they do: what is seen from C and has no points is not there.  Not in the paper. */

/* mesh: a surface through the points (N x 3, N >= 1, with outward unit normals), in the same pose and coordinates,
 * with its normals and what is unseen of it (nothing where either is NULL); offset: what is nearer than that hides
 * nothing.  Up to 4000 points are asked.  Equal input gives equal bits.  NPG_MEMORY. */
npg_status npg_viewpoints_find(npg_viewpoints *found, const npg_mesh *mesh, const float *points,
                               const float *normals, size_t count, double offset);

/* sensors (count x 3 of the viewpoints): places NPG_SENSOR_AWAY from the middle of the points (N x 3). */
void npg_viewpoints_place(float *sensors, const npg_viewpoints *viewpoints, const float *points,
                          size_t count);

/* Occlusion prior: how the parts of the body that no sensor sees in a frame are arranged.
 *
 * What is seen has points; all else has only the edges of the graph, and those draw it to the keyframe's
 * pose: an arm that goes behind the body goes back to where it was in the keyframe.  So an edge from node j
 * to node k of which nothing is seen has the direction that it had, in the frame of its end j, in a pose
 * nearby, and not the one at rest:
 *
 *     e_jk = (1 - PRIOR h) (g_k - g_j) + PRIOR h R_j^T (x_k - x_j)       x_k = g_k + t_k, of that pose
 *
 * h in 0..1: how much of what both ends carry is hidden; PRIOR: occlusion_prior.c.  Of a hidden part with a known pose on
 * either side in time both have a say: s frames after a sensor saw it last, the pose on the far side has s
 * times the weight of the one on the near side.  Frame by frame from the far side that goes evenly in time
 * from where the part was seen last to where it is seen next.  Not in the paper. */

/* What hidden parts are held by; loans. */
typedef struct npg_prior_poses {
    const double *pose;     /* K x 12: of a frame nearby, or of this one as it was found before */
    const double *far_pose; /* K x 12: of the next frame on the other side, or NULL */
    const float *since;     /* K: frames since what a node carries was seen last; beside `far_pose` */
} npg_prior_poses;

typedef struct npg_occlusion_prior {
    uint32_t (*pairs)[2]; /* P: the graph's edges and the links of its pieces (component_links.c), sorted */
    uint8_t *is_link;     /* P */
    size_t pair_count;    /* P */
    float (*edges)[3];    /* 2P: of each pair, from its first node and from its second */
    float *seen;          /* K: share of what a node carries that is seen, 0..1 */
    float *bound;         /* K, scratch */
} npg_occlusion_prior;

/* Room for a graph's pairs and nodes, the arena's; all is seen.  NPG_MEMORY. */
npg_status npg_prior_open(npg_occlusion_prior *prior, npg_arena *arena, const npg_graph *graph);

/* The edges as they are in the poses that hold them. */
void npg_prior_take(npg_occlusion_prior *prior, const npg_graph *graph, const npg_prior_poses *poses);

/* Which nodes carry what is seen: is_seen (count) of these vertices of the graph. */
void npg_prior_see(npg_occlusion_prior *prior, const npg_graph *graph, const uint32_t *verts,
                   const uint8_t *is_seen, size_t count);

/* e_jk of pair e / 2, from its second node to its first where e is odd.  Returns what it counts: 1, and of a
 * link the share h, a hundredth at least. */
double npg_prior_edge(double edge[3], const npg_occlusion_prior *prior, const npg_graph *graph, size_t e);

/* since (K) of a frame from that of the frame before it: 0 where most of what a node carries is seen. */
void npg_prior_count(const npg_occlusion_prior *prior, float *since, const float *before, size_t node_count);

/* Tracker: a coarse alignment of the reference with one frame's points, from a nearby pose.
 *
 * Gauss-Newton on the nodes of a deformation graph (graph.c):
 *
 *     E = mean_p rho(|x(c_p) - p|) |x(c_p) - p|_W^2 + 1/2 mean_s rho(|x(s) - p_s|) |x(s) - p_s|_W^2
 *         + stiff / edges * sum over edges, both ways, h_jk |R_j e_jk + g_j + t_j - (g_k + t_k)|^2
 *     |y|_W^2 = (1 - along) (n . y)^2 + along |y|^2               n: the surface's normal there
 *     stiff = stiffness 10^(1 - a) (1 + (d / 0.003 L)^2) (before one sensor: 20)
 *     rho(r) = (1 + r^2 / w^2)^-2                                  Geman and McClure, held during a step
 *     w = max(0.08^(1 - a) 0.01^a L, 2.5 d)
 *
 * c_p: the point of the deformed surface closest to the target point p; p_s: the target point closest to the
 * sample s; e_jk: the edge g_k - g_j at rest, or as it is held where no sensor sees it, and h_jk what it counts
 * (1 but for links, occlusion_prior.c).  a grows from 0 to 1 over the first 2/3 of the steps; another effort
 * has other numbers for 10 and 0.08.  d: mean distance of the points from the surface in the step before, so the
 * noisier they are the more of them must agree before the surface gives way.  L: longest side of the reference
 * against that of the box of all frames.  One sensor leaves half of the body to the edges.  Without known sensors
 * a surface with a border is taken to end where the points do: for a point whose c_p is on it, and for a sample on
 * it that is farther from p_s than 2.5 times the mean of the step before, n is the way to the other, which holds
 * a sheet in its own plane, across which n would let it slide.  Samples without a
 * point within 3 w, or whose nearest is another part's, have no part; those where a sensor saw that nothing is
 * go the shortest way out of there (npg_free_space_leave()), where they are held until they have a point, and w is
 * at least as long as that is.  What a fit comes to is its Chamfer distance of what can be compared; before images,
 * which tell what is lost,
 *
 *     cost = mean_p min(d_p^2, tau^2) / tau^2 + mean_s min(d_s^2, tau^2) / tau^2
 *
 * over all points p and the samples s that are seen, or stand in empty space, which counts 1; tau = 3 w at the end.
 * Few unknowns, second order: it reaches what gradient descent needs hundreds of steps for; the joint fit then
 * needs to find only what the graph can't express.
 *
 * Not in the paper: it replaces the slow way from the identity (paper, "Deformation Loss", confidence). */

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
    double point_dist_mean;  /* target points -> surface, mean of distances                        */
    double sample_dist_mean; /* surface, as far as it is seen -> points, mean of distances         */
    double point_dist_sq;    /* target points -> surface, mean of squares                          */
    double chamfer;          /* mean of squared distances, points -> surface and surface -> points */
    double explained;        /* share of the target points that it has a place for                 */
    double astray;           /* by depth images: lost points + 2 x samples where nothing is, shares */
    double cost;             /* what poses of a frame are compared by                              */
    bool by_images;          /* `cost` is theirs, else the Chamfer distance; `astray` is known     */
    double change;           /* the last step's largest movement of a node                         */
    int steps;
} npg_tracked;

/* reference: unit coordinates with normals; counted reference kept. */
npg_status npg_tracker_open(npg_tracker **tracker, npg_mesh *reference, const npg_tracker_settings *settings);
void npg_tracker_close(npg_tracker **tracker);

/* Bytes at most over a surface of so many vertices. */
size_t npg_tracker_memory(size_t nodes, size_t samples, size_t verts);
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
    const npg_free_space *space; /* where nothing is, or NULL */
} npg_tracker_cloud;

/* How a fit goes about it. */
typedef struct npg_tracker_effort {
    int steps;         /* at most                                          */
    double stiffness;  /* of the first step, in final stiffnesses          */
    double width_unit; /* of the first step's robust weight: what may move */
    double along;      /* times the share of distances along the surface   */
    double cost_best;  /* that is to be bettered ...                        */
    double cost_most;  /* ... by coming to this, or it is given up; 0: it never is */
} npg_tracker_effort;

/* Of a fit that starts where the motion so far leads to. */
npg_tracker_effort npg_tracker_usual(const npg_tracker *tracker);

/* Of a fit that starts from what a pass before found: near the usual one's end, in half of the steps. */
npg_tracker_effort npg_tracker_again(const npg_tracker *tracker);

/* Improve pose (K x 12) to explain the points, of which there is one at least.  Where it is known where they
 * were seen from, they are compared with what can be seen of the surface from there (visible.c), and points
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

/* Follower: a surface from frame to frame, in each from where the one before it was going. */
typedef struct npg_follower {
    npg_tracker *tracker;
    double *pose, *before, *next; /* K x 12 each; pose: of the frame that it is in */
    npg_arena arena;
} npg_follower;

/* mesh: as of npg_tracker_open().  At rest.  NPG_MEMORY: what was got is to be closed. */
npg_status npg_follower_open(npg_follower *follower, npg_mesh *mesh, const npg_tracker_settings *settings);
void npg_follower_close(npg_follower *follower);

/* Back to where the mesh is, or to the pose nearest to where its vertices are placed (V x 3).  NPG_MEMORY. */
void npg_follower_rest(npg_follower *follower);
npg_status npg_follower_start(npg_follower *follower, const float *placed);

/* To the next frame, of one point at least. */
npg_status npg_follower_go(npg_follower *follower, const npg_tracker_cloud *cloud);

/* vert_unit (V x 3) of the mesh there. */
void npg_follower_vertices(const npg_follower *follower, float *vert_unit);

/* Rigid ICP: how a body stands in one frame against another, as far as it moved as a whole.
 *
 * Motion recurs, but seldom in place: who walks comes back to a pose lengths away, who turns comes back to it
 * facing elsewhere.  So two frames are compared, and one is started from the pose of the other, after the
 * rigid motion that brings their points together.
 *
 * Based on: Besl and McKay, A method for registration of 3-D shapes, 1992 (iterated closest points), and
 * Chetverikov et al., The trimmed iterative closest point algorithm, 2002: the pairs that lie farthest apart,
 * of limbs that moved on their own, are left out. */

#define NPG_LOOK_POINTS 500 /* of a frame, at most */

/* A few points of a frame. */
typedef struct npg_look {
    float *points; /* N x 3; owned */
    size_t count;  /* N            */
    npg_kdtree *tree;
} npg_look;

/* Spread over the points that are given, one at least.  NPG_MEMORY: what was got is to be closed. */
npg_status npg_look_open(npg_look *look, const float *points, size_t point_count);
void npg_look_close(npg_look *look);

/* motion: takes `from` onto `to`, found from where their middles meet and from `guess`; *unlike: what is left
 * between them then, the mean of squared distances, both ways.  NPG_MEMORY. */
npg_status npg_rigid_icp(npg_rigid *motion, double *unlike, const npg_look *from, const npg_look *to,
                         const npg_rigid *guess);

/* Candidate clouds: the frames of the choosing pass, thinned, and how a surface made from one of them fares in
 * the others: it is followed from frame to frame by the coarse tracker, outward in both directions. */

#define NPG_CANDIDATE_POINTS 8000 /* of a frame, at most */

typedef struct npg_candidate_cloud {
    int64_t index, number;
    bool is_candidate;
    size_t point_count;
    float *points, *normals; /* N x 3 each, unit; normals may be NULL; the list's */
    float *fit,
        *fit_normals; /* F x 3 each: those of them that a surface which is to be judged may be fitted to */
    size_t fit_count;
    float *held; /* H x 3: the others, every fifth or so */
    size_t held_count;
    float *sensors; /* S x 3, unit: where it was seen from; the list's */
    size_t sensor_count;
    npg_free_space *space; /* or NULL; the list's */
} npg_candidate_cloud;

typedef struct npg_candidate_clouds {
    npg_arena arena; /* of all points and normals */
    size_t count, capacity;
    npg_candidate_cloud *list; /* in time order; owned                                */
    size_t given, flipped;     /* normals of candidates: given, and on the wrong side */
} npg_candidate_clouds;

/* Copy a cleaned frame's points, evenly thinned, and again what is to be held out of them, by a hash of their
 * place, and what is not.  Skipped frames are left out.  NPG_MEMORY. */
npg_status npg_candidate_clouds_add(npg_candidate_clouds *clouds, const npg_frame *frame,
                                    const npg_frame_box *box, bool is_candidate);
/* What stage keyframe saw in the choosing pass: the sample that references are judged by.  Not there where
 * none was read. */
extern const npg_fact_kind npg_fact_candidate_clouds;

npg_status npg_candidate_clouds_open(npg_candidate_clouds **clouds);
void npg_candidate_clouds_close(npg_candidate_clouds **clouds);

/* Where the frame with this index is in the list; count when it is not there. */
size_t npg_candidate_clouds_find(const npg_candidate_clouds *clouds, int64_t index);

/* Sees the surface in one frame: vert_unit (V x 3) is a loan. */
typedef npg_status (*npg_candidate_seen)(void *user, const npg_candidate_cloud *cloud,
                                         const float *vert_unit);

/* Follow the surface (unit coordinates, with normals) of list[from] through all others, by what was not held
 * out of them; seen is called once for each.  NPG_MEMORY, NPG_DIVERGED, or what seen returns. */
npg_status npg_candidate_follow(const npg_candidate_clouds *clouds, size_t from, npg_mesh *mesh,
                                const npg_tracker_settings *settings, npg_candidate_seen seen, void *user);

#endif
