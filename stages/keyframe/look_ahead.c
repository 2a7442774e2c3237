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

static npg_status add_outside(npg_look_ahead *held, const npg_outside *frame)
{
    pthread_mutex_lock(held->lock);
    npg_status status = npg_grow(&held->outside, &held->outside_capacity, held->outside_count + 1,
                                 sizeof *held->outside, NPG_FOR_RUN);
    if (!status) held->outside[held->outside_count++] = *frame;
    pthread_mutex_unlock(held->lock);
    return status;
}

npg_status npg_look_ahead_watch(npg_worker *worker, npg_look_ahead *held, const npg_frame *frame)
{
    double share = frame->is_skipped ? 0 : share_outside(&npg_worker_facts(worker)->box, frame);
    const npg_outside found = {frame->index, frame->number, share};
    if (!(share > 0)) return NPG_OK;
    if (held->outside_count < TOLD_EACH)
        npg_worker_warn(worker, false, frame->number,
                        "leaves the box that the look-ahead gave by %.1f %% of its longest side",
                        100 * share);
    return add_outside(held, &found);
}

void npg_look_ahead_tell_outside(npg_worker *worker, const npg_look_ahead *held)
{
    npg_outside worst = {0};
    json_object_set_new(npg_worker_report(worker), "outside_box",
                        json_integer((json_int_t)held->outside_count));
    for (size_t i = 0; i < held->outside_count; i++)
        if (held->outside[i].share > worst.share) worst = held->outside[i];
    if (held->outside_count)
        npg_worker_warn(worker, false, worst.number,
                        "%zu frames leave the box that the look-ahead gave; "
                        "this one by most, %.1f %% of its longest side (option box-margin leaves more room)",
                        held->outside_count, 100 * worst.share);
}

/* ---- states on disk ---- */

#define BLOCK_OUTSIDE "outside"

npg_status npg_look_ahead_save(const npg_look_ahead *held, npg_archive_writer *out)
{
    pthread_mutex_lock(held->lock);
    size_t size = held->outside_count * sizeof *held->outside;
    npg_status status = size ? npg_archive_put(out, BLOCK_OUTSIDE, held->outside, size) : NPG_OK;
    pthread_mutex_unlock(held->lock);
    return status;
}

npg_status npg_look_ahead_restore(npg_look_ahead *held, const npg_archive *in, const npg_facts *facts)
{
    size_t size;
    const npg_outside *saved = npg_archive_find(in, BLOCK_OUTSIDE, &size);
    for (size_t i = 0; saved && i < size / sizeof *saved; i++) {
        npg_outside one;
        memcpy(&one, saved + i, sizeof one);
        if (npg_live_is_read(&facts->plan, one.index, facts->resumed_read, facts->frame_count))
            NPG_TRY(add_outside(held, &one));
    }
    return NPG_OK;
}

void npg_look_ahead_clear(npg_look_ahead *held)
{
    for (size_t i = 0; i < held->count; i++) npg_frame_clear(&held->frames[i]);
    npg_release(&held->frames);
    npg_release(&held->outside);
    *held = (npg_look_ahead){0};
}
