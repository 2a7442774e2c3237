/* k-d tree of N points (nanoflann): nearest neighbours on the host. */
#ifndef NPG_KDTREE_H
#define NPG_KDTREE_H

#include "pipeline/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct npg_kdtree npg_kdtree;

/* points: N x 3, finite; a loan that must outlive the tree.  N >= 1. */
npg_status npg_kdtree_open(npg_kdtree **tree, const float *points, size_t point_count);
void npg_kdtree_close(npg_kdtree **tree);

/* The k nearest points of each of M queries, nearest first; ties go to the lower index.  index and dist_sq
 * are M x k; where the tree has fewer than k points the rest is UINT32_MAX and infinity.  Uses `threads`
 * threads (0: one per core); the result does not depend on it.  NPG_MEMORY. */
npg_status npg_kdtree_nearest(const npg_kdtree *tree, uint32_t *index, float *dist_sq, const float *queries,
                              size_t query_count, size_t k, int threads);

/* The number of points within a radius of each query, counted up to `enough` (0: all). */
npg_status npg_kdtree_count(const npg_kdtree *tree, uint32_t *count, const float *queries, size_t query_count,
                            float radius, uint32_t enough, int threads);

#ifdef __cplusplus
}
#endif
#endif
