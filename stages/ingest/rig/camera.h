/* Camera: pinhole with OpenCV's lens distortion.  Camera axes: x right, y down, z ahead; pixel (0, 0) is the
 * centre of the upper left pixel.
 *
 *     x = X / Z, y = Y / Z, r2 = x x + y y
 *     s = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
 *     u = fx (x s + 2 p1 x y + p2 (r2 + 2 x x)) + cx
 *     v = fy (y s + p1 (r2 + 2 y y) + 2 p2 x y) + cy
 *
 * Poses are 3 x 4, row-major, [R | t]: p' = R p + t. */
#ifndef NPG_CAMERA_H
#define NPG_CAMERA_H

#include <stdbool.h>

#include "pipeline/status.h"

enum { NPG_K1, NPG_K2, NPG_P1, NPG_P2, NPG_K3, NPG_K4, NPG_K5, NPG_K6, NPG_DISTORTIONS }; /* OpenCV's order */

typedef struct npg_camera {
    size_t width, height;  /* of the images that the intrinsics are of, pixels */
    double fx, fy, cx, cy; /* pixels */
    double distortion[NPG_DISTORTIONS];
} npg_camera;

/* NPG_BAD_INPUT when sizes or focal lengths are none that a camera has; `where` begins the text. */
npg_status npg_camera_check(const npg_camera *camera, const char *where);

/* Pixel that a point of the camera's space falls on; false where it is not in front of the camera. */
bool npg_camera_project(const npg_camera *camera, double pixel[2], const double point[3]);

/* The ray of a pixel as (x, y) = (X / Z, Y / Z); false where the distortion can't be undone there. */
bool npg_camera_ray(const npg_camera *camera, double ray[2], const double pixel[2]);

/* ---- poses ---- */

void npg_pose_identity(double pose[12]);
void npg_pose_apply(double out[3], const double pose[12], const double point[3]);
/* out = a after b; out is neither of them. */
void npg_pose_combine(double out[12], const double a[12], const double b[12]);
void npg_pose_invert(double out[12], const double pose[12]); /* of a rotation; out is not pose */

/* NPG_BAD_INPUT when the 3 x 3 part is no rotation (a scale, a shear, a mirror, numbers that are not finite);
 * what is off by rounding in a file is made exact. */
npg_status npg_pose_check(double pose[12], const char *where);

/* [R | t] from a quaternion (any length but 0) and a translation. */
npg_status npg_pose_of_quaternion(double pose[12], const double xyzw[4], const double t[3],
                                  const char *where);

#endif
