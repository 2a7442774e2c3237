/* Fused: what all frames saw of the body, in the pose of the reference.  Stage fuse makes it, stage mesh
 * takes a surface from it. */
#ifndef NPG_FUSED_H
#define NPG_FUSED_H

#include "pipeline/stage.h"

#define NPG_FUSED_MOST 120000 /* points at most: 20 000 faces hold no more detail, with reserve */

/* The points of all frames, carried back to the keyframe's pose, averaged and thinned. */
typedef struct npg_fused {
    float *points, *normals; /* N x 3 each, unit coordinates, unit normals outward; owned */
    size_t count;            /* N */
    double spacing_unit;     /* side of the cells that points were averaged over */
    double key_spacing_unit; /* of the keyframe's points                            */
    double key_noise_unit;   /* of the same, across the surface                     */
    /* Their colours, where they have any: points of their own, M x 3, M x 3 and M x 4; owned, or NULL. */
    float *hue_points, *hue_normals;
    uint8_t *hues;
    size_t hue_count; /* M */
    /* Cubes that sensors saw to be empty, their middles; not there where no sensor's place is known. */
    float *empty; /* K x 3, owned, or NULL */
    size_t empty_count;
    double empty_side;
} npg_fused;

/* Written by stage fuse at the end of a fusing pass; stage mesh takes it in the pass that follows. */
extern const npg_fact_kind npg_fact_fused;

void npg_fused_close(npg_fused **fused);

#endif
