#ifndef NPG_ALIGN_INTERNAL_H
#define NPG_ALIGN_INTERNAL_H

#include <pthread.h>
#include <stdint.h>

#include "align/tracking.h"
#include "geometry/geometry.h"
#include "pipeline/chunk.h"
#include "pipeline/memory.h"
#include "pipeline/stage.h"
#include "pipeline/status.h"
#include "pipeline/store.h"

/* Align: what the files of the room share. */

/* Block system: the normal equations of a graph's nodes, 6 unknowns each (a turn and a move), and their
 * solution by conjugate gradients.
 *
 * Symmetric and positive; one 6 x 6 block per node and per pair of nodes of a fixed set.  Terms are gathered
 * in parts, so that threads can add at the same time; the solution adds the parts up in their order. */

#define NPG_BLOCK_NODES 4 /* of a term, at most */
#define NPG_BLOCK_PARTS 2

typedef struct npg_block_system npg_block_system;

/* |W^(1/2) (sum_k share_k (turn_k x arm_k + move_k) - right)|^2, W = across normal normal^T + along I. */
typedef struct npg_block_term {
    size_t count;
    uint32_t nodes[NPG_BLOCK_NODES]; /* none twice */
    double shares[NPG_BLOCK_NODES], arms[NPG_BLOCK_NODES][3];
    double normal[3], across, along;
    double right[3];
} npg_block_term;

/* n nodes; pairs (a < b, sorted) that may be coupled, beside each node with itself. */
npg_status npg_block_open(npg_block_system **system, size_t node_count, const uint32_t (*pairs)[2],
                          size_t pair_count);
void npg_block_close(npg_block_system **system);

/* A part becomes zero. */
void npg_block_clear(npg_block_system *system, size_t part);

/* Add a term to a part; one thread a part.  Couplings of pairs that are not in the set are left out. */
void npg_block_add(npg_block_system *system, size_t part, const npg_block_term *term);

/* x (n x 6: turn, move) so that the residual is at most `tolerance` (>= 1e-6: it works in single precision)
 * of the right side, or after `iterations`.  `damping` times the identity is added first.  Returns the
 * iterations taken. */
int npg_block_solve(npg_block_system *system, double *x, double damping, double tolerance, int iterations);

/* Component links: edges between the separate pieces of a surface.
 *
 * A piece that no sensor sees in a frame, an eye or what is known of a hand, has neither points nor an edge
 * to anything that has; and one that is seen but lost, a foot whose shin is too thin to be in the reference,
 * has nothing that brings it back.  So each piece hangs on the nearest other one, by few edges that count
 * where both ends are hidden, and little where they are seen (occlusion_prior.c).  Based on Prim's minimal spanning
 * tree, of pieces. */

/* *links: pairs (a < b) of nodes, sorted, owned by the caller; none where the edges join all nodes.  node_pos
 * (K x 3); edges (E) join the nodes of a piece.  Equal input gives equal bits.  O(K^2).  NPG_MEMORY: *links is
 * then NULL. */
npg_status npg_component_links_find(uint32_t (**links)[2], size_t *link_count, const float *node_pos,
                                    size_t node_count, const uint32_t (*edges)[2], size_t edge_count);

/* Rigid ICP: how a body stands in one frame against another, as far as it moved as a whole.
 *
 * Motion recurs, but seldom in place: who walks comes back to a pose lengths away, who turns comes back to it
 * facing elsewhere.  So two frames are compared, and one is started from the pose of the other, after the
 * rigid motion that brings their points together.
 *
 * Based on: Besl and McKay, A method for registration of 3-D shapes, 1992 (iterated closest points), and
 * Chetverikov et al., The trimmed iterative closest point algorithm, 2002: the pairs that lie farthest apart,
 * of limbs that moved on their own, are left out. */

#define NPG_LOOK_POINTS 500 /* of a frame, at most */

/* A few points of a frame. */
typedef struct npg_look {
    float *points; /* N x 3; owned */
    size_t count;  /* N            */
    npg_kdtree *tree;
} npg_look;

/* Spread over the points that are given, one at least.  NPG_MEMORY: what was got is to be closed. */
npg_status npg_look_open(npg_look *look, const float *points, size_t point_count);
void npg_look_close(npg_look *look);

