/* Candidate clouds: the frames of the choosing pass, thinned, and how a surface made from one of them
 * fares in the others.
 *
 * A surface from one frame is followed from frame to frame by the coarse tracker (tracker.h), outward in both
 * directions.  Where limbs that touch in its frame were welded, the weld must either hold other frames' limbs
 * together, away from their points, or stretch far: both can be seen. */
#ifndef NPG_CANDIDATE_CLOUDS_H
#define NPG_CANDIDATE_CLOUDS_H

#include "align/tracker.h"
#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/stage.h"

#define NPG_CANDIDATE_POINTS 8000 /* of a frame, at most */

typedef struct npg_candidate_cloud {
    int64_t index, number;
    bool is_candidate;
    size_t point_count;
    float *points, *normals; /* N x 3 each, unit; normals may be NULL; the list's */
} npg_candidate_cloud;

typedef struct npg_candidate_clouds {
    npg_arena arena; /* of all points and normals */
    size_t count, capacity;
    npg_candidate_cloud *list; /* in time order; owned                                */
    size_t given, flipped;     /* normals of candidates: given, and on the wrong side */
} npg_candidate_clouds;

/* Copy a cleaned frame's points, evenly thinned.  Skipped frames are left out.  NPG_MEMORY. */
npg_status npg_candidate_clouds_add(npg_candidate_clouds *clouds, const npg_frame *frame,
                                    const npg_frame_box *box, bool is_candidate);
/* What stage keyframe saw in the choosing pass, for the stage that cuts welds;
 * not there where nothing is cut. */
extern const npg_fact_kind npg_fact_candidate_clouds;

npg_status npg_candidate_clouds_open(npg_candidate_clouds **clouds);
void npg_candidate_clouds_close(npg_candidate_clouds **clouds);

/* Where the frame with this index is in the list; count when it is not there. */
size_t npg_candidate_clouds_find(const npg_candidate_clouds *clouds, int64_t index);

/* Sees the surface in one frame: vert_unit (V x 3) is a loan. */
typedef npg_status (*npg_candidate_seen)(void *user, const npg_candidate_cloud *cloud, const float *vert_unit,
                                         const npg_tracked *tracked);

/* Follow the surface (unit coordinates, with normals) of list[from] through all others; seen is called once
 * for each of them.  NPG_MEMORY, NPG_DIVERGED, or what seen returns. */
npg_status npg_candidate_follow(const npg_candidate_clouds *clouds, size_t from, npg_mesh *mesh,
                                const npg_tracker_settings *settings, npg_candidate_seen seen, void *user);

#endif
