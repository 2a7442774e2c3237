/* Point list: what a reader collects a cloud in.  Rows go straight into a frame's arrays. */
#ifndef NPG_POINT_LIST_H
#define NPG_POINT_LIST_H

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"

typedef struct npg_point_list {
    npg_frame *frame;   /* loan; its arrays grow */
    npg_origin *origin; /* loan */
    size_t pos_capacity, normal_capacity;
    bool has_normals;
} npg_point_list;

/* Room for `more` further points beyond those that are there.  NPG_MEMORY. */
npg_status npg_points_reserve(npg_point_list *list, size_t more);

/* Add one point, world coordinates; normal (any length) is used when has_normals.  A normal without a
 * direction (zero or not finite) becomes (0, 0, 0).  Room must have been reserved. */
void npg_points_add(npg_point_list *list, const double world[3], const double normal[3]);

/* world -> local, one point; the first finite one becomes the origin. */
void npg_local_of(float local[3], npg_origin *origin, const double world[3]);

/* Move the origin to the median of the points when it lies so far from them that float can't tell them apart
 * well; true when it moved (the points must then be read again). */
bool npg_origin_improve(npg_origin *origin, const float *pos_local, size_t point_count);

/* Unit length, (0, 0, 0) where there is no direction. */
void npg_unit_normal(float out[3], const double normal[3]);

#endif
