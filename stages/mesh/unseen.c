/* Unseen: the mask of the reference, and its largest patch. */
#include "mesh/mesh_internal.h"

#include <stdio.h>

#include "geometry/geometry.h"
#include "track/track.h"

npg_status npg_mesh_mark_unseen(npg_mesh *mesh, const float *points, size_t point_count, double dist_max)
{
    float *dist;
    size_t v = mesh->vert_count;
    npg_release(&mesh->vert_unseen);
    NPG_TRY(npg_alloc(&mesh->vert_unseen, NPG_FOR_MESH, v));
    NPG_TRY(npg_alloc_array(&dist, NPG_FOR_MESH, v, sizeof *dist));
    npg_status status = npg_points_dist(dist, mesh->vert_pos, mesh->vert_count, points, point_count);
    for (size_t i = 0; i < v && !status; i++) mesh->vert_unseen[i] = (double)dist[i] > dist_max;
    npg_release(&dist);
    return status;
}

npg_status npg_unseen_excuse(npg_mesh *mesh, const float *sensors, size_t sensor_count, double offset)
{
    size_t v = mesh->vert_count;
    npg_surface *surface;
    npg_visible visible = {0};
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    NPG_TRY(npg_surface_open(&surface, mesh->vert_pos, v, mesh->faces, mesh->face_count));
    npg_visible_open(&visible, &scratch, v);
    uint8_t *is_seen = npg_arena_take(&scratch, v, 1);
    npg_status status = npg_arena_status(&scratch);
    if (!status)
        status = npg_visible_find(&visible, is_seen, surface, sensors, sensor_count, mesh->vert_pos, NULL,
                                  mesh->vert_normals, v, offset);
    for (size_t i = 0; i < v && !status; i++) mesh->vert_unseen[i] &= is_seen[i];
    npg_arena_release(&scratch);
    npg_surface_close(&surface);
    return status;
}

npg_status npg_unseen_measure(double *share, npg_patch *largest, const npg_mesh *mesh)
{
    double *areas, marked = 0, whole = 0;
    NPG_TRY(npg_alloc_array(&areas, NPG_FOR_MESH, mesh->vert_count, sizeof *areas));
    npg_vertex_areas(areas, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count);
    for (size_t i = 0; i < mesh->vert_count; i++) {
        whole += areas[i];
        if (mesh->vert_unseen[i]) marked += areas[i];
    }
    *share = whole > 0 ? marked / whole : 0;
    npg_status status = npg_patch_largest(largest, mesh->vert_unseen, mesh->vert_pos, areas, mesh);
    npg_release(&areas);
    return status;
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
