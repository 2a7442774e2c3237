/* Image space: what one square depth image says of space, for tests of what is done with it. */
#ifndef TEST_IMAGE_SPACE_H
#define TEST_IMAGE_SPACE_H

#include "geometry/sensor_space.h"

#define IMAGE_STEP 0.01 /* of what is ahead: a cell */

/* Where the first of `side` cells begins, along either axis; the middle is straight ahead. */
static inline double image_first(int side)
{
    return -0.5 * IMAGE_STEP * side;
}

/* cells: side x side, depths; to_sensor: as in npg_depth_view. */
static inline npg_free_space *image_space(float *cells, int side, const double to_sensor[12])
{
    static const npg_frame_box unit = {.scale = 1};
    npg_depth_view view = {
        .first = {image_first(side), image_first(side)}, .step = IMAGE_STEP, .width = side, .height = side};
    const npg_frame frame = {.sensor_count = 1,
                             .views = &view,
                             .view_cells = cells,
                             .view_cell_count = (size_t)side * (size_t)side};
    npg_free_space *space;
    memcpy(view.to_sensor, to_sensor, sizeof view.to_sensor);
    assert_int_equal(npg_free_space_open(&space, &frame, &unit), NPG_OK);
    return space;
}

/* From (0, 0, -4) along z. */
static const double image_from_below[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 4};

#endif
