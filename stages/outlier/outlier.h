/* Door of the outlier room: its work to be timed (bench). */
#ifndef NPG_OUTLIER_H
#define NPG_OUTLIER_H

#include "pipeline/work.h"

/* Cleaning one cloud (N x 3): rows "outlier_isolated" and "outlier_normals".  Failures are NPG_MEMORY and the
 * visit's. */
npg_status npg_outlier_work(const float *points, size_t point_count, npg_work_visit *visit, void *user);

#endif
