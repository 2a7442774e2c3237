/* OpenVDB files for other programs, and what they hold: level sets of surfaces, latent grids as features. */
#ifndef NPG_EXPORTERS_VDB_H
#define NPG_EXPORTERS_VDB_H

#include "export/files.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- level sets of surfaces ---- */

typedef struct npg_vdb_surface { /* what is written, with what the file says about it */
    const float *points;         /* V x 3 */
    size_t vert_count;
    const uint32_t *faces; /* F x 3, closed */
    size_t face_count;
    double voxel; /* in the unit of the points */
    int64_t index, number;
    double fps, metres_per_unit;
    bool is_z_up;
} npg_vdb_surface;

/* Write the narrow-band level set (half width three voxels, negative inside) of a closed surface to a file,
 * as the grid "surface"; the file's metadata has npg_index, npg_number, npg_fps, npg_metres_per_unit, npg_up.
 * NPG_FAILED when nothing of it is inside, so that no surface would come out; NPG_MEMORY. */
npg_status npg_vdb_save_surface(const char *path, const npg_vdb_surface *surface);

/* ---- what the unknowns of a latent grid stand for, and the direction in which they differ most ---- */

/* x = (I + lambda (2 D - A))^-1 y of a dense grid (kernels/levels.h): n^3 nodes with C channels
 * each ([n][n][n][C]), in place, in double on the host.  What makes the matrix of a path diagonal
 * (kernels/path_spectrum.h) along each axis does so with the grid's.  O(C n^4).  NPG_MEMORY. */
npg_status npg_features_solve(double *values, int nodes, int channels, double lambda);

/* The first principal component of `count` rows of C values: out[i] = direction . (row_i - mean),
 * where direction (C, unit length, its largest entry positive) is the eigenvector of the covariance's
 * largest eigenvalue; *share is that eigenvalue's part of the whole variance, 0 where rows do not
 * differ.  NPG_MEMORY. */
npg_status npg_features_component(double *out, double *direction, double *share, const double *values,
                                  size_t count, int channels);

/* ---- latent grids as features, with their first principal component ---- */

typedef struct npg_vdb_span { /* frames of the window, by index */
    int64_t first, last;
} npg_vdb_span;

/* Read the unknowns that npg_vdb_save_levels() wrote to grids_path, and write what the decoder sees to path:
 * grids of the same names with the features (npg_features_solve), and per level one float grid
 * "position_L05_pc1" (or normal_) with the first principal component of its channels; its metadata npg_share
 * is the part of the variance it has.  placement takes the grids over positions to the coordinates of the
 * written meshes; NULL leaves them in the capture's.  Grids whose voxels OpenVDB can't hold there are left
 * in the cube [-1, 1]^3, with the metadata npg_space = "unit".  *span is what the file says of its frames.
 * NPG_BAD_INPUT, NPG_MEMORY, NPG_FAILED. */
npg_status npg_vdb_save_latents(const char *path, npg_vdb_span *span, const char *grids_path,
                                const npg_placement *placement);

#ifdef __cplusplus
}
#endif
#endif
