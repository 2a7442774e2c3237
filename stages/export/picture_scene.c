/* Scenes to draw: a mesh, or a cloud as small balls, with colours. */
#include "export/exporters/exporters_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "ingest/ingest.h"

enum { BALLS_MAX = 200000 }; /* points drawn at most: each is a mesh of 8 faces */

static bool is_finite(const float *p)
{
    return isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]);
}

/* A mesh, or a cloud as one without faces, unusable points left out. */
static npg_status read_any(npg_mesh **out, const char *path, npg_origin *origin)
{
    NPG_TRY(npg_read_shape(out, path, origin));
    npg_mesh *mesh = *out;
    size_t kept = 0;
    npg_status status = mesh->face_count ? npg_mesh_require_finite(mesh, path) : NPG_OK;
    for (size_t i = 0; i < mesh->vert_count && !mesh->face_count; i++) {
        if (!is_finite(mesh->vert_pos + 3 * i)) continue;
        memmove(mesh->vert_pos + 3 * kept, mesh->vert_pos + 3 * i, 3 * sizeof(float));
        if (mesh->vert_normals)
            memmove(mesh->vert_normals + 3 * kept, mesh->vert_normals + 3 * i, 3 * sizeof(float));
        if (mesh->vert_colours) memmove(mesh->vert_colours + 4 * kept, mesh->vert_colours + 4 * i, 4);
        kept++;
    }
    if (!mesh->face_count) mesh->vert_count = kept;
    if (status) npg_mesh_unref(out);
    return status;
}

npg_status npg_scene_measure(npg_bounds *reach, const char *path, npg_origin *origin, const double axes[9])
{
    npg_mesh *mesh = NULL;
    NPG_TRY(read_any(&mesh, path, origin));
    for (size_t v = 0; v < mesh->vert_count; v++)
        for (int axis = 0; axis < 3; axis++) {
            double along = 0;
            for (int k = 0; k < 3; k++)
                along += axes[3 * axis + k] * (double)mesh->vert_pos[3 * v + (size_t)k];
            reach->lo[axis] = fmin(reach->lo[axis], along);
            reach->hi[axis] = fmax(reach->hi[axis], along);
        }
    npg_mesh_unref(&mesh);
    return NPG_OK;
}

/* ---- colours ---- */

static void colour_vertex(float *colour, const npg_mesh *mesh, size_t v, int kind, const npg_mesh *identity,
                          const npg_bounds *bounds)
{
    static const float plain[3] = {0.80f, 0.78f, 0.74f};
    bool is_own = kind == NPG_PICTURE_VERTEX || (kind == NPG_PICTURE_AUTO && !mesh->face_count);
    for (size_t k = 0; k < 3; k++) {
        double extent = bounds->hi[k] - bounds->lo[k];
        colour[k] = plain[k];
        if (is_own && mesh->vert_colours) colour[k] = (float)mesh->vert_colours[4 * v + k] / 255;
        if (kind == NPG_PICTURE_NORMAL && mesh->vert_normals)
            colour[k] = 0.5f + 0.5f * mesh->vert_normals[3 * v + k];
        if (kind == NPG_PICTURE_IDENTITY && extent > 0)
            colour[k] =
                (float)(0.15 + 0.8 * ((double)identity->vert_pos[3 * v + k] - bounds->lo[k]) / extent);
    }
}

static npg_status open_colours(npg_scene *scene, const npg_mesh *mesh, int kind, const npg_mesh *first)
{
    const npg_mesh *identity = first && first->vert_count == mesh->vert_count ? first : mesh;
    npg_bounds bounds = npg_bounds_empty();
    npg_bounds_add_points(&bounds, identity->vert_pos, identity->vert_count);
    NPG_TRY(npg_alloc_array(&scene->colours, NPG_FOR_MESH, mesh->vert_count, 3 * sizeof(float)));
    for (size_t v = 0; v < mesh->vert_count; v++)
        colour_vertex(scene->colours + 3 * v, mesh, v, kind, identity, &bounds);
    return NPG_OK;
}

/* ---- clouds as balls ---- */

static void put_ball(npg_mesh *balls, size_t b, const float *middle, const float *normal, float radius)
{
    static const uint32_t octahedron[8][3] = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                              {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
    for (size_t c = 0; c < 6; c++) {
        float *p = balls->vert_pos + 3 * (6 * b + c), *n = balls->vert_normals + 3 * (6 * b + c);
        memcpy(p, middle, 3 * sizeof *p);
        p[c / 2] += c % 2 ? -radius : radius;
        if (normal)
            memcpy(n, normal, 3 * sizeof *n);
        else
            n[c / 2] = c % 2 ? -1.0f : 1.0f;
    }
    for (size_t f = 0; f < 8; f++)
        for (size_t k = 0; k < 3; k++)
            balls->faces[3 * (8 * b + f) + k] = (uint32_t)(6 * b) + octahedron[f][k];
}

/* Replace a cloud (its colours are known) by balls. */
static npg_status make_balls(npg_scene *scene, npg_mesh *cloud, double radius)
{
    float *point_colours = scene->colours;
    size_t total = cloud->vert_count, step = total / BALLS_MAX + 1, count = (total + step - 1) / step;
    npg_mesh *balls = NULL;
    scene->colours = NULL;
    npg_status status = npg_mesh_open(&balls, 6 * count, 8 * count);
    if (!status && !balls->vert_normals)
        status = npg_alloc_array(&balls->vert_normals, NPG_FOR_MESH, 6 * count, 3 * sizeof(float));
    if (!status) status = npg_alloc_array(&scene->colours, NPG_FOR_MESH, 6 * count, 3 * sizeof(float));
    for (size_t b = 0; b < count && !status; b++) {
        const float *middle = cloud->vert_pos + 3 * b * step;
        put_ball(balls, b, middle, cloud->vert_normals ? cloud->vert_normals + 3 * b * step : NULL,
                 (float)radius);
        for (size_t c = 0; c < 6; c++)
            memcpy(scene->colours + 3 * (6 * b + c), point_colours + 3 * b * step, 3 * sizeof(float));
    }
    npg_release(&point_colours);
    scene->shown = count;
    scene->total = total;
    scene->mesh = balls;
    scene->is_cloud = true;
    return status;
}

/* ---- scenes ---- */

npg_status npg_scene_open(npg_scene *scene, const char *path, npg_origin *origin, double ball_radius,
                          npg_picture_colour colour, const npg_mesh *first)
{
    npg_mesh *mesh = NULL;
    *scene = (npg_scene){0};
    NPG_TRY(read_any(&mesh, path, origin));
    bool faces = mesh->face_count;
    npg_status status = NPG_OK;
    if (!mesh->vert_count) status = npg_error(NPG_BAD_INPUT, "%s: nothing to draw", path);
    if (!status && faces && !mesh->vert_normals)
        status = npg_alloc_array(&mesh->vert_normals, NPG_FOR_MESH, mesh->vert_count, 3 * sizeof(float));
    if (!status && faces)
        npg_mesh_vertex_normals(mesh->vert_normals, mesh->vert_pos, mesh->vert_count, mesh->faces,
                                mesh->face_count);
    if (!status) status = open_colours(scene, mesh, colour, first);
    if (!status && faces)
        scene->mesh = npg_mesh_ref(mesh);
    else if (!status)
        status = make_balls(scene, mesh, ball_radius);
    npg_mesh_unref(&mesh);
    if (status) npg_scene_close(scene);
    return status;
}

void npg_scene_close(npg_scene *scene)
{
    npg_mesh_unref(&scene->mesh);
    npg_release(&scene->colours);
    *scene = (npg_scene){0};
}
