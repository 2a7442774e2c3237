/* Fused: the fact and its release. */
#include "mesh/fused.h"

static void release_fused(void *value)
{
    npg_fused *fused = value;
    npg_fused_close(&fused);
}

const npg_fact_kind npg_fact_fused = {"fused", "fuse", release_fused};

void npg_fused_close(npg_fused **slot)
{
    if (!slot || !*slot) return;
    npg_release(&(*slot)->points);
    npg_release(&(*slot)->normals);
    npg_release(&(*slot)->hue_points);
    npg_release(&(*slot)->hue_normals);
    npg_release(&(*slot)->hues);
    npg_release(&(*slot)->empty);
    npg_release(slot);
}
