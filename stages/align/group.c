/* Group: the sides that its frames start from, and the frames as a list. */
#include "align/align_internal.h"

#include <stdlib.h>
#include <string.h>

/* ---- sides ---- */

/* A multiple of doubles: one side lies behind the other. */
static size_t side_bytes(size_t node_count)
{
    size_t floats = (node_count + 1) / 2 * sizeof(double);
    return sizeof(npg_side) + 2 * npg_pose_bytes(node_count) + floats;
}

void npg_side_copy(npg_side *to, const npg_side *from)
{
    memcpy(to, from, side_bytes(from->node_count));
}

void npg_side_step_on(npg_side *side, int64_t index)
{
    size_t nodes = side->node_count;
    double *now = side->now, *before = npg_side_before(side);
    if (side->has_before)
        npg_pose_extrapolate(before, now, before, nodes);
    else
        memcpy(before, now, npg_pose_bytes(nodes));
    for (size_t i = 0; i < NPG_POSE_SIZE * nodes; i++) {
        double next = before[i];
        before[i] = now[i];
        now[i] = next;
    }
    side->before_tracked = side->now_tracked;
    side->has_before = true;
    side->index = index;
}

/* ---- the group ---- */

npg_status npg_group_open(npg_group *group, size_t node_count)
{
    size_t bytes = side_bytes(node_count);
    *group = (npg_group){.arena = {.purpose = NPG_FOR_FIT}};
    char *all = npg_arena_take(&group->arena, 4, bytes);
    NPG_TRY(npg_arena_status(&group->arena));
    for (size_t i = 0; i < 4; i++) {
        npg_side *side = (npg_side *)(void *)(all + i * bytes);
        side->node_count = node_count;
        npg_pose_rest(side->now, node_count);
        *(i < 2 ? &group->sides[i] : &group->ways[i - 2]) = side;
    }
    return NPG_OK;
}

size_t npg_group_bytes(const npg_group *group)
{
    return 2 * side_bytes(group->sides[0]->node_count);
}

void npg_group_begin(npg_group *group, const void *sides)
{
    memcpy(group->sides[0], sides, npg_group_bytes(group));
    memcpy(group->ways[0], sides, npg_group_bytes(group));
}

void npg_group_clear(npg_group *group)
{
    for (size_t i = 0; i < group->count; i++) {
        npg_frame_clear(&group->frames[i].frame);
        npg_free_space_close(&group->frames[i].space);
        npg_arena_release(&group->frames[i].arena);
    }
    group->count = 0;
}

void npg_group_close(npg_group *group)
{
    npg_group_clear(group);
    npg_release(&group->frames);
    npg_arena_release(&group->arena);
}

npg_status npg_group_add(npg_waiting **waiting, npg_group *group, npg_frame *frame)
{
    NPG_TRY(npg_grow(&group->frames, &group->capacity, group->count + 1, sizeof *group->frames, NPG_FOR_FIT));
    npg_waiting *w = *waiting = &group->frames[group->count++];
    *w = (npg_waiting){.frame = *frame, .arena = {.purpose = NPG_FOR_FIT}};
    memset(frame, 0, sizeof *frame);
    w->pose = npg_arena_take(&w->arena, 1, npg_pose_bytes(group->sides[0]->node_count));
    return npg_arena_status(&w->arena);
}

/* ---- the frames as a list ---- */

static int by_index(const void *a, const void *b)
{
    const npg_recover_frame *x = a, *y = b;
    return (x->index > y->index) - (x->index < y->index);
}

size_t npg_group_list(const npg_group *group, npg_recover_frame *frames)
{
    const npg_tracker_cloud known = {.count = 1};
    size_t count = 0;
    for (size_t i = 0; i < group->count; i++) {
        const npg_waiting *w = &group->frames[i];
        frames[count++] = (npg_recover_frame){w->frame.index, w->pose, w->tracked, w->cloud, w->since, false};
    }
    for (int d = 0; d < 2; d++) {
        npg_side *at = group->sides[d];
        int64_t away = d ? 1 : -1;
        if (at->has_now) /* the key, which both sides begin with, once */
            frames[count++] = (npg_recover_frame){at->index, at->now, at->now_tracked, known, NULL, true};
        if (at->has_now && at->has_before && at->before_tracked.steps)
            frames[count++] = (npg_recover_frame){
                at->index + away, npg_side_before(at), at->before_tracked, known, NULL, true};
    }
    qsort(frames, count, sizeof *frames, by_index);
    size_t kept = 0;
    for (size_t i = 0; i < count; i++)
        if (!kept || frames[i].index != frames[kept - 1].index) frames[kept++] = frames[i];
    return kept;
}

static npg_recover_frame *frame_of(npg_recover_frame *frames, size_t count, int64_t index)
{
    for (size_t i = 0; i < count; i++)
        if (frames[i].index == index) return &frames[i];
    return NULL;
}

static void move_side(npg_group *group, int d, npg_recover_frame *frames, size_t count)
{
    npg_side *way = group->ways[d];
    size_t bytes = npg_pose_bytes(way->node_count);
    int64_t away = d ? 1 : -1;
    const npg_recover_frame *now = frame_of(frames, count, way->index);
    const npg_recover_frame *before = frame_of(frames, count, way->index + away);
    if (!now || now->is_fixed) return;
    memcpy(way->now, now->pose, bytes);
    way->now_tracked = now->tracked;
    way->has_before = way->has_before && before;
    if (way->has_before) {
        memcpy(npg_side_before(way), before->pose, bytes);
        way->before_tracked = before->tracked;
    }
    npg_side_copy(group->sides[d], way);
}

void npg_group_take(npg_group *group, npg_recover_frame *frames, size_t count)
{
    for (size_t i = 0; i < group->count; i++)
        group->frames[i].tracked = frame_of(frames, count, group->frames[i].frame.index)->tracked;
    for (int d = 0; d < 2; d++) move_side(group, d, frames, count);
}
