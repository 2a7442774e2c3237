/* Contact: pairs of points that face each other. */
#include "mesh/contact.h"

#include <math.h>
#include <string.h>

#include "geometry/kdtree.h"
#include "geometry/mesh_tools.h"

#define POINTS_MOST 5000
#define NEIGHBOURS  24
#define AGAINST     (-0.3f) /* cosine of two normals that face each other */
#define ACROSS      0.5f    /* cosine of a normal and the way across the gap */

bool npg_points_face(const float *p, const float *n, const float *q, const float *m)
{
    float d[3], along_n = 0, along_m = 0, cosine = 0, length = 0;
    for (int a = 0; a < 3; a++) {
        d[a] = q[a] - p[a];
        length += d[a] * d[a];
        along_n += d[a] * n[a];
        along_m += d[a] * m[a];
        cosine += n[a] * m[a];
    }
    length = sqrtf(length);
    return cosine < AGAINST && along_n > ACROSS * length && along_m < -ACROSS * length;
}

/* How many points face one of their neighbours. */
static size_t count_facing(const float *p, const float *n, const uint32_t *near, size_t count)
{
    size_t facing = 0;
    for (size_t i = 0; i < count; i++) {
        size_t k = 0;
        while (k < NEIGHBOURS) {
            size_t j = near[NEIGHBOURS * i + k];
            if (j < count && npg_points_face(p + 3 * i, n + 3 * i, p + 3 * j, n + 3 * j)) break;
            k++;
        }
        facing += k < NEIGHBOURS;
    }
    return facing;
}

npg_status npg_cloud_contact(double *share, const float *points, const float *normals, size_t point_count)
{
    npg_arena scratch = {.purpose = NPG_FOR_QUERY};
    npg_neighbours near;
    size_t count = point_count < POINTS_MOST ? point_count : POINTS_MOST;
    *share = 0;
    NPG_REQUIRE(count);
    float *p = npg_arena_take(&scratch, count, 3 * sizeof *p);
    float *n = npg_arena_take(&scratch, count, 3 * sizeof *n);
    npg_status status = npg_arena_status(&scratch);
    if (!status) npg_points_spread(p, n, count, points, normals, point_count);
    if (!status) status = npg_neighbours_take(&near, &scratch, p, count, p, count, NEIGHBOURS);
    if (!status) *share = (double)count_facing(p, n, near.index, count) / (double)count;
    npg_arena_release(&scratch);
    return status;
}
