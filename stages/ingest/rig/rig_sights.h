/* Sights: what the sensors of a rig saw in a few frames, on the grids of their images, so that a point of one
 * sensor can be looked up in the image of another. */
#ifndef NPG_RIG_SIGHTS_H
#define NPG_RIG_SIGHTS_H

#include "ingest/rig/rig.h"

/* Points of one sensor in one frame, in its own axes. */
typedef struct npg_rig_sight {
    bool is_there;        /* there is an image that could be read             */
    size_t point_count;   /* in the image                                     */
    size_t count;         /* that are kept                                    */
    float *pos, *normals; /* N x 3 each, owned                                */
    uint16_t *columns;    /* N: column in the thinned grid; owned             */
    uint32_t *rows;       /* (row_count + 1): first point of each row; owned  */
    size_t row_count;
    size_t step;     /* pixels of the image per cell of the thinned grid      */
    double pose[12]; /* sensor to world, as npg_rig_pose() has it             */
} npg_rig_sight;

typedef struct npg_rig_sights {
    const npg_rig *rig;
    size_t frame_count, sensor_count;
    npg_rig_sight *of; /* frame_count x sensor_count, owned                       */
    double depth;      /* mean distance from sensor to point, in the rig's unit   */
    double centre[3];  /* mean of all points, world                            */
} npg_rig_sights;

/* A point of one sensor and the place of another's surface that lies before the same pixel. */
typedef struct npg_rig_sight_pair {
    double own[3], other[3]; /* world                                       */
    double normal[3];        /* of both surfaces, unit: the mean of the two */
    double off;              /* normal . (own - other)                      */
} npg_rig_sight_pair;

/* Read the images of `count` frames (places in the rig).  An image that can't be read counts as missing.
 * NPG_MEMORY. */
npg_status npg_rig_sights_open(npg_rig_sights *sights, npg_rig *rig, const size_t *frames, size_t count);
void npg_rig_sights_close(npg_rig_sights *sights);

const npg_rig_sight *npg_rig_sights_of(const npg_rig_sights *sights, size_t frame, size_t sensor);

/* Look point i of sight a up in sight b, with the poses (sensor to world) of both.  false where b sees
 * nothing there, another surface (normals apart, or further off than `reach`), or either sees it from the
 * side. */
bool npg_rig_sight_match(npg_rig_sight_pair *pair, const npg_rig_sight *a, size_t i, const double pose_a[12],
                         const npg_rig_sight *b, const npg_camera *camera_b, const double pose_b[12],
                         double reach);

/* ---- distances ---- */

#define NPG_RIG_BINS 1024

/* A histogram of sizes from 0 to `reach`. */
typedef struct npg_rig_bins {
    double reach;
    uint64_t count[NPG_RIG_BINS];
} npg_rig_bins;

void npg_rig_bins_add(npg_rig_bins *bins, double size);

/* 1.4826 times the median: the standard deviation of normal residuals whose sizes these are, whatever a few
 * wrong pairs among them say; 0 without any. */
double npg_rig_bins_deviation(const npg_rig_bins *bins);

#endif
