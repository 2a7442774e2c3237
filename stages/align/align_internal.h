#ifndef NPG_ALIGN_INTERNAL_H
#define NPG_ALIGN_INTERNAL_H

#include <pthread.h>
#include <stdint.h>

#include "pipeline/store.h"
#include "track/track.h"

/* Align: what the files of the room share. */

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
 *     4  the poses of the frame before it and of the one after it, once others were found
 *
 * and the pose of the least cost (track.h) stays.  What is found helps the frames around it, so this is
 * repeated until none is found.  Before depth images a frame is lost when more of its points, or of the surface, is
 * astray than a few per cent; else when its Chamfer distance is well above that of the window's best quarter, and so are
 * its points' distances alone, or no other frame's is: a frame with fewer points or with holes has surface far from
 * them, too, and what it is then found by is a worse pose.  Not in the paper. */

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
    bool is_past; /* where a side of the body is followed to */
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
