/* Point set: the reference's points, out of a frame or out of all frames, and their measures. */
#include "mesh/mesh_internal.h"

#include <math.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "pipeline/cost.h"

/* No surface is made of what lies apart in its frame, nor of what stands where most frames look through: that was
 * carried there by a wrong motion.  frame: of the points, NULL: they are those of all frames. */
static npg_status drop_unsound(npg_point_set *set, const npg_frame *frame)
{
    uint8_t *keep;
    if (frame && !frame->isolated) return NPG_OK;
    NPG_TRY(npg_alloc(&keep, NPG_FOR_MESH, set->count));
    for (size_t i = 0; i < set->count; i++)
        keep[i] = frame ? !frame->isolated[npg_spread_index(i, set->count, frame->point_count)]
                        : npg_cube_set_value(set->empty, set->points + 3 * i) <= NPG_MAJORITY;
    set->count = npg_points_keep(set->points, set->normals, set->count, keep);
    npg_release(&keep);
    return NPG_OK;
}

/* What only carries the frames of a fusing pass is made of an even choice: Poisson's time goes with the points. */
static npg_status take_frame(npg_point_set *set, npg_worker *worker, const npg_frame *frame)
{
    size_t n = frame->point_count;
    size_t most = npg_worker_pass(worker) == NPG_PASS_FUSE ? NPG_START_POINTS_MOST : n;
    set->given = n;
    set->count = n < most ? n : most;
    NPG_TRY(npg_alloc_array(&set->points, NPG_FOR_MESH, set->count, 3 * sizeof(float)));
    if (frame->normals) NPG_TRY(npg_alloc_array(&set->normals, NPG_FOR_MESH, set->count, 3 * sizeof(float)));
    npg_points_spread(set->points, set->normals, set->count, frame->pos_local, frame->normals, n);
    NPG_TRY(drop_unsound(set, frame));
    npg_box_local_to_unit(&npg_worker_facts(worker)->box, set->points, set->points, set->count);
    return NPG_OK;
}

/* Those of all frames are thinned already.  The set owns them from here on; `fused` keeps its figures. */
static npg_status take_fused(npg_point_set *set, npg_worker *worker, npg_fused *fused)
{
    set->is_fused = true;
    set->given = set->count = fused->count;
    set->points = fused->points;
    set->normals = fused->normals;
    set->key_spacing = fused->key_spacing_unit;
    set->key_noise = fused->key_noise_unit;
    fused->points = fused->normals = NULL;
    if (!fused->empty) return NPG_OK;
    NPG_TRY(npg_cube_set_open(&set->empty, fused->empty, fused->empty_count, fused->empty_side));
    if (!npg_worker_facts(worker)->brief.is_side) return NPG_OK;
    return drop_unsound(set, NULL);
}

static npg_status measure(npg_point_set *set, npg_worker *worker)
{
    set->diagonal = npg_points_diagonal(set->points, set->count);
    npg_mesh_note_count(worker, "points", set->given);
    npg_mesh_note_count(worker, "points_used", set->count);
    NPG_TRY(npg_cloud_spacing(&set->spacing, set->points, set->count));
    npg_mesh_note(worker, "point_spacing_unit", set->spacing);
    set->seen_dist =
        fmax(NPG_SAMPLED * set->spacing, set->key_spacing); /* all frames lie closer, but not everywhere */
    return NPG_OK;
}

npg_status npg_point_set_open(npg_point_set *set, npg_worker *worker, const npg_frame *key, npg_fused *fused)
{
    *set = (npg_point_set){.key_number = key->number,
                           .has_given_normals = key->cleaning.normals_given > key->point_count / 2};
    npg_status status = fused ? take_fused(set, worker, fused) : take_frame(set, worker, key);
    if (!status) status = measure(set, worker);
    if (status) npg_point_set_close(set);
    return status;
}

void npg_point_set_close(npg_point_set *set)
{
    npg_release(&set->points);
    npg_release(&set->normals);
    npg_cube_set_close(&set->empty);
}

/* ---- what all frames saw ---- */

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
    npg_release(&(*slot)->colour_points);
    npg_release(&(*slot)->colour_normals);
    npg_release(&(*slot)->colours);
    npg_release(&(*slot)->empty);
    npg_release(slot);
}
