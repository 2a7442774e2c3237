/* Cost: what the parts of a run take in processor seconds, on a machine whose core makes NPG_COST_CORE_FLOPS
 * multiply-adds x 2 a second.  One model for two uses: the share of a run that is done, where only ratios
 * matter (timeline.c), and the estimate of neupig probe.  Fitted to the runs in samples/guide/tuning.md. */
#ifndef NPG_COST_H
#define NPG_COST_H

#include <math.h>
#include <stdbool.h>

#include "pipeline/stage.h"

#define NPG_COST_CORE_FLOPS 120e9
#define NPG_COST_BUSY       1.55 /* cores that there is work for, on the average */

/* Limits that stages keep to, where the costs depend on them. */
#define NPG_START_POINTS_MOST 30000 /* of a surface that only carries the frames of a fusing pass           */
#define NPG_POINTS_A_FACE     2     /* points of a frame for each face of the reference, at most, but ... */
#define NPG_FRAME_POINTS      40000 /* ... so many in any case */

#define NPG_COST_FUSED_POINTS 45000 /* fused points of a capture, as a rule; 34 000 to 62 000 were seen */

/* The choice of the keyframe: drafts of the candidates' surfaces, and their normals where they have none. */
static inline double npg_cost_choice_s(double points, bool has_normals)
{
    return 2.5 + (has_normals ? 0 : 38e-6 * NPG_CHOICE_MAX * points);
}

/* A surface of so many points: Poisson, and the drafts before it, at the depth that is the default. */
static inline double npg_cost_surface_s(double points)
{
    return 8 + 0.1e-3 * points;
}

/* One pass that follows frames of so many points each, with all that is done to a frame beside it: reading,
 * fusion, fit and figures, where motion is easy to follow. */
static inline double npg_cost_pass_s(double frames, double points)
{
    return 0.5 * frames * (0.62 + 36e-6 * fmin(points, NPG_FRAME_POINTS));
}

/* The network: multiply-adds x 2 of a vertex, a frame and an epoch, forward and twice as many backward.  40
 * inputs, two hidden layers of width_1 and width_2 units, and a head of 7. */
static inline double npg_cost_decoder_flops(double width_1, double width_2)
{
    return 3 * 2 * (40 * width_1 + width_1 * width_2 + 7 * width_2);
}

/* So many of them: of `flops` a second, which the registers could make, the kernels make about half. */
static inline double npg_cost_network_s(double count, double flops)
{
    return count / (0.5 * fmax(flops, 2));
}

#endif
