/* Twins: what each op of kernels/ computes, in plain C and in double; NAME_ref.c beside this file is that of
 * kernels/NAME.cl.  The ops' headers say what the numbers are. */
#ifndef NPG_TEST_TWINS_H
#define NPG_TEST_TWINS_H

#include "kernels/latent.h"
#include "kernels/mlp.h"

/* adam: step counts from 1. */
void npg_adam_step_ref(double *parameters, double *first, double *second, const double *gradient,
                       const float *rates, size_t row, size_t count, int64_t step);

void npg_latent_sample_ref(double *z, const double *nodes, const npg_samples *samples);
void npg_latent_back_ref(double *dnodes, const double *dz, const double *z, const npg_samples *samples);

/* mlp, for one vertex in one frame: out (7) of z (32) and code (M); and the gradients,
 * added to grad and dz. */
void npg_mlp_forward_ref(double *out, const double *z, const double *code, const double *params,
                         const npg_mlp_shape *shape);
void npg_mlp_backward_ref(double *grad, double *dz, const double *dout, const double *z, const double *code,
                          const double *params, const npg_mlp_shape *shape);

/* motion: one vertex each where no more is said. */
void npg_transform_ref(double x[3], const double out[7], const double rest[3]);
void npg_transform_back_ref(double dout[7], const double g[3], const double out[7], const double rest[3]);
/* index of the nearest of count points (count x 3), lowest index on ties. */
size_t npg_nearest_ref(double *dist_sq, const double query[3], const double *points, size_t count);
/* cd and its gradient g (real x 3, overwritten) of one frame with given correspondences. */
double npg_chamfer_pairs_ref(double *g, const double *x, size_t real, const double *points, size_t count,
                             const size_t *to_points, const size_t *to_verts, double alpha);
/* Sum over edges of | |x_i - x_j| - rest |, gradient added to g. */
double npg_isometry_ref(double *g, const double *x, const uint32_t (*edges)[2], const double *rest,
                        size_t edge_count);

/* sobolev: y = (I + lambda L) x, the matrix itself: what the solve must invert. */
void npg_sobolev_apply_ref(double *y, const double *x, const npg_levels *levels);

#endif
