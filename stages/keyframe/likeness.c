/* Likeness: nearest neighbours, both ways. */
#include "keyframe/keyframe_internal.h"

#include <math.h>

#include "geometry/geometry.h"
#include "ingest/ingest.h"

#define LOOKED_AT 1000
#define KEPT      20000 /* vertices, and points of a frame, that may be the nearest */

struct npg_likeness {
    float *verts; /* at most KEPT, in units */
    size_t vert_count, whole_count;
    npg_kdtree *tree;
};

size_t npg_spread_finite(float *out, size_t most, const float *points, size_t count)
{
    size_t spread = npg_points_spread(out, NULL, most, points, NULL, count), kept = 0;
    for (size_t i = 0; i < spread; i++) {
        const float *p = out + 3 * i;
        if (!npg_vec3_is_finitef(p)) continue;
        for (int a = 0; a < 3; a++) out[3 * kept + (size_t)a] = p[a];
        kept++;
    }
    return kept;
}

static npg_status take_mesh(npg_likeness *likeness, const npg_mesh *mesh, const npg_frame_box *box)
{
    NPG_TRY(npg_alloc_array(&likeness->verts, NPG_FOR_RUN, KEPT, 3 * sizeof *likeness->verts));
    likeness->whole_count = mesh->vert_count;
    likeness->vert_count = npg_spread_finite(likeness->verts, KEPT, mesh->vert_pos, mesh->vert_count);
    npg_box_local_to_unit(box, likeness->verts, likeness->verts, likeness->vert_count);
    return npg_kdtree_open(&likeness->tree, likeness->verts, likeness->vert_count);
}

npg_status npg_likeness_open(npg_likeness **out, const char *path, const npg_origin *origin,
                             const npg_frame_box *box)
{
    npg_likeness *likeness;
    npg_mesh *mesh = NULL;
    *out = NULL;
    NPG_TRY(npg_alloc(&likeness, NPG_FOR_RUN, sizeof *likeness));
    npg_origin of_mesh = *origin;
    npg_status status = npg_read_mesh(&mesh, path, &of_mesh);
    if (!status) status = take_mesh(likeness, mesh, box);
    if (!status && !likeness->vert_count) status = npg_error(NPG_BAD_INPUT, "%s: no vertex is finite", path);
    npg_mesh_unref(&mesh);
    if (status) npg_likeness_close(&likeness);
    *out = likeness;
    return status;
}

size_t npg_likeness_vert_count(const npg_likeness *likeness)
{
    return likeness->whole_count;
}

void npg_likeness_close(npg_likeness **slot)
{
    if (!slot || !*slot) return;
    npg_kdtree_close(&(*slot)->tree);
    npg_release(&(*slot)->verts);
    npg_release(slot);
}

/* Adds the mean distance of some of the queries to what the tree holds. */
static npg_status add_mean(double *sum, const npg_kdtree *tree, const float *queries, size_t count)
{
    float some[3 * LOOKED_AT], dist_sq[LOOKED_AT];
    uint32_t nearest[LOOKED_AT];
    size_t taken = npg_points_spread(some, NULL, LOOKED_AT, queries, NULL, count);
    NPG_TRY(npg_kdtree_nearest(tree, nearest, dist_sq, some, taken, 1, 1));
    for (size_t i = 0; i < taken; i++) *sum += sqrt((double)dist_sq[i]) / (double)taken;
    return NPG_OK;
}

static npg_status compare(double *dist_unit, const npg_likeness *likeness, const float *points, size_t count)
{
    npg_kdtree *tree;
    *dist_unit = 0;
    NPG_TRY(npg_kdtree_open(&tree, points, count));
    npg_status status = add_mean(dist_unit, tree, likeness->verts, likeness->vert_count);
    npg_kdtree_close(&tree);
    return status ? status : add_mean(dist_unit, likeness->tree, points, count);
}

npg_status npg_likeness_dist(double *dist_unit, const npg_likeness *likeness, const npg_frame *frame,
                             const npg_frame_box *box)
{
    float *points;
    *dist_unit = (double)INFINITY;
    NPG_TRY(npg_alloc_array(&points, NPG_FOR_RUN, KEPT, 3 * sizeof *points));
    size_t count = npg_spread_finite(points, KEPT, frame->pos_local, frame->point_count);
    npg_box_local_to_unit(box, points, points, count);
    npg_status status = count ? compare(dist_unit, likeness, points, count) : NPG_OK;
    npg_release(&points);
    return status;
}
