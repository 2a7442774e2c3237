/* Contact: how much of a cloud lies close to another part of the body, told from the points alone. */
#ifndef NPG_CONTACT_H
#define NPG_CONTACT_H

#include <stdbool.h>

#include "pipeline/status.h"

/* Whether two points with outward normals n and m face each other across a gap. */
bool npg_points_face(const float *p, const float *n, const float *q, const float *m);

/* Share of points that have, among their 24 nearest, one that faces them across a gap: normals against each
 * other, the gap outside of both.  points and normals (outward): N x 3; of many points only 5000, evenly
 * chosen, are looked at.  NPG_MEMORY. */
npg_status npg_cloud_contact(double *share, const float *points, const float *normals, size_t point_count);

#endif
