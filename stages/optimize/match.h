/* Match: which point of the surface belongs to which point of a frame, as pulls for the fit
 * (kernels/pull.cl). */
#ifndef NPG_MATCH_H
#define NPG_MATCH_H

#include "kernels/motion.h"
#include "optimize/skinning.h"

typedef struct npg_matcher npg_matcher;

typedef struct npg_match_settings {
    int64_t points; /* most points of a frame that pull                      */
    double along;   /* share of distances along the surface, 0..1            */
    double reverse; /* weight of surface -> points against points -> surface */
    double total;   /* sum of the weights of a frame's points                */
    double tie;     /* weight of keeping solved positions, for a whole frame */
} npg_match_settings;

/* skinning is a loan that outlives the matcher.  A matcher works in its caller's thread;
 * several may share it. */
npg_status npg_matcher_open(npg_matcher **matcher, const npg_skinning *skinning,
                            const npg_match_settings *settings);
void npg_matcher_close(npg_matcher **matcher);

/* Distances that count in full (unit), where that is more than three times the frame's median: for surfaces
 * that may be far from where they belong.  0 at first. */
void npg_matcher_widen(npg_matcher *matcher, double width);

/* The most pulls of one frame. */
size_t npg_matcher_most(const npg_matcher *matcher);

/* Pulls of a frame whose surface (skinning.h) is now at vert_unit (W x 3) with the samples at `samples` (S x 3).
 * Points: N x 3 unit, normals N x 3 or NULL.  Distances count less the more they exceed three times the
 * frame's median (Geman and McClure).  Appends to pulls and *count. */
npg_status npg_match_points(npg_matcher *matcher, npg_pull *pulls, size_t *count, const float *vert_unit,
                            const float *samples, const float *points, const float *normals,
                            size_t point_count);

/* Pulls that hold the samples at solved positions (S x 3); appends. */
void npg_match_tie(const npg_matcher *matcher, npg_pull *pulls, size_t *count, const float *solved);

#endif
