/* Poses: what one pass found of every frame, for the pass that follows with a better reference.
 *
 * On disk, so that memory does not grow with the capture: a record per frame, each with its checksum
 *
 *     offset index * (8 + 48 K):  XXH3 of the pose, as uint64; K x 12 float
 *
 * and read back by a run that was stopped in the meantime.  A record that was never written is 0. */
#ifndef NPG_POSES_H
#define NPG_POSES_H

#include <stdbool.h>

#include "align/tracker.h"

typedef struct npg_poses npg_poses;

/* For poses of `node_count` nodes.  path: an empty file there (its name is kept, not owned); NULL: a file
 * without a name, which ends with the process.  NPG_DISK. */
npg_status npg_poses_create(npg_poses **poses, const char *path, size_t node_count);

/* One that was written before.  NPG_BAD_INPUT. */
npg_status npg_poses_open(npg_poses **poses, const char *path, size_t node_count);
void npg_poses_close(npg_poses **poses);

/* Nodes of each pose. */
size_t npg_poses_nodes(const npg_poses *poses);

/* pose: K x 12.  NPG_DISK. */
npg_status npg_poses_put(npg_poses *poses, int64_t index, const double *pose);

/* *is_there: whether one was put.  NPG_BAD_INPUT where what is there is damaged. */
npg_status npg_poses_get(npg_poses *poses, int64_t index, double *pose, bool *is_there);

/* Make what was put safe on disk.  NPG_DISK. */
npg_status npg_poses_sync(npg_poses *poses);

/* ---- from the nodes of one reference to those of another ---- */

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

/* As one block for a state on disk, and back (NPG_BAD_INPUT).  *bytes is owned by the caller. */
npg_status npg_pose_map_pack(const npg_pose_map *map, unsigned char **bytes, size_t *size);
npg_status npg_pose_map_unpack(npg_pose_map *map, const unsigned char *bytes, size_t size);

#endif
