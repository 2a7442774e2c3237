/* k-d tree of N points: exact nearest neighbours on the host.
 *
 * Leaves hold about twelve points side by side, so that a leaf is searched with the processor's wide
 * registers; the points of a leaf are near each other, and so are those of the leaves that follow it, which
 * is the order to ask for all points' neighbours in (npg_kdtree_each).  Distances are (dx^2 + dy^2) + dz^2
 * in float; every result is exact in them, whatever the points look like. */
#ifndef NPG_KDTREE_H
#define NPG_KDTREE_H

#include "pipeline/memory.h"

#ifdef __cplusplus
extern "C" {
#endif

#define NPG_KDTREE_NEIGHBOURS 256 /* that npg_kdtree_each() can give */

typedef struct npg_kdtree npg_kdtree;

/* points: N x 3, finite; a loan that must outlive the tree.  1 <= N < 2^32 - 1.  NPG_MEMORY. */
npg_status npg_kdtree_open(npg_kdtree **tree, const float *points, size_t point_count);
void npg_kdtree_close(npg_kdtree **tree);

/* Bytes that a tree of so many points takes while it is made, the most it ever does. */
size_t npg_kdtree_memory(size_t point_count);

/* The k nearest points of each of M queries, nearest first; ties go to the lower index.  index and dist_sq
 * are M x k; where the tree has fewer than k points the rest is UINT32_MAX and infinity.  Uses `threads`
 * threads (0: one per core); the result does not depend on it.  NPG_MEMORY. */
npg_status npg_kdtree_nearest(const npg_kdtree *tree, uint32_t *index, float *dist_sq, const float *queries,
                              size_t query_count, size_t k, int threads);

/* The k nearest of N points (N x 3) of each query, by a tree for this call alone, on all cores. */
npg_status npg_points_nearest(uint32_t *index, float *dist_sq, const float *points, size_t point_count,
                              const float *queries, size_t query_count, size_t k);

/* The same in arrays of the arena's, M x k each; fails as well where an earlier take from it was refused. */
typedef struct npg_neighbours {
    uint32_t *index;
    float *dist_sq;
} npg_neighbours;
npg_status npg_neighbours_take(npg_neighbours *out, npg_arena *arena, const float *points, size_t point_count,
                               const float *queries, size_t query_count, size_t k);

/* yes[i] = whether query i has a point of the tree no farther than its own radius, given squared; in the
 * calling thread. */
void npg_kdtree_any_within(const npg_kdtree *tree, uint8_t *yes, const float *queries, const float *radius_sq,
                           size_t query_count);

/* One point of the tree and its k nearest points, itself among them, as npg_kdtree_nearest() gives them; the
 * lists are valid until it returns. */
typedef void npg_kdtree_visit(void *user, uint32_t point, const uint32_t *index, const float *dist_sq);

/* Visit all points that are not left out; where `only` is not NULL, those alone whose entry in it is not 0.
 * Points come in the tree's order, from several threads at once: a visit may write only what belongs to its
 * point.  k <= NPG_KDTREE_NEIGHBOURS. */
npg_status npg_kdtree_each(const npg_kdtree *tree, size_t k, const uint8_t *only, npg_kdtree_visit *visit,
                           void *user, int threads);

/* Leave out the points whose entry in keep (N) is 0: no later search finds them. */
void npg_kdtree_leave_out(npg_kdtree *tree, const uint8_t *keep);

#ifdef __cplusplus
}
#endif
#endif
