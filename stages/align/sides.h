/* Sides: the poses that the frames on one side of the keyframe start from, the last two that were found. */
#ifndef NPG_ALIGN_SIDES_H
#define NPG_ALIGN_SIDES_H

#include "align/tracker.h"

typedef struct npg_side {
    double *now, *before; /* K x 12 */
    float *since;         /* K: frames since a sensor saw what a node carries; of now */
    int64_t index;        /* of now */
    bool has_now, has_before;
    bool is_past; /* what a growing reference reaches */
    npg_tracked now_tracked, before_tracked;
} npg_side;

/* Zeros become a side at rest without any frame, its arrays the arena's; K nodes, here and below.
 * NPG_MEMORY. */
npg_status npg_side_open(npg_side *side, npg_arena *arena, size_t node_count);

/* Content, not arrays. */
void npg_side_copy(npg_side *to, const npg_side *from, size_t node_count);

/* `now` becomes `before`, and the pose that the motion so far leads to becomes `now`, of frame `index`. */
void npg_side_step_on(npg_side *side, size_t node_count, int64_t index);

/* To npg_side_bytes() bytes, which are the same for equal sides, and back; both return where they end. */
size_t npg_side_bytes(size_t node_count);
unsigned char *npg_side_pack(unsigned char *to, const npg_side *side, size_t node_count);
const unsigned char *npg_side_unpack(npg_side *side, const unsigned char *from, size_t node_count);

#endif
