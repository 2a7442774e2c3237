/* Graph: a deformation graph over the reference surface; few nodes that carry all vertices along.
 *
 * Based on: Robert Sumner, Johannes Schmid, Mark Pauly, Embedded Deformation for Shape Manipulation, 2007.
 *
 *     x(v) = sum_k w_k(v) (R_k (v - g_k) + g_k + t_k)
 *
 * Nodes g_k lie on the surface, about a radius apart; the weights w_k(v) fall off with the distance along the
 * surface, so that parts which only touch do not hold each other. */
#ifndef NPG_GRAPH_H
#define NPG_GRAPH_H

#include "pipeline/memory.h"
#include "pipeline/mesh.h"

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

#endif
