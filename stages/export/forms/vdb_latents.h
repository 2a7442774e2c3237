/* Latent grids as features, with their first principal component, as OpenVDB files. */
#ifndef NPG_VDB_LATENTS_H
#define NPG_VDB_LATENTS_H

#include "export/forms/placement.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct npg_vdb_span { /* frames of the window, by index */
    int64_t first, last;
} npg_vdb_span;

/* Read the unknowns that npg_vdb_save_levels() wrote to grids_path, and write what the decoder sees to path:
 * grids of the same names with the features (latent_features.h), and per level one float grid
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
