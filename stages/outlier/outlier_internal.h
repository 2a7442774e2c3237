/* Outlier: what the files of the room share; outlier.h has what others may use. */
#ifndef NPG_OUTLIER_INTERNAL_H
#define NPG_OUTLIER_INTERNAL_H

#include <stdbool.h>
#include <stddef.h>

#include "geometry/geometry.h"
#include "outlier/outlier.h"
#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/memory.h"
#include "pipeline/status.h"

/* Cleaning: from the points of a file to those worth using.
 *
 * The steps change a frame's pos_local and normals in place, keep the order of what stays, and count what
 * goes in frame->cleaning.  Deterministic for every number of threads.  NPG_MEMORY. */

#define NPG_COORDINATE_MAX 1e12f /* farther from the origin than this counts as not finite */

/* Drop points with a coordinate that is not a usable number. */
npg_status npg_clean_finite(npg_frame *frame);

/* Of points at exactly one place keep the first. */
npg_status npg_clean_duplicates(npg_frame *frame);

/* Of more than point_max points keep so many, evenly by their order. */
npg_status npg_clean_cap(npg_frame *frame, size_t point_max);

/* These three, in this order. */
npg_status npg_clean_points(npg_frame *frame, size_t point_max);

/* NPG_BAD_INPUT when there are fewer than 16 points, or all lie in one place, on one line or on one plane. */
npg_status npg_clean_check(const npg_frame *frame);

/* Outliers: the points of a cloud that lie farther from their neighbours than others do.
 *
 * Based on: R. B. Rusu et al., Towards 3D Point Cloud Based Object Maps for Household Environments, 2008 (the
 * filter that PCL has as StatisticalOutlierRemoval; but for scattered points the verdicts are the same), and on: E.
 * Levina, P. J. Bickel, Maximum Likelihood Estimation of Intrinsic Dimension, NIPS 2004. */

/* keep[i] = 0 for the isolated ones of points (N x 3, finite, N > 0), else 1: those whose mean distance to
 * their `neighbours` nearest points is more than `ratio` standard deviations above the mean of all points.  Points
 * clearly farther apart than most, which are no surface but scattered in space, count for neither: a tenth of
 * the points would be enough to hide each other.
 * This is asked again of what is left until there are no more (NPG_ROUNDS_MOST at most): far outliers raise mean
 * and deviation and so hide the near ones from the first round.  A round searches only where the one before
 * took a neighbour away.  Uses `threads` threads (0: one per core); the result does not depend on it.
 * NPG_MEMORY. */
npg_status npg_find_isolated(uint8_t *keep, const float *points, size_t point_count, int neighbours,
                             double ratio, int threads);

/* Bytes that takes at most. */
size_t npg_find_isolated_memory(size_t point_count);

/* Drop the isolated points of frames that have been cleaned of all else, those of depth images are marked
 * (npg_frame.isolated); several frames at a time in threads; skipped and empty ones are left alone.  NPG_MEMORY;
 * errors name the frame. */
npg_status npg_isolated_drop(npg_frame *const *frames, size_t count, int neighbours, double ratio);

/* One view: whether one sensor saw all points of a cloud, and from where.
 *
 * points: N x 3, finite.  The same input gives the same result; any number of calls may run at once. */

/* Whether the cloud looks like one view from a sensor: hardly a point is hidden behind another as seen from
 * there, and the sensor is outside the cloud's box.  NPG_MEMORY. */
npg_status npg_cloud_is_single_view(bool *yes, const float *points, size_t point_count,
                                    const double sensor[3]);

/* A place from which the cloud looks like one view, at a distance of 1.5 times its size, where there is one: where
 * its points' normals (npg_normals_make()) look in the mean, if that is more than half as long as one of them, as
 * those of one side have it (a dancer 0.7, a horse 0.6; before three sensors around them 0.1).  Hardly a point may be
 * hidden from there, else directions around are asked, and what lies along the outline must be farther away: a body
 * bulges toward its sensor.  *is_sure: beyond what chance gives, so that it is no sheet, and by the normals as they are
 * made.  Known to about 10 degrees (a dancer 1 to 14, a horse 1 to 16).
 * NPG_MEMORY. */
npg_status npg_one_view_find(bool *found, bool *is_sure, double sensor[3], const float *points,
                             size_t point_count);

/* Bytes that it takes. */
size_t npg_one_view_memory(void);

/* Sensors: where they stood, by option sensor: the same places in all frames, or a file of places per frame.
 *
 *     X,Y,Z             one that stands still; several: X,Y,Z:X,Y,Z
 *     FILE              lines "X Y Z": one sensor, a line per frame in order; or lines "NUMBER X Y Z": the
 *                       frame's number, a line per sensor.  Empty lines and lines that begin with # are
 *                       skipped. */

#define NPG_SENSOR_LINES 4000000 /* of a file: 18 hours at 60 a second     */

typedef struct npg_sensor_place {
    int64_t frame; /* its number, or place in order */
    size_t line;
    double world[3];
} npg_sensor_place;

typedef struct npg_sensors {
    const char *text; /* as given, a loan */
    bool is_file, has_numbers;
    npg_sensor_place *places; /* by frame; owned */
    size_t count, capacity;
} npg_sensors;

/* NPG_USAGE for what is neither places nor a file; NPG_BAD_INPUT names the file and its line. */
npg_status npg_sensors_open(npg_sensors *sensors, const char *text);
void npg_sensors_close(npg_sensors *sensors);

/* Give the frame its sensors, instead of those it had; which of them saw which point is left as it is.
 * NPG_BAD_INPUT: the file has none for it. */
npg_status npg_sensors_set(const npg_sensors *sensors, npg_frame *frame, const npg_origin *origin);

#endif
