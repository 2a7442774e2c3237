/* Densify: which points are of thin parts, their neighbours, and what lies between. */
#include "mesh/mesh_internal.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "pipeline/memory.h"
#include "pipeline/order.h"

/* By trial. */
#define NEAR      48    /* points among which another side is looked for ...                    */
#define ON_CIRCLE 0.7F  /* of one normal, and the other reflected halfway: 1 where both lie on a circle */
#define STEEP     0.75F /* cosine of a normal and the edge: beyond, the edge is no surface */
#define PAIRS     5     /* neighbours on the same side, of three times as many nearest points */

/* Whether one of the near points is of another side, with the body in between. */
static bool is_thin(const float *points, const float *normals, size_t i, const uint32_t *near,
                    const float *dist_sq, float far_sq)
{
    const float *p = points + 3 * i, *n = normals + 3 * i;
    for (size_t k = 0; k < NEAR && dist_sq[k] < far_sq; k++) {
        const float *q = points + 3 * (size_t)near[k], *m = normals + 3 * (size_t)near[k];
        float d[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
        if (npg_vec3_dotf(n, m) < -NPG_SAME_SIDE && npg_vec3_dotf(d, n) < 0 && npg_vec3_dotf(d, m) > 0)
            return true;
    }
    return false;
}

/* Whether the surface goes from one point to the other. */
static bool is_edge(const float *points, const float *normals, size_t i, size_t j)
{
    const float *n = normals + 3 * i, *m = normals + 3 * j;
    float d[3], cosine = npg_vec3_dotf(n, m);
    for (size_t a = 0; a < 3; a++) d[a] = points[3 * j + a] - points[3 * i + a];
    float length_sq = npg_vec3_dotf(d, d), along = npg_vec3_dotf(n, d);
    if (!(length_sq > 0) || cosine < NPG_SAME_SIDE) return false;
    float reflected = cosine - 2 * along * npg_vec3_dotf(m, d) / length_sq;
    return reflected >= ON_CIRCLE && fabsf(along) <= STEEP * sqrtf(length_sq);
}

/* Edges (sorted, each once) from points of thin parts to their neighbours; room for PAIRS a point. */
static size_t find_edges(uint32_t (*edges)[2], const float *points, const float *normals, size_t count,
                         const uint32_t *near, const float *dist_sq, double spacing)
{
    size_t found = 0, kept = 0;
    float far_sq = (float)(NPG_GAP * NPG_GAP * spacing * spacing);
    for (size_t i = 0; i < count; i++) {
        const uint32_t *row = near + NEAR * i;
        if (!is_thin(points, normals, i, row, dist_sq + NEAR * i, far_sq)) continue;
        size_t last = found + PAIRS;
        for (size_t k = 0; k < 3 * PAIRS && row[k] < count && found < last; k++) {
            if (row[k] == i || !is_edge(points, normals, i, row[k])) continue;
            edges[found][0] = (uint32_t)i < row[k] ? (uint32_t)i : row[k];
            edges[found++][1] = (uint32_t)i < row[k] ? row[k] : (uint32_t)i;
        }
    }
    qsort(edges, found, sizeof *edges, npg_order_pair);
    for (size_t e = 0; e < found; e++) {
        if (kept && !npg_order_pair(edges[e], edges[kept - 1])) continue;
        memmove(edges[kept++], edges[e], sizeof *edges);
    }
    return kept;
}

static void add_middle(float *point, float *normal, const float *points, const float *normals,
                       const uint32_t edge[2])
{
    const float *p = points + 3 * (size_t)edge[0], *q = points + 3 * (size_t)edge[1];
    const float *n = normals + 3 * (size_t)edge[0], *m = normals + 3 * (size_t)edge[1];
    float d[3];
    for (int a = 0; a < 3; a++) d[a] = q[a] - p[a];
    float at_p = npg_vec3_dotf(d, n), at_q = npg_vec3_dotf(d, m);
    for (int a = 0; a < 3; a++) {
        point[a] = 0.5F * (p[a] + q[a]) + 0.125F * (at_q * m[a] - at_p * n[a]);
        normal[a] = n[a] + m[a];
    }
    npg_vec3_make_unitf(normal);
}

/* The given points, and those halfway along the edges. */
static npg_status add_middles(float **dense_points, float **dense_normals, const float *points,
                              const float *normals, size_t count, const uint32_t (*edges)[2],
                              size_t edge_count)
{
    size_t all = count + edge_count;
    NPG_TRY(npg_alloc_array(dense_points, NPG_FOR_MESH, all, 3 * sizeof(float)));
    NPG_TRY(npg_alloc_array(dense_normals, NPG_FOR_MESH, all, 3 * sizeof(float)));
    memcpy(*dense_points, points, 3 * count * sizeof(float));
    memcpy(*dense_normals, normals, 3 * count * sizeof(float));
    for (size_t e = 0; e < edge_count; e++)
        add_middle(*dense_points + 3 * (count + e), *dense_normals + 3 * (count + e), points, normals,
                   edges[e]);
    return NPG_OK;
}

npg_status npg_cloud_densify(float **dense_points, float **dense_normals, size_t *dense_count,
                             const float *points, const float *normals, size_t count, double spacing)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    npg_neighbours near;
    size_t edge_count = 0;
    *dense_points = *dense_normals = NULL;
    uint32_t(*edges)[2] = npg_arena_take(&scratch, count, PAIRS * sizeof *edges);
    npg_status status = npg_neighbours_take(&near, &scratch, points, count, points, count, NEAR);
    if (!status) edge_count = find_edges(edges, points, normals, count, near.index, near.dist_sq, spacing);
    if (!status)
        status = add_middles(dense_points, dense_normals, points, normals, count, (const uint32_t(*)[2])edges,
                             edge_count);
    *dense_count = count + edge_count;
    if (status) {
        npg_release(dense_points);
        npg_release(dense_normals);
    }
    npg_arena_release(&scratch);
    return status;
}
