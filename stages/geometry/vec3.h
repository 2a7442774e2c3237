/* vec3: three numbers as a vector, and the cross product and normal of a face.
 *
 * Sums go from x to z, differences are taken in double: another order would change the last digit, and with
 * it the bytes of a result.  Names with an f compute in float, for data that is float and large. */
#ifndef NPG_VEC3_H
#define NPG_VEC3_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

static inline double npg_vec3_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline float npg_vec3_dotf(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double npg_vec3_length(const double a[3])
{
    return sqrt(npg_vec3_dot(a, a));
}

static inline float npg_vec3_lengthf(const float a[3])
{
    return sqrtf(npg_vec3_dotf(a, a));
}

static inline bool npg_vec3_is_finitef(const float a[3])
{
    return isfinite(a[0]) && isfinite(a[1]) && isfinite(a[2]);
}

/* out = a - b; out may be a or b. */
static inline void npg_vec3_sub(double out[3], const double a[3], const double b[3])
{
    for (int i = 0; i < 3; i++) out[i] = a[i] - b[i];
}

/* out = to - from, of points that are float. */
static inline void npg_vec3_between(double out[3], const float from[3], const float to[3])
{
    for (int i = 0; i < 3; i++) out[i] = (double)to[i] - (double)from[i];
}

/* Distance of two points that are float. */
static inline double npg_vec3_distance(const float a[3], const float b[3])
{
    double d[3];
    npg_vec3_between(d, a, b);
    return npg_vec3_length(d);
}

/* out = a x b; out is neither of them. */
static inline void npg_vec3_cross(double out[3], const double a[3], const double b[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Scale to length 1; false, and nothing is changed, where the length is 0 (or no number). */
static inline bool npg_vec3_make_unit(double v[3])
{
    double length = npg_vec3_length(v);
    for (int i = 0; i < 3 && length > 0; i++) v[i] /= length;
    return length > 0;
}

static inline bool npg_vec3_make_unitf(float v[3])
{
    float length = npg_vec3_lengthf(v);
    /* the squares of so small ones leave the range of float: normals by area in a mesh of 1e-9 units */
    if (length < 1e-18f) length = (float)npg_vec3_distance((const float[3]){0}, v);
    for (int i = 0; i < 3 && length > 0; i++) v[i] /= length;
    return length > 0;
}

/* Cross product of a face's edges from its first corner: along its normal, twice its area long. */
static inline void npg_face_cross(double out[3], const float *vert_pos, const uint32_t face[3])
{
    const float *first = vert_pos + 3 * (size_t)face[0];
    double u[3], v[3];
    npg_vec3_between(u, first, vert_pos + 3 * (size_t)face[1]);
    npg_vec3_between(v, first, vert_pos + 3 * (size_t)face[2]);
    npg_vec3_cross(out, u, v);
}

/* Unit normal, 0 for a face without area; returns the area. */
static inline double npg_face_normal(double normal[3], const float *vert_pos, const uint32_t face[3])
{
    npg_face_cross(normal, vert_pos, face);
    double length = npg_vec3_length(normal);
    for (int i = 0; i < 3; i++) normal[i] = length > 0 ? normal[i] / length : 0;
    return length / 2;
}

#endif
