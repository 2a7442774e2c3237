/* Metrics: how close a predicted mesh sequence is to a ground truth, by the measures of the method's paper.
 *
 * Both surfaces are sampled uniformly by area.  With a the samples of the prediction, b those of the truth,
 * d the distance from a sample to the nearest one of the other side in units of `diagonal`, n their face
 * normals:
 *
 *   CD    0.5 (mean d(a,b)^2 + mean d(b,a)^2) x 1e5
 *   NC    0.5 (mean |n_a . n_b| both ways)
 *   F     harmonic mean of precision (share of a with d <= tau) and recall (share of b with d <= tau)
 *   Corr  every predicted vertex is tied to the nearest vertex of the truth in the first frame; the mean
 *         distance between the two in a later frame
 *
 * Meshes must have been read relative to the same origin.  The same input gives the same figures. */
#ifndef NPG_METRICS_H
#define NPG_METRICS_H

#include "pipeline/mesh.h"

typedef struct npg_metrics_settings {
    size_t sample_count; /* on either side                                                 */
    double tau;          /* of the F-score, in diagonals: 0.005                            */
    double diagonal;     /* of the box of the first frame's truth, in the meshes' own unit */
    uint64_t seed;
    int threads; /* 0: one per core; does not change the figures */
} npg_metrics_settings;

typedef struct npg_frame_metrics {
    double cd, cd_to_truth, cd_from_truth; /* x 1e5; predicted -> truth, truth -> predicted */
    double nc;                             /* NaN when the truth has no normals             */
    double f, precision, recall;           /* 0..1                                          */
} npg_frame_metrics;

/* Compare one frame.  A truth without faces is a cloud: all its points stand for the samples, and its
 * vert_normals, if any, for the normals.  NPG_BAD_INPUT for a prediction without area or a truth without
 * points; NPG_MEMORY.  Cost: O(S log S) for S samples; memory about 80 S bytes. */
npg_status npg_metrics_compare(npg_frame_metrics *out, const npg_mesh *predicted, const npg_mesh *truth,
                               const npg_metrics_settings *settings, uint64_t frame);

/* For every predicted vertex the nearest vertex of the truth; *truth_of (V entries) is the caller's. */
npg_status npg_metrics_tie(uint32_t **truth_of, const npg_mesh *predicted, const npg_mesh *truth);

/* Mean distance of the tied vertices in a frame, in diagonals. */
double npg_metrics_drift(const npg_mesh *predicted, const npg_mesh *truth, const uint32_t *truth_of,
                         double diagonal);

/* S samples of a mesh, uniform by area: positions (S x 3), unit face normals (S x 3; zero for a face without
 * area) and the face of each (may be NULL).  NPG_BAD_INPUT when the mesh has no area. */
npg_status npg_mesh_sample(float *pos, float *normals, uint32_t *face_of, const npg_mesh *mesh,
                           size_t sample_count, uint64_t seed, uint64_t frame, uint64_t purpose);

/* Diagonal of the box of N x 3 points. */
double npg_points_diagonal(const float *points, size_t point_count);

#endif
