/* Reference: which surface the capture is followed with, decided by what can be measured. */
#ifndef NPG_REFERENCE_H
#define NPG_REFERENCE_H

#include "track/track.h"

/* Judge: what a surface is worth as the reference, by points that had no part in it.
 *
 * The surface is followed through the sampled frames (npg_candidate_follow) by the coarse tracker.  In each
 * frame t of them
 *
 *     D_t = mean_h rho(|h - S_t|) + mean_s rho(|s - P_t|) + mean_h b_h     rho(d) = min(d^2, tau^2) / tau^2
 *
 * h: points of the frame that the tracker was not given, |h - S_t| their distance from the surface as it is
 * posed there; s: places of the posed surface, in proportion to the area as the sensors see it (all of it
 * where it is not known where they stood); P_t: all points of the frame; tau: three times as far as points lie
 * apart; b_h: 1 where the posed surface stands between the point and every sensor (0 where none is known).
 * 0 is perfect.  Surface that joins what parts, or that is not there in other frames, lies off the points, or
 * in space that was seen to be empty; points of what the surface lacks lie off the surface.
 *
 * Before one depth camera the images say what is wrong, as in the verdict and by its bars:
 *
 *     D_t = share of the h that lie farther off than images are sure of + 2 x share of the surface where nothing is */

typedef struct npg_judgement {
    size_t count; /* frames judged */
    double mean;  /* of D_t, over these */
    double own;   /* D_t in the frame that the surface was made from, of what has points there */
    double of_frame[NPG_CHOICE_FRAMES]; /* D_t by place in the sample, NAN: it was not judged */
} npg_judgement;

typedef struct npg_judge_settings {
    double spacing_unit;             /* of the sampled points; the same for all that are compared */
    bool in_own_alone;               /* in the frame that the surface was made from, and nowhere else */
    bool (*should_stop)(void *user); /* or NULL */
    void *user;
} npg_judge_settings;

/* mesh (unit coordinates, with normals) is of the frame at list[at], which is judged where it alone is to be.
 * NPG_MEMORY, NPG_STOPPED, NPG_DIVERGED. */
npg_status npg_judge(npg_judgement *judgement, const npg_candidate_clouds *clouds, size_t at, npg_mesh *mesh,
                     const npg_judge_settings *settings);

/* The same of a surface that somebody else follows: npg_judging_see() is told where it is in each sampled frame,
 * its own among them (judging: an npg_judging; vert_unit: V x 3).  Clouds and mesh are loans.
 * NPG_MEMORY, NPG_STOPPED. */
typedef struct npg_judging npg_judging;
npg_status npg_judging_open(npg_judging **judging, const npg_candidate_clouds *clouds, size_t at,
                            const npg_mesh *mesh, const npg_judge_settings *settings);
npg_status npg_judging_see(void *judging, const npg_candidate_cloud *cloud, const float *vert_unit);
const npg_judgement *npg_judging_found(const npg_judging *judging); /* so far; a loan */
void npg_judging_close(npg_judging **judging);

/* The mean of D_t(one) - D_t(other) over the frames in which both were judged, in standard errors of that
 * mean: negative, `one` is better.  0 where fewer than three are in common. */
double npg_judged_against(const npg_judgement *one, const npg_judgement *other);

/* Whether a frame is a side of the body before one camera, which images tell it by. */
bool npg_judge_is_by_images(const npg_candidate_cloud *cloud);

/* Whether the figure of `one` is better by so much that it is no matter of how coarsely a surface is followed. */
bool npg_judged_clearly(const npg_judgement *one, const npg_judgement *other);

/* Whether no other could be better so clearly: what points say of a surface in the frame that it was made from is
 * the least that they say of any in any frame, as it comes of how densely that was sampled. */
bool npg_judged_least(const npg_judgement *one);

/* Whether it is, beyond chance, too: by two standard errors. */
bool npg_judged_better(const npg_judgement *one, const npg_judgement *other);

/* Whether `one` is worse beyond chance, by however little. */
bool npg_judged_worse(const npg_judgement *one, const npg_judgement *other);

#endif
