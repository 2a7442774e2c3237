/* Outliers: the points of a cloud that lie farther from their neighbours than others do.
 *
 * Based on: R. B. Rusu et al., Towards 3D Point Cloud Based Object Maps for Household Environments, 2008 (the
 * filter that PCL has as StatisticalOutlierRemoval; the verdicts are the same). */
#ifndef NPG_OUTLIERS_H
#define NPG_OUTLIERS_H

#include "pipeline/status.h"

/* keep[i] = 0 for the isolated ones of points (N x 3, finite, N > 0), else 1: those whose mean distance to
 * their `neighbours` nearest points is more than `ratio` standard deviations above the mean of all points.
 * This is asked again of what is left until there are no more (8 rounds at most): far outliers raise mean
 * and deviation and so hide the near ones from the first round.  A round searches only where the one before
 * took a neighbour away.  Uses `threads` threads (0: one per core); the result does not depend on it.
 * NPG_MEMORY. */
npg_status npg_find_isolated(uint8_t *keep, const float *points, size_t point_count, int neighbours,
                             double ratio, int threads);

/* Bytes that takes at most. */
size_t npg_find_isolated_memory(size_t point_count);

#endif
