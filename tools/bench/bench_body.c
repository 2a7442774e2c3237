/* Bench body: an ellipsoid that bends. */
#include "tools/bench/bench_body.h"

#include <math.h>

#include "geometry/geometry.h"

/* In unit coordinates; three different ones, so that no two directions of the search trees are alike. */
static const double axes[3] = {0.3, 0.4, 0.9};

static void place(double out[3], double normal[3], double polar, double around)
{
    double unit[3] = {sin(polar) * cos(around), sin(polar) * sin(around), cos(polar)};
    for (int i = 0; i < 3; i++) out[i] = axes[i] * unit[i];
    for (int i = 0; i < 3; i++) normal[i] = unit[i] / axes[i];
    npg_vec3_make_unit(normal);
}

/* Rings of `side` vertices from pole to pole, the poles left open by half a ring. */
static npg_status make_mesh(npg_mesh **out, size_t side)
{
    npg_mesh *mesh;
    NPG_TRY(npg_mesh_open(&mesh, side * side, 2 * side * (side - 1)));
    npg_status status = npg_alloc_array(&mesh->vert_normals, NPG_FOR_MESH, side * side, 3 * sizeof(float));
    for (size_t v = 0; v < side * side && !status; v++) {
        double at[3], normal[3];
        place(at, normal, M_PI * ((double)(v / side) + 0.5) / (double)side,
              2 * M_PI * (double)(v % side) / (double)side);
        for (size_t i = 0; i < 3; i++) mesh->vert_pos[3 * v + i] = (float)at[i];
        for (size_t i = 0; i < 3; i++) mesh->vert_normals[3 * v + i] = (float)normal[i];
    }
    for (size_t q = 0; q < side * (side - 1) && !status; q++) {
        uint32_t a = (uint32_t)q, b = (uint32_t)(q / side * side + (q + 1) % side), below = (uint32_t)side;
        const uint32_t two[6] = {a, a + below, b, b, a + below, b + below};
        for (int i = 0; i < 6; i++) mesh->faces[6 * q + (size_t)i] = two[i];
    }
    if (status) npg_mesh_unref(&mesh);
    *out = mesh;
    return status;
}

/* Bend along z by an angle that grows with it. */
static void pose(float out[3], const double rest[3], double bend)
{
    double angle = bend * rest[2];
    out[0] = (float)(cos(angle) * rest[0] + 0.3 * bend * rest[2] * rest[2]);
    out[1] = (float)rest[1];
    out[2] = (float)(rest[2] - sin(angle) * rest[0]);
}

/* The points of frame t, on a spiral that is even over the sphere and begins elsewhere in each frame. */
static npg_status make_points(float **out, size_t point_count, size_t t, size_t frame_count)
{
    double bend = frame_count > 1 ? (double)t / (double)(frame_count - 1) - 0.5 : 0;
    NPG_TRY(npg_alloc_array(out, NPG_FOR_FRAMES, point_count, 3 * sizeof(float)));
    for (size_t i = 0; i < point_count; i++) {
        double at[3], normal[3], share = ((double)i + 0.5) / (double)point_count;
        place(at, normal, acos(1 - 2 * share),
              M_PI * (1 + sqrt(5)) /* 2 pi times the golden ratio */ * ((double)i + (double)t));
        pose(*out + 3 * i, at, bend);
    }
    return NPG_OK;
}

npg_status npg_bench_body_open(npg_bench_body *body, size_t vert_count, size_t point_count,
                               size_t frame_count)
{
    size_t side = (size_t)ceil(sqrt((double)vert_count));
    *body = (npg_bench_body){.frame_count = frame_count, .point_count = point_count};
    npg_status status = npg_alloc_array(&body->points, NPG_FOR_FRAMES, frame_count, sizeof *body->points);
    if (!status) status = make_mesh(&body->mesh, side < 4 ? 4 : side);
    for (size_t t = 0; t < frame_count && !status; t++)
        status = make_points(&body->points[t], point_count, t, frame_count);
    if (status) npg_bench_body_close(body);
    return status;
}

void npg_bench_body_close(npg_bench_body *body)
{
    for (size_t t = 0; body->points && t < body->frame_count; t++) npg_release(&body->points[t]);
    npg_release(&body->points);
    npg_mesh_unref(&body->mesh);
}
