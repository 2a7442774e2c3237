/* Camera: projection, its inverse, and rigid poses. */
#include "ingest/rig/rig_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"

#define ROTATION_OFF 1e-3 /* |R R' - 1| that rounding in a file with few digits explains */
#define RAY_STEPS    50   /* of the fixed point; lenses of rigs need about ten           */
#define RAY_OFF      0.05 /* pixels that a ray may miss its pixel by                     */

npg_status npg_camera_check(const npg_camera *c, const char *where)
{
    if (c->width < 1 || c->height < 1 || c->width > NPG_IMAGE_SIDE_MAX || c->height > NPG_IMAGE_SIDE_MAX)
        return npg_error(NPG_BAD_INPUT, "%s: width and height must be 1 to %d", where, NPG_IMAGE_SIDE_MAX);
    /* Less than a thousandth of a side is no lens, but a length in metres. */
    if (!(1e3 * c->fx > (double)c->width && 1e3 * c->fy > (double)c->height && c->fx < 1e6 && c->fy < 1e6))
        return npg_error(NPG_BAD_INPUT, "%s: fx %g and fy %g are no focal lengths in pixels", where, c->fx,
                         c->fy);
    bool is_in = c->cx > -(double)c->width && c->cx < 2 * (double)c->width && c->cy > -(double)c->height &&
                 c->cy < 2 * (double)c->height;
    if (!is_in)
        return npg_error(NPG_BAD_INPUT, "%s: cx %g and cy %g lie far outside of %zu x %zu pixels", where,
                         c->cx, c->cy, c->width, c->height);
    for (int i = 0; i < NPG_DISTORTIONS; i++)
        if (!(fabs(c->distortion[i]) < 1e3))
            return npg_error(NPG_BAD_INPUT, "%s: distortion %d is %g", where, i, c->distortion[i]);
    return NPG_OK;
}

/* Where a ray lands after the lens. */
static void distort(const double k[NPG_DISTORTIONS], double out[2], double *factor, const double ray[2])
{
    double x = ray[0], y = ray[1], r2 = x * x + y * y;
    *factor = (1 + r2 * (k[NPG_K1] + r2 * (k[NPG_K2] + r2 * k[NPG_K3]))) /
              (1 + r2 * (k[NPG_K4] + r2 * (k[NPG_K5] + r2 * k[NPG_K6])));
    out[0] = x * *factor + 2 * k[NPG_P1] * x * y + k[NPG_P2] * (r2 + 2 * x * x);
    out[1] = y * *factor + k[NPG_P1] * (r2 + 2 * y * y) + 2 * k[NPG_P2] * x * y;
}

bool npg_camera_project(const npg_camera *c, double pixel[2], const double point[3])
{
    double landed[2], factor;
    if (!(point[2] > 0)) return false;
    distort(c->distortion, landed, &factor, (const double[2]){point[0] / point[2], point[1] / point[2]});
    pixel[0] = c->fx * landed[0] + c->cx;
    pixel[1] = c->fy * landed[1] + c->cy;
    return isfinite(pixel[0]) && isfinite(pixel[1]);
}

bool npg_camera_ray(const npg_camera *c, double ray[2], const double pixel[2])
{
    const double aim[2] = {(pixel[0] - c->cx) / c->fx, (pixel[1] - c->cy) / c->fy};
    double landed[2], factor;
    ray[0] = aim[0];
    ray[1] = aim[1];
    for (int step = 0; step < RAY_STEPS; step++) {
        distort(c->distortion, landed, &factor, ray);
        double off[2] = {landed[0] - aim[0], landed[1] - aim[1]};
        if (!isfinite(factor) || fabs(factor) < 1e-6) return false;
        if (fabs(off[0]) * c->fx < 1e-9 && fabs(off[1]) * c->fy < 1e-9) return true;
        for (int a = 0; a < 2; a++) ray[a] -= off[a] / factor;
    }
    distort(c->distortion, landed, &factor, ray);
    return fabs(landed[0] - aim[0]) * c->fx < RAY_OFF && fabs(landed[1] - aim[1]) * c->fy < RAY_OFF;
}

/* ---- poses ---- */

void npg_pose_identity(double pose[12])
{
    for (int i = 0; i < 12; i++) pose[i] = i % 5 == 0;
}

void npg_pose_apply(double out[3], const double pose[12], const double p[3])
{
    for (size_t r = 0; r < 3; r++)
        out[r] = pose[4 * r] * p[0] + pose[4 * r + 1] * p[1] + pose[4 * r + 2] * p[2] + pose[4 * r + 3];
}

void npg_pose_combine(double out[12], const double a[12], const double b[12])
{
    for (size_t r = 0; r < 3; r++)
        for (size_t c = 0; c < 4; c++) {
            out[4 * r + c] = c == 3 ? a[4 * r + 3] : 0;
            for (size_t k = 0; k < 3; k++) out[4 * r + c] += a[4 * r + k] * b[4 * k + c];
        }
}

void npg_pose_invert(double out[12], const double pose[12])
{
    for (size_t r = 0; r < 3; r++) {
        out[4 * r + 3] = 0;
        for (size_t c = 0; c < 3; c++) {
            out[4 * r + c] = pose[4 * c + r];
            out[4 * r + 3] -= pose[4 * c + r] * pose[4 * c + 3];
        }
    }
}

/* Gram-Schmidt of the rows; the third is the product of the others, so a mirror would be lost here. */
static void make_exact(double pose[12])
{
    double rows[3][3];
    for (size_t r = 0; r < 3; r++) memcpy(rows[r], pose + 4 * r, sizeof rows[r]);
    npg_vec3_make_unit(rows[0]);
    double along = npg_vec3_dot(rows[0], rows[1]);
    for (int a = 0; a < 3; a++) rows[1][a] -= along * rows[0][a];
    npg_vec3_make_unit(rows[1]);
    npg_vec3_cross(rows[2], rows[0], rows[1]);
    for (size_t r = 0; r < 3; r++) memcpy(pose + 4 * r, rows[r], sizeof rows[r]);
}

npg_status npg_pose_check(double pose[12], const char *where)
{
    double off = 0, third[3];
    for (size_t i = 0; i < 12; i++)
        if (!isfinite(pose[i])) return npg_error(NPG_BAD_INPUT, "%s: the pose is not finite", where);
    for (size_t r = 0; r < 3; r++)
        for (size_t c = 0; c < 3; c++)
            off = fmax(off, fabs(npg_vec3_dot(pose + 4 * r, pose + 4 * c) - (r == c)));
    if (off > ROTATION_OFF)
        return npg_error(NPG_BAD_INPUT,
                         "%s: the pose is no rotation: R times its transpose is off from 1 by %.2g", where,
                         off);
    npg_vec3_cross(third, pose, pose + 4);
    if (npg_vec3_dot(third, pose + 8) < 0)
        return npg_error(NPG_BAD_INPUT, "%s: the pose is no rotation but a mirror (determinant -1)", where);
    make_exact(pose);
    return NPG_OK;
}
