/* Look-ahead: the frames of a live source that wait for their turn. */
#include "keyframe/look_ahead.h"

#include <math.h>
#include <string.h>

#include "pipeline/live_plan.h"

#define BLOCK     1024 /* points turned into unit coordinates at a time */
#define TOLD_EACH 5    /* frames outside the box that are named one by one */

npg_status npg_look_ahead_add(npg_look_ahead *held, npg_frame *frame)
{
    NPG_TRY(npg_grow(&held->frames, &held->capacity, held->count + 1, sizeof *held->frames, NPG_FOR_FRAMES));
    held->frames[held->count++] = *frame;
    *frame = (npg_frame){0};
    return NPG_OK;
}

int64_t npg_look_ahead_frame_count(const npg_look_ahead *held)
{
    int64_t count = 0;
    for (size_t i = 0; i < held->count; i++)
        if (held->frames[i].index >= count) count = held->frames[i].index + 1;
    return count;
}

static npg_frame *frame_at(const npg_look_ahead *held, int64_t index)
{
    for (size_t i = 0; i < held->count; i++)
        if (held->frames[i].index == index) return &held->frames[i];
    return NULL;
}

static npg_status push(npg_worker *worker, npg_look_ahead *held, npg_frame *frame)
{
    npg_chunk *chunk;
    NPG_TRY(npg_chunk_open(&chunk, 1));
    frame->is_key = frame->index == npg_worker_facts(worker)->plan.key;
    frame->fields |= NPG_FIELD_KEY;
    npg_chunk_add(chunk, frame);
    size_t at = (size_t)(frame - held->frames);
    memmove(frame, frame + 1, (--held->count - at) * sizeof *frame);
    memset(&held->frames[held->count], 0, sizeof *frame);
    npg_status status = npg_worker_push(worker, &chunk);
    npg_chunk_unref(&chunk);
    return status;
}

npg_status npg_look_ahead_release(npg_worker *worker, npg_look_ahead *held, size_t limit, bool at_end)
{
    const npg_plan *plan = &npg_worker_facts(worker)->plan;
    while (held->count) {
        int64_t index = npg_live_frame(plan, held->next);
        npg_frame *frame = frame_at(held, index);
        if (!frame && !at_end && held->count <= limit) return NPG_OK;
        if (!frame && !at_end)
            return npg_error(NPG_FAILED, "the frame with index %lld never came", (long long)index);
        held->next++;
        if (frame) NPG_TRY(push(worker, held, frame));
    }
    return NPG_OK;
}

/* ---- what leaves the box ---- */

/* How far the farthest finite point lies outside [-1, 1], in longest sides of the box. */
static double share_outside(const npg_frame_box *box, const npg_frame *frame)
{
    float unit[3 * BLOCK], far = 0;
    for (size_t first = 0; first < frame->point_count; first += BLOCK) {
        size_t count = frame->point_count - first < BLOCK ? frame->point_count - first : BLOCK;
        npg_box_local_to_unit(box, unit, frame->pos_local + 3 * first, count);
        for (size_t i = 0; i < 3 * count; i++)
            if (isfinite(unit[i])) far = fmaxf(far, fabsf(unit[i]));
    }
    return far > 1 ? ((double)far - 1) / (2 * NPG_UNIT_EXTENT) : 0;
}

void npg_look_ahead_watch(npg_worker *worker, npg_look_ahead *held, const npg_frame *frame)
{
    double share = frame->is_skipped ? 0 : share_outside(&npg_worker_facts(worker)->box, frame);
    if (!(share > 0)) return;
    if (held->outside_count++ < TOLD_EACH)
        npg_worker_warn(worker, false, frame->number,
                        "leaves the box that the look-ahead gave by %.1f %% of its longest side",
                        100 * share);
    if (share > held->worst_share) {
        held->worst_share = share;
        held->worst_number = frame->number;
    }
}

void npg_look_ahead_tell_outside(npg_worker *worker, const npg_look_ahead *held)
{
    json_object_set_new(npg_worker_report(worker), "outside_box",
                        json_integer((json_int_t)held->outside_count));
    if (held->outside_count)
        npg_worker_warn(worker, false, held->worst_number,
                        "%lld frames leave the box that the look-ahead gave; "
                        "this one by most, %.1f %% of its longest side (option box-margin leaves more room)",
                        (long long)held->outside_count, 100 * held->worst_share);
}

void npg_look_ahead_clear(npg_look_ahead *held)
{
    for (size_t i = 0; i < held->count; i++) npg_frame_clear(&held->frames[i]);
    npg_release(&held->frames);
    *held = (npg_look_ahead){0};
}
