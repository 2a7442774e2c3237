/* Query: what the library itself asks of a surface beyond the public npg_surface_closest() (neupig.h):
 * closest points with a hint where to begin, and rays.
 *
 * All functions are thread-safe among themselves (not beside npg_surface_move), split their batch over
 * `threads` threads (0: one per core) and give the same answer for every number of threads. */
#ifndef NPG_QUERY_H
#define NPG_QUERY_H

#include <stdbool.h>

#include "pipeline/mesh.h"

/* The closest surface point (closest face: the smallest squared distance as float, ties to the lower face
 * index).  hits[i] for points[i] (N x 3).  start_face (N, or NULL) names a face that is likely near; the
 * search then begins with the distance to it.  start_dist (N, or NULL) is a distance the answer is likely
 * within.  Both only save time: where they are wrong (out of range, too small, not finite) the answer is the
 * same.  A point that is not finite gets face = UINT32_MAX and dist_sq = infinity.  NPG_MEMORY. */
npg_status npg_surface_closest_near(const npg_surface *surface, npg_surface_hit *hits, const float *points,
                                    size_t point_count, const uint32_t *start_face, const float *start_dist,
                                    int threads);

/* The same of a mesh as it lies, without hints, on all cores. */
npg_status npg_mesh_closest(npg_surface_hit *hits, const npg_mesh *mesh, const float *points,
                            size_t point_count);

typedef struct npg_ray {
    float origin[3], direction[3]; /* any length; t is measured in lengths of the direction */
    float t_min, t_max;
} npg_ray;

typedef struct npg_ray_hit {
    uint32_t face;    /* UINT32_MAX: nothing hit              */
    float weights[3]; /* barycentric weights of the point hit */
    float t;          /* where; infinity without a hit        */
    bool is_back;     /* the face was hit from its back       */
} npg_ray_hit;

/* The first face each of N rays meets within t_min..t_max, from either side. */
npg_status npg_surface_rays(const npg_surface *surface, npg_ray_hit *hits, const npg_ray *rays,
                            size_t ray_count, int threads);

/* The exact closest point of one face to p: weights and squared distance (computed in double, relative to p,
 * so that it stays exact far from the origin).  Degenerate faces count as their edges. */
void npg_face_closest(npg_surface_hit *hit, const float *vert_pos, const uint32_t *faces, uint32_t face,
                      const float p[3]);

#endif
