/* Choose: which of the best-scored frames makes the reference, by what their surfaces
 * would do in other frames.
 *
 * The paper's score (keyframe.c) counts cells that hold a point; it hardly tells frames apart and knows
 * nothing of limbs that touch.  Here each candidate's points are made a draft surface, which the coarse
 * tracker follows through the other frames (candidate_clouds.h).  The cost of a candidate is
 *
 *     (mean distance of points from the surface + mean distance of the surface's vertices from points
 *      + 0.2 * share of its area stretched threefold + 0.1 * share of points in contact)
 *     * (1 + 0.05 * handles it has more than the candidate with the fewest)
 *     * (1 + 0.3 * (frames from the middle / frames of the capture)^2)
 *
 * lengths in units; the first three are means over the other frames, contact is that of its own points
 * (contact.h).  A weld keeps surface away from points, stretches where limbs part, and often makes a handle;
 * contact tells of welds that the coarse tracker does not feel.  The frame with the best score stays the
 * keyframe unless another is clearly cheaper and has its parts more apart: fewer handles, or clearly less
 * contact.  Candidates that are not more apart are neither drafted nor followed; where there is none, the
 * choice costs one draft. */
#ifndef NPG_CHOOSE_H
#define NPG_CHOOSE_H

#include "align/candidate_clouds.h"
#include "mesh/poisson.h"

typedef struct npg_draft_result {
    int64_t index, number;
    bool is_followed;       /* false: not in the running, or no surface could be made; the distances are 0 */
    double point_dist_unit; /* points -> surface, mean over the other frames                               */
    double vert_dist_unit;  /* vertices -> points, mean over the other frames                              */
    double stretched_share; /* of the area, mean over the other frames                                     */
    double contact;         /* share of its own points                                                     */
    int64_t handles;        /* of the closed draft; 0 where none was made                                  */
    double cost;            /* 0 when not followed                                                         */
} npg_draft_result;

/* frame_count: of the capture.  results: room for as many as there are candidates; *count gets how
 * many, *best which is chosen (its place in results).  best_scored: index of the frame to stay with.
 * NPG_MEMORY, NPG_STOPPED. */
npg_status npg_choose(npg_draft_result *results, size_t *count, size_t *best,
                      const npg_candidate_clouds *clouds, int64_t best_scored, int64_t frame_count,
                      const npg_poisson_settings *settings);

#endif
