/* Draft: a coarse surface, of which many are made to be compared. */
#include <math.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "mesh/surface.h"

#define FACES 3000

npg_status npg_mesh_draft(npg_mesh **mesh, const float *points, const float *normals, size_t count,
                          double spacing, bool is_side, const npg_poisson_settings *settings)
{
    npg_poisson_settings quick = *settings;
    npg_pieces pieces;
    npg_mending mending;
    size_t moved;
    double share;
    if (quick.depth > NPG_DRAFT_DEPTH) quick.depth = NPG_DRAFT_DEPTH;
    NPG_TRY(npg_poisson_apart(mesh, &moved, points, normals, count, spacing, &quick));
    npg_status status = is_side ? npg_mesh_trim(mesh, &share, points, count, NPG_SAMPLED * spacing) : NPG_OK;
    if (!status) status = npg_mesh_keep_main(mesh, &pieces, is_side ? HUGE_VAL : 1);
    if (!status) status = npg_mesh_decimate(mesh, FACES);
    if (!status) status = npg_mesh_mend(mesh, &mending);
    if (!status) status = npg_mesh_make_normals(*mesh);
    if (status) npg_mesh_unref(mesh);
    return status;
}
