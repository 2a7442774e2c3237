/* Closest point of one triangle: by the region of the plane in which the foot of the perpendicular lies.
 * Based on: C. Ericson, Real-Time Collision Detection, 2005, section 5.1.5. */
#include <math.h>
#include <stdbool.h>

#include "geometry/geometry.h"

/* Squared distance from the origin to the segment a..b; *t is where on it. */
static double segment(double *t, const double a[3], const double b[3])
{
    double ab[3], at[3];
    npg_vec3_sub(ab, b, a);
    double length_sq = npg_vec3_dot(ab, ab), along = -npg_vec3_dot(a, ab);
    *t = along <= 0 ? 0 : along >= length_sq ? 1 : along / length_sq;
    for (int i = 0; i < 3; i++) at[i] = a[i] + *t * ab[i];
    return npg_vec3_dot(at, at);
}

/* The best of the edges k -> k + 1 that are wanted. */
static double edges(double weights[3], double corner[3][3], const bool is_wanted[3])
{
    double best = INFINITY;
    for (int k = 0; k < 3; k++) {
        if (!is_wanted[k]) continue;
        double t, dist_sq = segment(&t, corner[k], corner[(k + 1) % 3]);
        if (!(dist_sq < best)) continue;
        best = dist_sq;
        weights[k] = 1 - t;
        weights[(k + 1) % 3] = t;
        weights[(k + 2) % 3] = 0;
    }
    return best;
}

/* The triangle's corners are relative to the query.  The foot of the perpendicular has weights by areas:
 * inside when none is negative; else the closest point is on an edge across from a corner whose weight is.
 * Of a degenerate triangle it is on any. */
static double triangle(double weights[3], double corner[3][3])
{
    double u[3], v[3], n[3];
    npg_vec3_sub(u, corner[1], corner[0]);
    npg_vec3_sub(v, corner[2], corner[0]);
    npg_vec3_cross(n, u, v);
    double n_sq = npg_vec3_dot(n, n), uu = npg_vec3_dot(u, u), vv = npg_vec3_dot(v, v),
           uv = npg_vec3_dot(u, v);
    /* Sides within 1e-12 of parallel: doubles don't give a plane. */
    if (!(n_sq > 1e-24 * uu * vv)) return edges(weights, corner, (const bool[3]){true, true, true});
    double du = -npg_vec3_dot(corner[0], u), dv = -npg_vec3_dot(corner[0], v);
    double b = (vv * du - uv * dv) / n_sq, c = (uu * dv - uv * du) / n_sq;
    const bool is_beyond[3] = {c < 0, 1 < b + c, b < 0}; /* the edges 0-1, 1-2, 2-0 */
    if (is_beyond[0] || is_beyond[1] || is_beyond[2]) return edges(weights, corner, is_beyond);
    double height = npg_vec3_dot(n, corner[0]);
    weights[0] = 1 - b - c;
    weights[1] = b;
    weights[2] = c;
    return height * height / n_sq;
}

void npg_face_closest(npg_surface_hit *hit, const float *vert_pos, const uint32_t *faces, uint32_t face,
                      const float p[3])
{
    double corner[3][3], weights[3] = {1, 0, 0};
    for (int k = 0; k < 3; k++)
        for (int a = 0; a < 3; a++)
            corner[k][a] =
                (double)vert_pos[3 * (size_t)faces[3 * (size_t)face + (size_t)k] + (size_t)a] - (double)p[a];
    double dist_sq = triangle(weights, corner);
    *hit = (npg_surface_hit){face, {(float)weights[0], (float)weights[1], (float)weights[2]}, (float)dist_sq};
}
