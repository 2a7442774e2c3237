/* Sides: two poses each, and their bytes. */
#include "align/align_internal.h"

#include <string.h>

#include "align/tracking.h"

npg_status npg_side_open(npg_side *side, npg_arena *arena, size_t node_count)
{
    side->now = npg_arena_take(arena, node_count, NPG_POSE_SIZE * sizeof(double));
    side->before = npg_arena_take(arena, node_count, NPG_POSE_SIZE * sizeof(double));
    side->since = npg_arena_take(arena, node_count, sizeof *side->since);
    NPG_TRY(npg_arena_status(arena));
    npg_pose_rest(side->now, node_count);
    return NPG_OK;
}

void npg_side_copy(npg_side *to, const npg_side *from, size_t node_count)
{
    npg_side copy = *from;
    copy.now = to->now;
    copy.before = to->before;
    copy.since = to->since;
    memcpy(copy.now, from->now, npg_pose_bytes(node_count));
    memcpy(copy.before, from->before, npg_pose_bytes(node_count));
    memcpy(copy.since, from->since, node_count * sizeof *copy.since);
    *to = copy;
}

void npg_side_step_on(npg_side *side, size_t node_count, int64_t index)
{
    double *start = side->before; /* its content is not needed once the extrapolation is made */
    if (side->has_before)
        npg_pose_extrapolate(start, side->now, side->before, node_count);
    else
        memcpy(start, side->now, npg_pose_bytes(node_count));
    side->before = side->now;
    side->before_tracked = side->now_tracked;
    side->now = start;
    side->has_before = true;
    side->index = index;
}

/* ---- bytes ---- */

size_t npg_side_bytes(size_t node_count)
{
    return sizeof(npg_side) + 2 * npg_pose_bytes(node_count) + node_count * sizeof(float);
}

/* A side without its arrays; no padding is left to chance. */
static void strip(npg_side *plain, const npg_side *from)
{
    memset(plain, 0, sizeof *plain);
    plain->index = from->index;
    plain->has_now = from->has_now;
    plain->has_before = from->has_before;
    plain->is_past = from->is_past;
    plain->now_tracked = from->now_tracked;
    plain->before_tracked = from->before_tracked;
}

unsigned char *npg_side_pack(unsigned char *to, const npg_side *side, size_t node_count)
{
    npg_side plain;
    size_t bytes = npg_pose_bytes(node_count);
    strip(&plain, side);
    memcpy(to, &plain, sizeof plain);
    memcpy(to + sizeof plain, side->now, bytes);
    memcpy(to + sizeof plain + bytes, side->before, bytes);
    memcpy(to + sizeof plain + 2 * bytes, side->since, node_count * sizeof *side->since);
    return to + npg_side_bytes(node_count);
}

const unsigned char *npg_side_unpack(npg_side *side, const unsigned char *from, size_t node_count)
{
    npg_side plain;
    size_t bytes = npg_pose_bytes(node_count);
    memcpy(&plain, from, sizeof plain);
    plain.now = side->now;
    plain.before = side->before;
    plain.since = side->since;
    memcpy(plain.now, from + sizeof plain, bytes);
    memcpy(plain.before, from + sizeof plain + bytes, bytes);
    memcpy(plain.since, from + sizeof plain + 2 * bytes, node_count * sizeof *plain.since);
    *side = plain;
    return from + npg_side_bytes(node_count);
}
