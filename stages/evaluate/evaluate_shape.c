/* Shape: flipped and stretched faces and the change of edges of a deformed mesh against its reference. */
#include <math.h>

#include "evaluate/evaluate_shape.h"
#include "geometry/mesh_tools.h"
#include "geometry/vec3.h"

/* A face is with its neighbourhood above this cosine and against it below minus that; between, as across a
 * crease, it counts as neither.  Set by trial. */
#define FLIP_COSINE 0.2
#define STRETCH     10.0 /* times the area, or a tenth of it: the measure of bad faces in neupig eval */

struct npg_shape {
    const npg_mesh *reference; /* loan */
    uint32_t (*edges)[2];      /* E x 2; owned */
    size_t edge_count;
    npg_arena arena;
    double *areas;     /* F, of the reference                                     */
    double *cosines;   /* F, each face against its neighbourhood in the reference */
    double *normals;   /* F x 3 scratch                                           */
    double *vert_sums; /* V x 3 scratch                                           */
};

/* Sums of the faces' normals around each vertex, weighted by reference area. */
static void sum_normals(const npg_shape *shape)
{
    const npg_mesh *mesh = shape->reference;
    for (size_t i = 0; i < 3 * mesh->vert_count; i++) shape->vert_sums[i] = 0;
    for (size_t f = 0; f < mesh->face_count; f++)
        for (size_t k = 0; k < 3; k++)
            for (size_t a = 0; a < 3; a++)
                shape->vert_sums[3 * (size_t)mesh->faces[3 * f + k] + a] +=
                    shape->areas[f] * shape->normals[3 * f + a];
}

/* Cosine between a face's normal and the mean normal of the faces that share a vertex with it; 1 for a face
 * that stands alone, 0 where one of the two has no direction. */
static double cosine_of(const npg_shape *shape, size_t f)
{
    const uint32_t *face = shape->reference->faces + 3 * f;
    const double *normal = shape->normals + 3 * f;
    double sum[3];
    for (int a = 0; a < 3; a++) {
        sum[a] = -3 * shape->areas[f] * normal[a]; /* the face itself is in the sum of each of its corners */
        for (int k = 0; k < 3; k++) sum[a] += shape->vert_sums[3 * (size_t)face[k] + (size_t)a];
    }
    double length = npg_vec3_length(sum);
    return length > 1e-9 * shape->areas[f] ? npg_vec3_dot(sum, normal) / length : 0;
}

static npg_status measure_reference(npg_shape *shape)
{
    const npg_mesh *mesh = shape->reference;
    size_t v = mesh->vert_count, f = mesh->face_count;
    shape->arena.purpose = NPG_FOR_MESH;
    shape->areas = npg_arena_take(&shape->arena, f, sizeof *shape->areas);
    shape->cosines = npg_arena_take(&shape->arena, f, sizeof *shape->cosines);
    shape->normals = npg_arena_take(&shape->arena, f, 3 * sizeof *shape->normals);
    shape->vert_sums = npg_arena_take(&shape->arena, v, 3 * sizeof *shape->vert_sums);
    NPG_TRY(npg_arena_status(&shape->arena));
    NPG_TRY(npg_mesh_edges(&shape->edges, &shape->edge_count, mesh->faces, f));
    for (size_t i = 0; i < f; i++)
        shape->areas[i] = npg_face_normal(shape->normals + 3 * i, mesh->vert_pos, mesh->faces + 3 * i);
    sum_normals(shape);
    for (size_t i = 0; i < f; i++) shape->cosines[i] = cosine_of(shape, i);
    return NPG_OK;
}

npg_status npg_shape_open(npg_shape **out, const npg_mesh *reference)
{
    npg_shape *shape;
    NPG_TRY(npg_alloc(&shape, NPG_FOR_MESH, sizeof *shape));
    shape->reference = reference;
    npg_status status = measure_reference(shape);
    if (status) npg_shape_close(&shape);
    *out = shape;
    return status;
}

void npg_shape_close(npg_shape **slot)
{
    if (!*slot) return;
    npg_release(&(*slot)->edges);
    npg_arena_release(&(*slot)->arena);
    npg_release(slot);
}

static double length_of(const float *vert_pos, const uint32_t edge[2])
{
    return npg_vec3_distance(vert_pos + 3 * (size_t)edge[0], vert_pos + 3 * (size_t)edge[1]);
}

static double edge_change(const npg_shape *shape, const float *vert_unit)
{
    double sum = 0;
    size_t count = 0;
    for (size_t e = 0; e < shape->edge_count; e++) {
        double before = length_of(shape->reference->vert_pos, shape->edges[e]);
        if (!(before > 0)) continue;
        sum += fabs(length_of(vert_unit, shape->edges[e]) / before - 1);
        count++;
    }
    return count ? sum / (double)count : 0;
}

void npg_shape_measure(const npg_shape *shape, npg_figures *figures, const float *vert_unit)
{
    const npg_mesh *mesh = shape->reference;
    size_t flipped = 0, stretched = 0;
    for (size_t f = 0; f < mesh->face_count; f++) {
        double area = npg_face_normal(shape->normals + 3 * f, vert_unit, mesh->faces + 3 * f);
        stretched += area > STRETCH * shape->areas[f] || STRETCH * area < shape->areas[f];
    }
    sum_normals(shape);
    for (size_t f = 0; f < mesh->face_count; f++)
        flipped += shape->cosines[f] > FLIP_COSINE && cosine_of(shape, f) < -FLIP_COSINE;
    double face_count = mesh->face_count ? (double)mesh->face_count : 1;
    figures->flipped_share = (double)flipped / face_count;
    figures->stretched_share = (double)stretched / face_count;
    figures->edge_change = edge_change(shape, vert_unit);
}
