/* Outside: what leaves the box that the look-ahead gave. */
#include "keyframe/keyframe_internal.h"

#include <math.h>
#include <string.h>

#include "pipeline/plan.h"

#define BLOCK     1024 /* points turned into unit coordinates at a time */
#define TOLD_EACH 5    /* frames outside the box that are named one by one */

void npg_outside_open(npg_outside *outside)
{
    pthread_mutex_init(&outside->lock, NULL);
}

void npg_outside_close(npg_outside *outside)
{
    npg_release(&outside->frames);
    pthread_mutex_destroy(&outside->lock);
}

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

static npg_status add(npg_outside *outside, const npg_outside_frame *frame)
{
    pthread_mutex_lock(&outside->lock);
    npg_status status = npg_grow(&outside->frames, &outside->capacity, outside->count + 1,
                                 sizeof *outside->frames, NPG_FOR_RUN);
    if (!status) outside->frames[outside->count++] = *frame;
    pthread_mutex_unlock(&outside->lock);
    return status;
}

npg_status npg_outside_watch(npg_worker *worker, npg_outside *outside, const npg_frame *frame)
{
    double share = frame->is_skipped ? 0 : share_outside(&npg_worker_facts(worker)->box, frame);
    const npg_outside_frame found = {frame->index, frame->number, share};
    if (!(share > 0)) return NPG_OK;
    if (outside->count < TOLD_EACH)
        npg_worker_warn(worker, false, frame->number,
                        "leaves the box that the look-ahead gave by %.1f %% of its longest side",
                        100 * share);
    return add(outside, &found);
}

void npg_outside_tell(npg_worker *worker, const npg_outside *outside)
{
    npg_outside_frame worst = {0};
    json_object_set_new(npg_worker_report(worker), "outside_box", json_integer((json_int_t)outside->count));
    for (size_t i = 0; i < outside->count; i++)
        if (outside->frames[i].share > worst.share) worst = outside->frames[i];
    if (outside->count)
        npg_worker_warn(worker, false, worst.number,
                        "%zu frames leave the box that the look-ahead gave; "
                        "this one by most, %.1f %% of its longest side (option box-margin leaves more room)",
                        outside->count, 100 * worst.share);
}

/* ---- states on disk ---- */

#define BLOCK_OUTSIDE "outside"

npg_status npg_outside_save(npg_outside *outside, npg_store *out)
{
    pthread_mutex_lock(&outside->lock);
    size_t size = outside->count * sizeof *outside->frames;
    npg_status status = size ? npg_store_put(out, BLOCK_OUTSIDE, outside->frames, size) : NPG_OK;
    pthread_mutex_unlock(&outside->lock);
    return status;
}

npg_status npg_outside_restore(npg_outside *outside, const npg_record *in, const npg_facts *facts)
{
    size_t size;
    const npg_outside_frame *saved = npg_record_find(in, BLOCK_OUTSIDE, &size);
    for (size_t i = 0; saved && i < size / sizeof *saved; i++) {
        npg_outside_frame one;
        memcpy(&one, saved + i, sizeof one);
        if (npg_plan_is_read(&facts->plan, one.index, facts->resumed_read, facts->frame_count))
            NPG_TRY(add(outside, &one));
    }
    return NPG_OK;
}