/* motion: takes `from` onto `to`, found from where their middles meet and from `guess`; *unlike: what is left
 * between them then, the mean of squared distances, both ways.  NPG_MEMORY. */
npg_status npg_rigid_icp(npg_rigid *motion, double *unlike, const npg_look *from, const npg_look *to,
                         const npg_rigid *guess);

/* Recover: frames that the tracker lost, tried again from what is known of the frames around them.
 *
 * Frame by frame, outward from the key, a pose can only start from the frames before it; where the motion is
 * too fast for that, frames are lost and lead those after them astray.  But among the frames of a window some
 * are found, and each of them is a place to start from.  So a lost frame is tried again from
 *
 *     1  the poses of the frames whose points look most like its own, where those fit better: motion recurs;
 *        moved to where the body stands in this frame (rigid_icp.c), as it seldom recurs in place
 *     2  the poses of the frame before it and of the one after it, moved likewise
 *     3  the motion of the two frames before it, and of the two after it, taken on
 *     4  the poses of the frame before it and of the one after it
 *
 * and the pose that explains its points best stays.  What is found helps the frames around it, so this is
 * repeated until none is found.  A frame is lost when its Chamfer distance is well above that of the
 * window's best quarter, and so are its points' distances alone: a frame with fewer points or with holes has
 * surface far from them, too, and what it is then found by is a worse pose.  Not in the paper. */

/* A frame of a group.  pose and points are the caller's; the pose is changed where a better one is found. */
typedef struct npg_recover_frame {
    int64_t index;
    double *pose; /* K x 12 */
    npg_tracked tracked;
    npg_tracker_cloud cloud; /* count 0: nothing is known of the frame, its pose is not started from either;
                                of a fixed frame the points may be NULL */
    const float *since;      /* K: frames since a sensor saw what a node carries, or NULL: not known        */
    bool is_fixed;           /* of the group before: a place to start from, no more                         */
} npg_recover_frame;

/* What was done; frames. */
typedef struct npg_recover_result {
    int64_t tried; /* fits                       */
    int64_t lost;  /* frames that were lost      */
    int64_t found; /* of those, lost no longer   */
} npg_recover_result;

/* Recover the frames (in order of their indices).  should_stop may be NULL; it is asked before each fit.
 * Equal input gives equal bits.  NPG_MEMORY, NPG_DIVERGED, NPG_STOPPED. */
npg_status npg_recover(npg_tracker *tracker, npg_recover_result *result, npg_recover_frame *frames,
                       size_t count, bool (*should_stop)(void *user), void *user);

/* Backward tracking: frames of which sensors saw a part each, followed once more from the outermost to the key.
 *
 * Outward from the key a limb that comes into sight again is not where the pose has it: what was hidden has
 * moved meanwhile.  It is found some frames later, or only at the end.  From there the frames are followed
 * back: each one from the motion of the two beyond it, what no sensor sees held between where it was seen
 * last and where it is seen next (occlusion_prior.c).  A pose stays as it was where the way back explains the frame's
 * points clearly worse.  Not in the paper. */
/* What was done; frames. */
typedef struct npg_backward_result {
    int64_t tried; /* fits                              */
    int64_t taken; /* whose pose is that of the way back */
} npg_backward_result;

/* Sweep both sides of the key over the frames (in order of their indices); those that are fixed, without
 * points or without `since` keep their pose.  should_stop may be NULL; it is asked before each fit.  Equal
 * input gives equal bits.  NPG_MEMORY, NPG_DIVERGED, NPG_STOPPED. */
npg_status npg_track_backward(npg_tracker *tracker, npg_backward_result *result, npg_recover_frame *frames,
                              size_t count, int64_t key, bool (*should_stop)(void *user), void *user);

/* Side: the poses that the frames on one side of the keyframe start from, the last two that were found.  One
 * piece of memory, so that equal sides have equal bytes. */
typedef struct npg_side {
    size_t node_count; /* K              */
    int64_t index;     /* of `now`       */
    npg_tracked now_tracked, before_tracked;
    bool has_now, has_before;
    bool is_past; /* what a growing reference reaches */
    double now[]; /* K x 12; behind it those of the frame before, and `since` */
} npg_side;

