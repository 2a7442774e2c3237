/* Latent grids as OpenVDB files that other programs open. */
#ifndef NPG_VDB_GRIDS_H
#define NPG_VDB_GRIDS_H

#include "kernels/levels.h"
#include "pipeline/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What the grids belong to, for the metadata. */
typedef struct npg_vdb_place {
    double world_centre[3]; /* world position of the grids' 0 */
    double unit_per_world;  /* scale                          */
    int64_t frame_first, frame_last, window;
} npg_vdb_place;

/* Write all dense levels of rows [row_count][32] to a file: a float grid for each channel of each level,
 * "position_L05_c03" (level 5, channel 3).  The voxel (i, j, k) is node (i, j, k) of the level; the transform
 * takes it to world coordinates (grids over normal directions: to the cube [-1, 1]^3; so do the others where
 * the capture is so small that OpenVDB can't hold their voxels: npg_space = "unit").  Every grid has the
 * metadata npg_level, npg_nodes, npg_lambda (of I + lambda (2 D - A), kernels/levels.h), npg_channel,
 * npg_frame_first, npg_frame_last; the file has npg_window, npg_levels, npg_world_centre,
 * npg_unit_per_world.  Values are the unknowns of the fit, differential coordinates: the features are that
 * matrix, inverted, times them.  Single precision, exact. */
npg_status npg_vdb_save_levels(const char *path, const npg_levels *levels, const float *rows,
                               const npg_vdb_place *place);

#ifdef __cplusplus
}
#endif
#endif
