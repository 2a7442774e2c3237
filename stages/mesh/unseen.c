/* Unseen: the mask of the reference, and its largest patch. */
#include "mesh/unseen.h"

#include <stdio.h>

#include "geometry/mesh_tools.h"
#include "mesh/mesh_clean.h"

static npg_status find_largest(npg_patch *largest, const npg_mesh *mesh)
{
    double *areas;
    NPG_TRY(npg_alloc_array(&areas, NPG_FOR_MESH, mesh->vert_count, sizeof *areas));
    npg_vertex_areas(areas, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count);
    npg_status status = npg_patch_largest(largest, mesh->vert_unseen, mesh->vert_pos, areas, mesh);
    npg_release(&areas);
    return status;
}

npg_status npg_mesh_mark_unseen(npg_mesh *mesh, npg_patch *largest, const float *points, size_t point_count,
                                double dist_max)
{
    float *dist;
    size_t v = mesh->vert_count;
    npg_release(&mesh->vert_unseen);
    NPG_TRY(npg_alloc(&mesh->vert_unseen, NPG_FOR_MESH, v));
    NPG_TRY(npg_alloc_array(&dist, NPG_FOR_MESH, v, sizeof *dist));
    npg_status status = npg_mesh_point_dist(dist, mesh, points, point_count);
    for (size_t i = 0; i < v && !status; i++) mesh->vert_unseen[i] = (double)dist[i] > dist_max;
    npg_release(&dist);
    return status ? status : find_largest(largest, mesh);
}

json_t *npg_unseen_place(const npg_patch *largest, const npg_frame_box *box, char *text, size_t size)
{
    double at[3], radius = largest->radius / box->scale;
    text[0] = '\0';
    if (!(largest->share > 0)) return json_null();
    npg_box_unit_to_world(box, at, largest->at, 1);
    snprintf(text, size, ", the largest part within %.3g of (%.4g, %.4g, %.4g)", radius, at[0], at[1], at[2]);
    return json_pack("{sf s[fff] sf}", "share", largest->share, "at", at[0], at[1], at[2], "radius", radius);
}
