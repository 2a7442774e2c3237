/* Keyframe: what the files of the room share. */
#ifndef NPG_KEYFRAME_INTERNAL_H
#define NPG_KEYFRAME_INTERNAL_H

#include <pthread.h>

#include "mesh/surface.h"
#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/stage.h"
#include "pipeline/store.h"
#include "reference/reference.h"
#include "track/track.h"

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

/* The finite ones of at most `most` points (count x 3), spread over their order; out has room for as many. */
size_t npg_spread_finite(float *out, size_t most, const float *points, size_t count);

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

/* Pieces of NPG_PIECE_SHARE of the frame's area at least, of cells of the second kind that touch: what a hole cuts off
 * is one more.  NPG_MEMORY. */
npg_status npg_extent_pieces(size_t *count, npg_extent *extent, const npg_frame *frame);

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

/* Candidates: which frame makes the reference, by what the surfaces of several do in other frames.
 *
 * The paper's score (keyframe.c) counts cells that hold a point; it hardly tells frames apart and knows
 * nothing of limbs that touch, of what a sensor did not see, or of a pose that is hard to follow from.  So
 * frames spread over the sample are tried, too: each one's points are made a draft surface, and the judge
 * (reference/reference.h) says how it fares.  The frame by score stays unless another is clearly
 * better, or not worse beyond chance with fewer handles and pieces; a side unless one is better beyond chance. */

typedef struct npg_candidate {
    size_t at; /* place in the clouds */
    int64_t index, number;
    bool is_followed;    /* false: no surface could be made, or it was lost */
    int64_t handles;     /* of the draft */
    size_t pieces;       /* of the draft */
    double unseen_share; /* of the draft's area */
    npg_judgement judgement;
} npg_candidate;

/* Fill choice with the frames to read: all of a short capture, every second or third one of a longer one,
 * around the key.  Candidates are the key alone, or frames spread over these as well, those in the fewest pieces
 * around each place.  pieces: npg_extent_pieces() of each frame. */
void npg_candidates_list(npg_choice *choice, int64_t key, int64_t frame_count, const uint8_t *pieces,
                         bool key_alone);

/* Whether no frame of the choice is in fewer pieces than this one. */
bool npg_candidates_is_whole(const npg_choice *choice, const uint8_t *pieces, int64_t index);

/* Place in the list of the one to take; scored: of the frame by score, count: none; is_side: of one depth camera.
 * Where the frame by score has not seen more than NPG_FEW of its draft, it stays if it can be followed at all: how
 * Poisson closes what frames hide of the body says nothing. */
size_t npg_candidates_best(const npg_candidate *list, size_t count, size_t scored, bool is_side);

/* Try the candidates among the clouds.  *count: how many; *best: place in the list of the one to take;
 * scored: index of the frame by score.  NPG_MEMORY, NPG_STOPPED. */
npg_status npg_candidates_try(npg_candidate list[NPG_CHOICE_MAX], size_t *count, size_t *best,
                              const npg_candidate_clouds *clouds, int64_t scored,
                              const npg_poisson_settings *settings);

/* Choosing pass: reads the frames of facts.choice, and takes the best of its candidates for the keyframe. */

/* The frames read so far; zeroed before the pass. */
typedef struct npg_choose_pass {
    npg_candidate_clouds *clouds; /* owned */
} npg_choose_pass;

/* Remember what the frames of a chunk show.  NPG_MEMORY. */
npg_status npg_choose_pass_add(npg_choose_pass *pass, const npg_facts *facts, npg_chunk *chunk);

/* The end of the pass: *chosen gets the candidate to take, chosen->index -1 where the frame by score stays.
 * What was tried goes into the stage's report, and what was seen is published (npg_fact_candidate_clouds).
 * NPG_MEMORY, NPG_STOPPED. */
npg_status npg_choose_pass_end(npg_choose_pass *pass, npg_worker *worker, npg_candidate *chosen);

void npg_choose_pass_clear(npg_choose_pass *pass);

#endif
