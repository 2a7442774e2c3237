/* Seen share: how much of a body a frame can show. */
#ifndef NPG_SEEN_SHARE_H
#define NPG_SEEN_SHARE_H

#include <stddef.h>

#define NPG_ONE_SENSOR_SEES 0.5 /* of a body, at most */

/* Share of a whole body's surface, at most, that a frame of so many sensors can have points on; 0 sensors: not
 * known, and taken to be of all sides. */
static inline double npg_seen_share(size_t sensor_count)
{
    return sensor_count == 1 ? NPG_ONE_SENSOR_SEES : 1;
}

#endif
