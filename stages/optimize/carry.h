/* Carry: points of a surface that follow the vertices of a coarser one.
 *
 *     x(v) = y(v) + sum_i b_i(v) (x_i - y_i)
 *
 * y: positions before, x_i and y_i: the coarse vertices now and before, b(v): barycentric weights of v's closest
 * point on the coarse surface at rest.  What is carried is the difference, which is smooth: the surface keeps its
 * detail. */
#ifndef NPG_OPTIMIZE_CARRY_H
#define NPG_OPTIMIZE_CARRY_H

#include "pipeline/mesh.h"

typedef struct npg_carrier {
    uint32_t vertex[3]; /* of the coarse surface */
    float share[3];
} npg_carrier;

/* Which vertices of `coarse`, at rest, carry the points (N x 3). */
npg_status npg_carriers_bind(npg_carrier *carriers, const npg_mesh *coarse, const float *points,
                             size_t count);

/* to (N x 3) += the ways (x 3) of the coarse vertices. */
void npg_carry(const npg_carrier *carriers, size_t count, float *to, const float *ways);

/* ways (x 3) += what of N values (x 3) falls to each coarse vertex: the transpose. */
void npg_carry_back(const npg_carrier *carriers, size_t count, float *ways, const float *values);

#endif