static inline double *npg_side_before(npg_side *side)
{
    return side->now + NPG_POSE_SIZE * side->node_count;
}

/* K: frames since a sensor saw what a node carries; of now. */
static inline float *npg_side_since(npg_side *side)
{
    return (float *)(npg_side_before(side) + NPG_POSE_SIZE * side->node_count);
}

/* `now` becomes `before`, and the pose that the motion so far leads to becomes `now`, of frame `index`. */
void npg_side_step_on(npg_side *side, int64_t index);
void npg_side_copy(npg_side *to, const npg_side *from);

/* Group: the frames that wait to be aligned together, and where the two ways outward from the key stand. */

#define NPG_GROUP_FIXED 4 /* at most: frames of the group before that a list has beside those that wait */

/* A frame that waits; it owns all of it. */
typedef struct npg_waiting {
    npg_frame frame;
    npg_arena arena;         /* of the arrays below */
    double *pose;            /* K x 12 */
    float *points, *normals; /* of the frame, thinned, unit; normals or NULL */
    float *sensors;          /* unit; where they are not known NULL */
    npg_free_space *space;   /* where nothing is, or NULL; owned */
    npg_tracker_cloud cloud; /* all of these */
    float *since;            /* K: frames since a sensor saw what a node carries; NULL: no sensor is known */
    npg_tracked tracked;
    bool is_known; /* starts from the pose that the pass before found */
} npg_waiting;

typedef struct npg_group {
    npg_arena arena;     /* of both sides and ways, one behind the other */
    npg_side *sides[2];  /* forward, backward: of the frames that are passed on */
    npg_side *ways[2];   /* the same with those that wait                       */
    npg_waiting *frames; /* in order of arrival; owned, with what they own      */
    size_t count, capacity;
} npg_group;

/* Zeros become room for the poses of so many nodes.  NPG_MEMORY: what was got is to be closed. */
npg_status npg_group_open(npg_group *group, size_t node_count);
void npg_group_close(npg_group *group);

/* *waiting: a loan until the next is added; its pose is not set, nor what is made of its points.  The frame's
 * content moves there; where there is no room for that it stays.  NPG_MEMORY. */
npg_status npg_group_add(npg_waiting **waiting, npg_group *group, npg_frame *frame);

/* None waits any more. */
void npg_group_clear(npg_group *group);

/* Both sides are npg_group_bytes() bytes from sides[0] on; begin: the ways, too, are where they are. */
size_t npg_group_bytes(const npg_group *group);
void npg_group_begin(npg_group *group, const void *sides);

/* `frames` (count + NPG_GROUP_FIXED), in order of their indices: those that wait and, as fixed ones, the last
 * two of either side.  Loans of the group.  Returns how many there are. */
size_t npg_group_list(const npg_group *group, npg_recover_frame *frames);

/* What was made of that list: the frames that wait are tracked so, and the sides end with the outermost of
 * them; what follows starts from there. */
void npg_group_take(npg_group *group, npg_recover_frame *frames, size_t count);

/* Pose map: the way of a pose from the nodes of one reference to those of another. */

/* Where each new node hangs on the old graph. */
typedef struct npg_pose_map {
    size_t count;                     /* K', new nodes */
    uint32_t (*node)[NPG_GRAPH_BIND]; /* old nodes, UINT32_MAX where there are fewer; owned */
    float (*weight)[NPG_GRAPH_BIND];  /* owned */
    size_t old_count;                 /* K */
    float *old_pos;                   /* K x 3, at rest; owned */
} npg_pose_map;

/* A node of `to` hangs on what carries the nearest place of the surface of `from`.  NPG_MEMORY. */
npg_status npg_pose_map_open(npg_pose_map *map, const npg_tracker *from, const npg_tracker *to);
void npg_pose_map_close(npg_pose_map *map);

/* out (K' x 12) of `to` from a pose (K x 12) of `from`: rotations blended, nodes where the old graph takes
 * them. */
void npg_pose_map_apply(const npg_pose_map *map, const npg_tracker *to, double *out, const double *pose);

/* As blocks of a state on disk, and back (NPG_BAD_INPUT); count 0: it has none. */
npg_status npg_pose_map_save(const npg_pose_map *map, npg_store *store);
npg_status npg_pose_map_load(npg_pose_map *map, const npg_record *record);

