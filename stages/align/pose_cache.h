/* Pose cache: the poses that one pass over the frames leaves to the next, which has another reference.
 *
 * A fusing pass writes the pose of each frame to the job's store (pipeline/store.h), or without a job to one without
 * a name, and keeps its tracker; the pass that follows starts from them, carried to its own nodes, and so does
 * a resumed run.  With a job each group of frames is there with what the stage needs behind it, so that a run
 * which is killed in a fusing pass does not follow these frames again: what it reads back is the same to the
 * bit.  Memory does not grow with the capture, and what was found from another reference, or by another job, is
 * not taken.
 * One thread at a time; errors are those of the store. */
#ifndef NPG_POSE_CACHE_H
#define NPG_POSE_CACHE_H

#include "align/poses.h"
#include "pipeline/stage.h"
#include "pipeline/store.h"

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
