/* Shapes: points with true outward normals for tests, the same in every run. */
#ifndef TEST_SHAPES_H
#define TEST_SHAPES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

typedef struct shape_random {
    uint64_t state;
} shape_random;

/* 0 .. 1 */
static inline double shape_uniform(shape_random *r)
{
    r->state = r->state * 6364136223846793005u + 1442695040888963407u;
    return (double)(r->state >> 11) / 9007199254740992.0;
}

static inline double shape_gauss(shape_random *r)
{
    double sum = -6;
    for (int i = 0; i < 12; i++) sum += shape_uniform(r);
    return sum;
}

static inline void shape_put(float *out, double x, double y, double z)
{
    out[0] = (float)x;
    out[1] = (float)y;
    out[2] = (float)z;
}

static inline void shape_sphere(float *points, float *normals, size_t n, double radius, shape_random *r)
{
    for (size_t i = 0; i < n; i++) {
        double z = 2 * shape_uniform(r) - 1, phi = 6.283185307 * shape_uniform(r), s = sqrt(1 - z * z);
        shape_put(normals + 3 * i, s * cos(phi), s * sin(phi), z);
        shape_put(points + 3 * i, radius * s * cos(phi), radius * s * sin(phi), radius * z);
    }
}

/* Around the z axis; uniform by area. */
static inline void shape_torus(float *points, float *normals, size_t n, double big, double small,
                               shape_random *r)
{
    for (size_t i = 0; i < n;) {
        double u = 6.283185307 * shape_uniform(r), v = 6.283185307 * shape_uniform(r);
        if (shape_uniform(r) * (big + small) > big + small * cos(v)) continue;
        double ring = big + small * cos(v);
        shape_put(normals + 3 * i, cos(u) * cos(v), sin(u) * cos(v), sin(v));
        shape_put(points + 3 * i, cos(u) * ring, sin(u) * ring, small * sin(v));
        i++;
    }
}

/* A box with half sides a, b, c: with a small c a plate whose two sheets are near each other. */
static inline void shape_box(float *points, float *normals, size_t n, const double half[3], shape_random *r)
{
    double areas[3] = {half[1] * half[2], half[0] * half[2], half[0] * half[1]};
    double all = areas[0] + areas[1] + areas[2];
    for (size_t i = 0; i < n; i++) {
        double pick = shape_uniform(r) * all, p[3];
        int axis = pick < areas[0] ? 0 : pick < areas[0] + areas[1] ? 1 : 2;
        double side = shape_uniform(r) < 0.5 ? -1 : 1;
        for (int a = 0; a < 3; a++) p[a] = a == axis ? side * half[a] : half[a] * (2 * shape_uniform(r) - 1);
        shape_put(points + 3 * i, p[0], p[1], p[2]);
        shape_put(normals + 3 * i, axis == 0 ? side : 0, axis == 1 ? side : 0, axis == 2 ? side : 0);
    }
}

/* Two capped rods of radius 0.05 side by side on a ball: thin limbs near each other. */
static inline void shape_limbs(float *points, float *normals, size_t n, shape_random *r)
{
    size_t ball = n / 2;
    shape_sphere(points, normals, ball, 0.4, r);
    for (size_t i = ball; i < n; i++) {
        double side = i % 2 ? -0.09 : 0.09, phi = 6.283185307 * shape_uniform(r),
               along = shape_uniform(r) * 1.05;
        double reach = along > 1 ? sqrt(shape_uniform(r)) : 1, z = along > 1 ? -1.38 : -0.38 - along;
        shape_put(normals + 3 * i, along > 1 ? 0 : cos(phi), along > 1 ? 0 : sin(phi), along > 1 ? -1 : 0);
        shape_put(points + 3 * i, side + 0.05 * reach * cos(phi), 0.05 * reach * sin(phi), z);
    }
}

#endif
