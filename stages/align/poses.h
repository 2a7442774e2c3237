/* Pose map: the way of a pose from the nodes of one reference to those of another. */
#ifndef NPG_POSES_H
#define NPG_POSES_H

#include "align/tracking.h"

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
