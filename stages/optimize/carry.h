/* Carry: points of a surface that follow the vertices of a coarser one.
 *
 *     x(v) = y(v) + sum_i b_i(v) (x_i - y_i)
 *
 * y: positions before, x_i and y_i: the coarse vertices now and before, b(v): barycentric weights of v's closest
 * point on the coarse surface at rest.  What is carried is the difference, which is smooth: the surface keeps its
 * detail. */
#ifndef NPG_OPTIMIZE_CARRY_H
#define NPG_OPTIMIZE_CARRY_H

#include "geometry/geometry.h"

/* Both of N points whose closest places on the coarse surface at rest are hits (npg_mesh_closest()).
 * to (N x 3) += the ways (x 3) of the coarse vertices. */
void npg_carry(float *to, const npg_mesh *coarse, const npg_surface_hit *hits, size_t count,
               const float *ways);

/* ways (x 3) += what of N values (x 3) falls to each coarse vertex: the transpose. */
void npg_carry_back(float *ways, const npg_mesh *coarse, const npg_surface_hit *hits, size_t count,
                    const float *values);

#endif
