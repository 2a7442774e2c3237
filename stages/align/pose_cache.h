/* Pose cache: the poses that one pass over the frames leaves to the next, which has another reference.
 *
 * A fusing pass writes the pose of each frame (poses.h) and keeps its tracker; the pass that follows starts
 * from them, carried to its own nodes.  With a job folder they lie there, and a resumed run opens them again.
 * One thread at a time; errors are those of poses.h. */
#ifndef NPG_POSE_CACHE_H
#define NPG_POSE_CACHE_H

#include "align/poses.h"
#include "pipeline/archive.h"
#include "pipeline/stage.h"

/* Zeros are a pass that has nothing from another, and leaves nothing. */
typedef struct npg_pose_cache {
    npg_poses *known; /* of the pass before, with the way to this one's nodes; owned, or NULL */
    npg_pose_map map;
    double *known_pose; /* K x 12 of its nodes; owned */
    npg_poses *found;   /* of a fusing pass, for the next one; owned, or NULL */
} npg_pose_cache;

/* For the pass that `worker` is in; `tracker` is of its reference.  What was got is the cache's also where
 * it fails.  NPG_BAD_INPUT, NPG_DISK, NPG_MEMORY. */
npg_status npg_pose_cache_open(npg_pose_cache *cache, npg_worker *worker, const npg_tracker *tracker);
void npg_pose_cache_close(npg_pose_cache *cache);

/* Fusing passes that have ended in this run. */
int64_t npg_pose_cache_passes(const npg_worker *worker);

/* pose (K' x 12) becomes what the pass before found of the frame; where it has nothing, *is_known is false
 * and the pose stays. */
npg_status npg_pose_cache_start(const npg_pose_cache *cache, const npg_tracker *tracker, int64_t index,
                                double *pose, bool *is_known);

/* Keep a frame's pose (K' x 12) for the next pass; nothing happens where none follows. */
npg_status npg_pose_cache_put(npg_pose_cache *cache, int64_t index, const double *pose);

/* At the end of a fusing pass: its poses, and *tracker with them, become those of the pass before; nothing
 * happens in others. */
npg_status npg_pose_cache_leave(npg_pose_cache *cache, npg_worker *worker, npg_tracker **tracker);

/* The map, which does not change while frames pass, as a block of a state on disk. */
npg_status npg_pose_cache_save(const npg_pose_cache *cache, npg_archive_writer *out);

#endif
