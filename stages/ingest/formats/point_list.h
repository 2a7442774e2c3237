/* Point list: what a reader collects a cloud in.  Rows go straight into a frame's arrays. */
#ifndef NPG_POINT_LIST_H
#define NPG_POINT_LIST_H

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"

typedef struct npg_point_list {
    npg_frame *frame;   /* loan; its arrays grow */
    npg_origin *origin; /* loan */
    size_t pos_capacity, normal_capacity, colour_capacity;
    bool has_normals, has_colours;
} npg_point_list;

/* Room for `more` further points beyond those that are there.  NPG_MEMORY. */
npg_status npg_points_reserve(npg_point_list *list, size_t more);

/* Add one point, world coordinates; normal (any length) is used when has_normals.  A normal without a
 * direction (zero or not finite) becomes (0, 0, 0).  Room must have been reserved. */
void npg_points_add(npg_point_list *list, const double world[3], const double normal[3]);

/* The colour of the point that npg_points_add() added last; with has_colours every point has one. */
static inline void npg_points_colour(npg_point_list *list, const uint8_t rgba[4])
{
    uint8_t *to = list->frame->colours + 4 * (list->frame->point_count - 1);
    for (int c = 0; c < 4; c++) to[c] = rgba[c];
}

/* world -> local, one point; the first finite one becomes the origin. */
void npg_local_of(float local[3], npg_origin *origin, const double world[3]);

/* Move the origin to the median of the points when it lies so far from them that float can't tell them apart
 * well; true when it moved (the points must then be read again). */
bool npg_origin_improve(npg_origin *origin, const float *pos_local, size_t point_count);

/* Unit length, (0, 0, 0) where there is no direction. */
void npg_unit_normal(float out[3], const double normal[3]);

#endif
