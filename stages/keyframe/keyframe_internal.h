/* Keyframe: what the files of the room share. */
#ifndef NPG_KEYFRAME_INTERNAL_H
#define NPG_KEYFRAME_INTERNAL_H

#include <pthread.h>

#include "align/tracking.h"
#include "mesh/surface.h"
#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/stage.h"
#include "pipeline/store.h"

/* Likeness: how near a user's own mesh is to a frame's points, where it was put.
 *
 *     d = mean_p |p - nearest vertex| + mean_v |v - nearest point|
 *
 * over at most about LOOKED_AT points p of the frame and as many vertices v.  The frame with the smallest d
 * is the one whose pose the mesh has: it is the keyframe that a run with the user's own mesh should have. */

typedef struct npg_likeness npg_likeness;

/* Read the mesh (PLY or OBJ).  origin is known.  NPG_BAD_INPUT names the file. */
npg_status npg_likeness_open(npg_likeness **likeness, const char *path, const npg_origin *origin,
                             const npg_frame_box *box);
size_t npg_likeness_vert_count(const npg_likeness *likeness); /* of the whole mesh */
void npg_likeness_close(npg_likeness **likeness);

/* d of a frame with points, in units; infinity where no point is finite.  NPG_MEMORY. */
npg_status npg_likeness_dist(double *dist_unit, const npg_likeness *likeness, const npg_frame *frame,
                             const npg_frame_box *box);

/* Extent: how much surface a frame shows, as the number of cells of a grid that hold a point.
 *
 * Where cells are much smaller than the points are apart, that is the number of points and says nothing of
 * the surface: so it is with the paper's cells, a 512th of the box, and 5000 points.  With cells of
 *
 *     side = max(2 x spacing of the first frame's points, 1.5 % of the figure's diagonal)
 *
 * it goes with the area: a frame whose parts touch, or hide each other from the sensors, has fewer.  Their
 * number is then the sum over eight places of the grid; it scatters by half a per cent. */

typedef struct npg_extent npg_extent;

/* The cells of a capture of which this is a frame.  NPG_MEMORY. */
npg_status npg_extent_open(npg_extent **extent, const npg_frame_box *box, const npg_frame *first);
void npg_extent_close(npg_extent **extent);

/* Cells that hold a finite point of the frame: the paper's, and those that go with the area. */
size_t npg_extent_papers(npg_extent *extent, const npg_frame *frame);
size_t npg_extent_area(npg_extent *extent, const npg_frame *frame);

/* Outside: a watch on the frames of a live source that leave the box of the look-ahead. */

/* A frame that lies outside the box. */
typedef struct npg_outside_frame {
    int64_t index, number;
    double share; /* by how much, in longest sides of the box */
} npg_outside_frame;

typedef struct npg_outside {
    npg_outside_frame *frames; /* in order of arrival; owned */
    size_t count, capacity;
    pthread_mutex_t lock; /* another thread may write the frames to a state on disk */
} npg_outside;

void npg_outside_open(npg_outside *outside);
void npg_outside_close(npg_outside *outside);

/* Tell when a frame lies outside [-1, 1]: the first few by name, all of them in the last word. */
npg_status npg_outside_watch(npg_worker *worker, npg_outside *outside, const npg_frame *frame);
void npg_outside_tell(npg_worker *worker, const npg_outside *outside);

/* Those that were told, to a state on disk and back: of frames that are solved, the others come again.  Any
 * thread may save. */
npg_status npg_outside_save(npg_outside *outside, npg_store *out);
npg_status npg_outside_restore(npg_outside *outside, const npg_record *in, const npg_facts *facts);

/* Shortlist: which frames the choosing pass reads, and which of them may become the keyframe. */

#define NPG_SHORTLIST_REACH 24 /* frames on either side of the middle that are remembered */

typedef struct npg_nearby {
    int64_t index;
    size_t cell_count; /* as the score counts them                          */
    double contact;    /* npg_cloud_contact(), 0 where there are no normals */
} npg_nearby;

typedef struct npg_shortlist {
    size_t count;
    npg_nearby list[2 * NPG_SHORTLIST_REACH + 1]; /* in time order */
} npg_shortlist;

/* Whether a frame of so many lies near enough to the middle to be remembered. */
bool npg_shortlist_wants(int64_t index, int64_t frame_count);

/* Measure and remember a usable frame that is wanted, in time order.  NPG_MEMORY. */
npg_status npg_shortlist_add(npg_shortlist *shortlist, const npg_frame *frame, size_t cell_count);

/* Fill choice with the frames around the key: all of a short capture, every second one of a long one.
 * Candidates are the key alone, or up to NPG_CHOICE_MAX frames that show nearly as much surface as the best:
 * those with least contact, apart in time. */
void npg_shortlist_choose(npg_choice *choice, const npg_shortlist *shortlist, int64_t key,
                          int64_t frame_count, bool key_alone);

/* Choose: which of the best-scored frames makes the reference, by what their surfaces
 * would do in other frames.
 *
 * The paper's score (keyframe.c) counts cells that hold a point; it hardly tells frames apart and knows
 * nothing of limbs that touch.  Here each candidate's points are made a draft surface, which the coarse
 * tracker follows through the other frames (candidate_clouds.c).  The cost of a candidate is
 *
 *     (mean distance of points from the surface + mean distance of the surface's vertices from points
 *      + 0.2 * share of its area stretched threefold + 0.1 * share of points in contact)
 *     * (1 + 0.05 * handles it has more than the candidate with the fewest)
 *     * (1 + 0.3 * (frames from the middle / frames of the capture)^2)
 *
 * lengths in units; the first three are means over the other frames, contact is that of its own points
 * (npg_cloud_contact()).  A false bridge keeps surface away from points, stretches where limbs part, and often
 * makes a handle; contact tells of bridges that the coarse tracker does not feel.  The frame with the best
 * score stays the keyframe unless another is clearly cheaper and has its parts more apart: fewer handles, or
 * clearly less contact.  Candidates that are not more apart are neither drafted nor followed; where there is
 * none, the choice costs one draft. */

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

/* Choosing pass: reads the frames of facts.choice, and takes the one of its candidates whose surface fits
 * best in the others (choose.c) for the keyframe. */

/* The frames read so far; zeroed before the pass. */
typedef struct npg_choose_pass {
    npg_candidate_clouds *clouds; /* owned */
} npg_choose_pass;

/* Remember what the frames of a chunk show.  NPG_MEMORY. */
npg_status npg_choose_pass_add(npg_choose_pass *pass, const npg_facts *facts, npg_chunk *chunk);

/* The end of the pass: *result gets the candidate to take, result->index -1 where the frame by score stays.
 * Its candidates go into the stage's report; what was seen is published where bridges are to be cut
 * (npg_fact_candidate_clouds).  NPG_MEMORY, NPG_STOPPED. */
npg_status npg_choose_pass_end(npg_choose_pass *pass, npg_worker *worker, npg_draft_result *result);

void npg_choose_pass_clear(npg_choose_pass *pass);

#endif
