/* Group: the frames that wait to be aligned together, and where the two ways outward from the key stand. */
#ifndef NPG_ALIGN_GROUP_H
#define NPG_ALIGN_GROUP_H

#include "align/recover.h"
#include "align/sides.h"
#include "pipeline/chunk.h"

#define NPG_GROUP_FIXED 4 /* at most: frames of the group before that a list has beside those that wait */

/* A frame that waits; it owns all of it. */
typedef struct npg_waiting {
    npg_frame frame;
    npg_arena arena;         /* of the arrays below */
    double *pose;            /* K x 12 */
    float *points, *normals; /* of the frame, thinned, unit; normals or NULL */
    float *sensors;          /* unit; where they are not known NULL */
    npg_tracker_cloud cloud; /* all of these */
    float *since;            /* K: frames since a sensor saw what a node carries; NULL: no sensor is known */
    npg_tracked tracked;
    bool is_known; /* starts from the pose that the pass before found */
} npg_waiting;

typedef struct npg_group {
    npg_arena arena;     /* of both sides and ways */
    size_t node_count;   /* K */
    npg_side sides[2];   /* forward, backward: of the frames that are passed on */
    npg_side ways[2];    /* the same with those that wait                       */
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

/* Both sides as bytes.  unpack: the ways, too, begin where the sides are. */
size_t npg_group_bytes(const npg_group *group);
unsigned char *npg_group_pack(unsigned char *to, const npg_group *group);
const unsigned char *npg_group_unpack(npg_group *group, const unsigned char *from);

/* `frames` (count + NPG_GROUP_FIXED), in order of their indices: those that wait and, as fixed ones, the last
 * two of either side.  Loans of the group.  Returns how many there are. */
size_t npg_group_list(const npg_group *group, npg_recover_frame *frames);

/* What was made of that list: the frames that wait are tracked so, and the sides end with the outermost of
 * them; what follows starts from there. */
void npg_group_take(npg_group *group, npg_recover_frame *frames, size_t count);

#endif