/* Resume points: what stage align needs behind the last frame that a window waits for, until the state of that
 * window is written.  By then the stage is at work on later frames.  Any thread. */

/* Zeros are an empty list, once its lock is open. */
typedef struct npg_resume_points {
    pthread_mutex_t lock;
    struct npg_resume_point {
        int64_t read; /* frames of the plan that came before */
        unsigned char *bytes;
        size_t size;
    } * points; /* owned, with their bytes */
    size_t count, capacity;
} npg_resume_points;

void npg_resume_points_open(npg_resume_points *list);
void npg_resume_points_close(npg_resume_points *list);

/* Takes the bytes, also where it fails. */
npg_status npg_resume_points_add(npg_resume_points *list, int64_t read, unsigned char *bytes, size_t size);

/* The point behind `read` frames as a block of a state; those before it go.  NPG_FAILED: there is none. */
npg_status npg_resume_points_save(npg_resume_points *list, int64_t read, npg_store *out, const char *block);

/* Pose cache: the poses that one pass over the frames leaves to the next, which has another reference.
 *
 * A fusing pass writes the pose of each frame to the job's store (pipeline/store.h), or without a job to one without
 * a name, and keeps its tracker; the pass that follows starts from them, carried to its own nodes, and so does
 * a resumed run.  With a job each group of frames is there with what the stage needs behind it, so that a run
 * which is killed in a fusing pass does not follow these frames again: what it reads back is the same to the
 * bit.  Memory does not grow with the capture, and what was found from another reference, or by another job, is
 * not taken.
 * One thread at a time; errors are those of the store. */

/* Zeros are a pass that has nothing from another, and leaves nothing. */
typedef struct npg_pose_cache {
    npg_store *known, *found;    /* of the pass before, and of a fusing pass for the next one; or NULL */
    uint64_t known_of, found_of; /* what their poses are of                                            */
    bool owns;                   /* the stores: there is no job                                        */
    npg_pose_map map;            /* from the nodes of `known` to this pass's                           */
    double *known_pose;          /* K x 12 of its nodes; owned                                         */
    size_t node_count;           /* K' of this pass                                                    */
    int64_t group_at;            /* groups that were closed                                            */
} npg_pose_cache;

/* For the pass that `worker` is in; `tracker` is of its reference; group_bytes: of what the stage needs behind
 * a group.  What was got is the cache's also where it fails.  NPG_BAD_INPUT, NPG_DISK, NPG_MEMORY. */
npg_status npg_pose_cache_open(npg_pose_cache *cache, npg_worker *worker, const npg_tracker *tracker,
                               size_t group_bytes);
void npg_pose_cache_close(npg_pose_cache *cache);

/* pose (K' x 12) becomes what the pass before found of the frame; where it has nothing, *is_known is false
 * and the pose stays. */
npg_status npg_pose_cache_start(const npg_pose_cache *cache, const npg_tracker *tracker, int64_t index,
                                double *pose, bool *is_known);

/* Whether an earlier run has followed the group at hand; then its frames and its end are read, else written. */
bool npg_pose_cache_has_group(const npg_pose_cache *cache);
npg_status npg_pose_cache_read(const npg_pose_cache *cache, int64_t index, double *pose);
npg_status npg_pose_cache_read_end(npg_pose_cache *cache, void *state, size_t size);

/* Keep a frame's pose (K' x 12) for the next pass, and the end of its group; nothing happens where no pass
 * follows.  A pose that is no number is one that the next pass does not know. */
npg_status npg_pose_cache_put(const npg_pose_cache *cache, int64_t index, const double *pose);
npg_status npg_pose_cache_put_end(npg_pose_cache *cache, const void *state, size_t size);

/* At the end of a fusing pass: its poses, and *tracker with them, become those of the pass before; nothing
 * happens in others. */
npg_status npg_pose_cache_leave(npg_pose_cache *cache, npg_worker *worker, npg_tracker **tracker);

/* What a resumed run needs to find them, as blocks of a state. */
npg_status npg_pose_cache_save(const npg_pose_cache *cache, npg_store *out);

#endif
