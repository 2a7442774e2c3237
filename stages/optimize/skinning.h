/* Skinning: few well-spread vertices of the reference that are optimised, and how they carry
 * the rest of the surface.
 *
 *     x(v) = y(v) + sum_i b_i(v) (x_i - y_i)
 *
 * y: positions before the fit (the coarse alignment), x_i: fitted samples, b(v): barycentric weights of v's
 * closest point on the mesh of the samples.  What is carried is the difference, which is smooth: the surface
 * keeps its detail, and the distance to it is not biased by the spacing of the samples (method: few samples
 * fitted, dense mesh as the result). */
#ifndef NPG_SKINNING_H
#define NPG_SKINNING_H

#include "geometry/proxy.h"

typedef struct npg_skin_weights {
    int32_t sample[3];
    float share[3];
} npg_skin_weights;

typedef struct npg_skinning {
    npg_proxy *surface;                /* W vertices: the surface that points are matched with */
    npg_proxy *samples;                /* S: vertices of that surface                          */
    uint32_t *vertex;                  /* S: which vertex of the reference each sample is      */
    npg_skin_weights *surface_weights; /* W                                                    */
    npg_surface *rest;                 /* of the samples, at rest                              */
    npg_arena arrays;                  /* holds the two                                        */
    size_t vert_count;                 /* V                                                    */
} npg_skinning;

/* About sample_target samples (0, or more than there are: all vertices of the surface, which has about
 * surface_target, or, with 0, all).  reference has normals; it is a loan. */
npg_status npg_skinning_open(npg_skinning **skinning, const npg_mesh *reference, size_t sample_target,
                             size_t surface_target);
void npg_skinning_close(npg_skinning **skinning);

/* Which vertices of `mesh`, whose surface at rest is `rest`, carry points (N x 3).  threads: 0 for one per
 * core. */
npg_status npg_skin_bind(npg_skin_weights *weights, const npg_mesh *mesh, npg_surface *rest,
                         const float *points, size_t count, int threads);

/* samples (S x 3) = the samples' rows of vert_pos (V x 3). */
void npg_skinning_gather(const npg_skinning *skinning, float *samples, const float *vert_pos);

/* vert_pos (N x 3), the y of the formula on entry, becomes x for the N vertices that the weights are of:
 * samples_before are the y_i, samples the x_i (S x 3). */
void npg_skin_move(const npg_skin_weights *weights, size_t vert_count, float *vert_pos,
                   const float *samples_before, const float *samples);

#endif
