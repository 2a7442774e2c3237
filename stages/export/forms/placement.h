/* Placement: from the capture's coordinates to those of the written files. */
#ifndef NPG_PLACEMENT_H
#define NPG_PLACEMENT_H

#include "pipeline/frame_box.h"

#ifdef __cplusplus
extern "C" {
#endif

/* written[a] = scale * sign[a] * (world - centre)[from[a]] */
typedef struct npg_placement {
    int from[3];
    double sign[3], scale, centre[3];
    bool is_mirror; /* turns a surface inside out, so faces are wound the other way */
} npg_placement;

/* axes: which axis becomes x, y and z, with signs ("xz-y"); scale 1, centre 0.  NPG_USAGE. */
npg_status npg_placement_parse(npg_placement *placement, const char *axes);

/* One point in world coordinates to written ones; out may be the input. */
void npg_place_point(const npg_placement *placement, double out[3], const double world[3]);

/* Unit coordinates (N x 3) to written ones. */
void npg_place_points(const npg_placement *placement, double *out, const npg_frame_box *box,
                      const float *unit, size_t count);

/* Directions, N x 3; out may be the input. */
void npg_place_normals(const npg_placement *placement, float *out, const float *normals, size_t count);

/* F x 3, wound so that the surface still looks outward. */
void npg_place_faces(const npg_placement *placement, uint32_t *out, const uint32_t *faces, size_t face_count);

/* F x 3 x 2 values of the corners, in the order of those faces. */
void npg_place_corners(const npg_placement *placement, float *out, const float *corners, size_t face_count);

/* The largest coordinate that the box of the capture has as written, at most. */
double npg_place_largest(const npg_placement *placement, const npg_frame_box *box);

#ifdef __cplusplus
}
#endif
#endif
