/* Isolated points (PCL's StatisticalOutlierRemoval). */
#ifndef NPG_OUTLIERS_H
#define NPG_OUTLIERS_H

#include "pipeline/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* keep[i] = 0 for the points whose mean distance to their `neighbours` nearest points is more than `ratio`
 * standard deviations above the mean of all points, 1 for the others.  points: N x 3, finite.  *dropped
 * counts them.  NPG_MEMORY, NPG_FAILED. */
npg_status npg_outliers_statistical(uint8_t *keep, size_t *dropped, const float *points, size_t point_count,
                                    int neighbours, double ratio);

#ifdef __cplusplus
}
#endif
#endif
