/* Ball mesh: a reference for tests of the fit - a ball, a little flattened - and where it is in frame t. */
#ifndef TEST_BALL_MESH_H
#define TEST_BALL_MESH_H

#include <math.h>

#include "geometry/geometry.h"

static inline void put_face(npg_mesh *mesh, size_t *count, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t *face = mesh->faces + 3 * (*count)++;
    face[0] = a, face[1] = b, face[2] = c;
}

static inline void fill_ball_faces(npg_mesh *mesh, uint32_t rings, uint32_t spokes)
{
    size_t count = 0;
    uint32_t top = rings * spokes, bottom = top + 1, last = (rings - 1) * spokes;
    for (uint32_t s = 0; s < spokes; s++) {
        uint32_t next = (s + 1) % spokes;
        put_face(mesh, &count, top, s, next);
        put_face(mesh, &count, bottom, last + next, last + s);
        for (uint32_t r = 0; r + 1 < rings; r++) {
            put_face(mesh, &count, r * spokes + s, (r + 1) * spokes + s, r * spokes + next);
            put_face(mesh, &count, r * spokes + next, (r + 1) * spokes + s, (r + 1) * spokes + next);
        }
    }
    assert_int_equal(count, mesh->face_count);
}

/* rings x spokes + 2 vertices, with normals. */
static inline npg_mesh *ball_mesh(uint32_t rings, uint32_t spokes)
{
    npg_mesh *mesh;
    size_t count = (size_t)rings * spokes + 2;
    assert_int_equal(npg_mesh_open(&mesh, count, 2 * (size_t)spokes * rings), 0);
    assert_int_equal(npg_alloc_array(&mesh->vert_normals, NPG_FOR_MESH, count, 3 * sizeof(float)), 0);
    for (size_t v = 0; v < count; v++) {
        double polar = v >= count - 2 ? (v == count - 2 ? 0 : M_PI)
                                      : M_PI * (double)(v / spokes + 1) / (double)(rings + 1);
        double turn = 2 * M_PI * (double)(v % spokes) / (double)spokes;
        mesh->vert_pos[3 * v] = (float)(0.5 * sin(polar) * cos(turn));
        mesh->vert_pos[3 * v + 1] = (float)(0.4 * sin(polar) * sin(turn));
        mesh->vert_pos[3 * v + 2] = (float)(0.5 * cos(polar));
    }
    fill_ball_faces(mesh, rings, spokes);
    npg_mesh_vertex_normals(mesh->vert_normals, mesh->vert_pos, count, mesh->faces, mesh->face_count);
    return mesh;
}

/* Bent and moved, the more the later. */
static inline void pose_ball(float *out, const float *rest, size_t count, double t)
{
    for (size_t i = 0; i < count; i++) {
        double x = (double)rest[3 * i], y = (double)rest[3 * i + 1], z = (double)rest[3 * i + 2];
        out[3 * i] = (float)(x + 0.03 * t + 0.05 * t * z * z);
        out[3 * i + 1] = (float)(y - 0.02 * t);
        out[3 * i + 2] = (float)(z + 0.01 * t * x);
    }
}

#endif
