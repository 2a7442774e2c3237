#include "align/align_internal.h"

#include <stdlib.h>
#include <string.h>

#include "pipeline/memory.h"

npg_status npg_group_open(npg_group *group, size_t node_count)
{
    *group = (npg_group){.node_count = node_count, .arena = {.purpose = NPG_FOR_FIT}};
    for (int i = 0; i < 2; i++) {
        NPG_TRY(npg_side_open(&group->sides[i], &group->arena, node_count));
        NPG_TRY(npg_side_open(&group->ways[i], &group->arena, node_count));
    }
    return NPG_OK;
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
    w->pose = npg_arena_take(&w->arena, 1, npg_pose_bytes(group->node_count));
    return npg_arena_status(&w->arena);
}

/* ---- the sides as bytes ---- */

size_t npg_group_bytes(const npg_group *group)
{
    return 2 * npg_side_bytes(group->node_count);
}

unsigned char *npg_group_pack(unsigned char *to, const npg_group *group)
{
    for (int i = 0; i < 2; i++) to = npg_side_pack(to, &group->sides[i], group->node_count);
    return to;
}

const unsigned char *npg_group_unpack(npg_group *group, const unsigned char *from)
{
    for (int i = 0; i < 2; i++) {
        from = npg_side_unpack(&group->sides[i], from, group->node_count);
        npg_side_copy(&group->ways[i], &group->sides[i], group->node_count);
    }
    return from;
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
        const npg_side *at = &group->sides[d];
        int64_t away = d ? 1 : -1;
        if (at->has_now) /* the key, which both sides begin with, once */
            frames[count++] = (npg_recover_frame){at->index, at->now, at->now_tracked, known, NULL, true};
        if (at->has_now && at->has_before && at->before_tracked.steps)
            frames[count++] =
                (npg_recover_frame){at->index + away, at->before, at->before_tracked, known, NULL, true};
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
    size_t bytes = npg_pose_bytes(group->node_count);
    npg_side *way = &group->ways[d];
    int64_t away = d ? 1 : -1;
    const npg_recover_frame *now = frame_of(frames, count, way->index);
    const npg_recover_frame *before = frame_of(frames, count, way->index + away);
    if (!now || now->is_fixed) return;
    memcpy(way->now, now->pose, bytes);
    way->now_tracked = now->tracked;
    way->has_before = way->has_before && before;
    if (way->has_before) {
        memcpy(way->before, before->pose, bytes);
        way->before_tracked = before->tracked;
    }
    npg_side_copy(&group->sides[d], way, group->node_count);
}

void npg_group_take(npg_group *group, npg_recover_frame *frames, size_t count)
{
    for (size_t i = 0; i < group->count; i++)
        group->frames[i].tracked = frame_of(frames, count, group->frames[i].frame.index)->tracked;
    for (int d = 0; d < 2; d++) move_side(group, d, frames, count);
}
