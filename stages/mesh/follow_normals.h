/* Follow normals: a mesh of noisy points, turned the way that the points' normals say.
 *
 * A surface through noisy points has their bumps.  The points' normals, each from many points around it, are
 * much nearer the truth than the slopes between bumps.  So each face f of centre c gets a target from the
 * points around it that face its way,
 *
 *     t_f = sum_i w_i n_i / | sum_i w_i n_i |,   w_i = exp(-|p_i - c|^2 / 2 s^2) max(n_i . n_f, 0)^2,
 *
 * with s = 0.6 mean edges, and a few times every vertex goes to where its faces are nearest their targets'
 * planes:
 *
 *     v += 1 / |F_v|  sum_{f ~ v} t_f (t_f . (c_f - v)).
 *
 * That shrinks what is thin.  So nothing stays of the way that all vertices of a neighbourhood went together:
 * its mean over six rings is taken back.  Based on: X. Sun, P. Rosin, R. Martin, F. Langbein, Fast and
 * Effective Feature-Preserving Mesh Denoising, 2007 (the vertices' step).  Not in the paper. */
#ifndef NPG_FOLLOW_NORMALS_H
#define NPG_FOLLOW_NORMALS_H

#include "pipeline/mesh.h"

/* Move the mesh's vertices, in place; its normals are left as they are.  points, normals: N x 3, oriented,
 * N >= 1; faces without points near them keep their slope.  Equal input gives equal bits.  NPG_MEMORY. */
npg_status npg_mesh_follow_normals(npg_mesh *mesh, const float *points, const float *normals,
                                   size_t point_count);

#endif
