/* Sights: the frames of the choosing pass, thinned, and how a surface made from one of them
 * fares in the others.
 *
 * A surface from one frame is followed from frame to frame by the coarse tracker (tracker.h), outward in both
 * directions.  Where limbs that touch in its frame were welded, the weld must either hold other frames' limbs
 * together, away from their points, or stretch far: both can be seen. */
#ifndef NPG_SIGHTS_H
#define NPG_SIGHTS_H

#include "align/tracker.h"
#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/stage.h"

#define NPG_SIGHT_POINTS 8000 /* of a frame, at most */

typedef struct npg_sight {
    int64_t index, number;
    bool is_candidate;
    size_t point_count;
    float *points, *normals; /* N x 3 each, unit; normals may be NULL; owned */
} npg_sight;

typedef struct npg_sights {
    size_t count, capacity;
    npg_sight *list;       /* in time order; owned                                */
    size_t given, flipped; /* normals of candidates: given, and on the wrong side */
} npg_sights;

/* Copy a cleaned frame's points, evenly thinned.  Skipped frames are left out.  NPG_MEMORY. */
npg_status npg_sights_add(npg_sights *sights, const npg_frame *frame, const npg_frame_box *box,
                          bool is_candidate);
/* What stage keyframe saw in the choosing pass, for the stage that cuts welds;
 * not there where nothing is cut. */
extern const npg_fact_kind npg_fact_sights;

npg_status npg_sights_open(npg_sights **sights);
void npg_sights_close(npg_sights **sights);

/* Where the frame with this index is in the list; count when it is not there. */
size_t npg_sights_find(const npg_sights *sights, int64_t index);

/* Sees the surface in one frame: vert_unit (V x 3) is a loan. */
typedef npg_status (*npg_sight_seen)(void *user, const npg_sight *sight, const float *vert_unit,
                                     const npg_tracked *tracked);

/* Follow the surface (unit coordinates, with normals) of list[from] through all others; seen is called once
 * for each of them.  NPG_MEMORY, NPG_DIVERGED, or what seen returns. */
npg_status npg_sights_follow(const npg_sights *sights, size_t from, npg_mesh *mesh,
                             const npg_tracker_settings *settings, npg_sight_seen seen, void *user);

#endif
