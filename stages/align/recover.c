/* Recover: which frames are lost, where they may start from, and the sweeps over them. */
#include "align/recover.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/kdtree.h"
#include "geometry/mesh_tools.h"
#include "pipeline/order.h"

/* Set by trial on a fast gallop: samples/guide/why_these_defaults.md, lost frames. */
#define LOST        1.4  /* times the Chamfer distance of the best quarter                              */
#define LEVEL_LEAST 1e-6 /* square units: what is below does not matter                                 */
#define BETTER      0.95 /* times a frame's Chamfer distance: what a new pose must reach                */
#define SWEEPS      5    /* at most                                                                     */
#define ALIKE       3    /* frames whose points look alike that are started from                        */
#define LOOK_POINTS 500  /* of a frame, for that                                                        */
#define VAIN_MOST   4    /* lost frames in a row that no start finds: the reference does not fit        */
#define STARTS_MOST (ALIKE + 4)

/* The usual fit begins ten times as stiff as it ends, and its weight is 0.08 wide.  A lost frame has moved
 * farther than that: more steps, a stiffer beginning that moves the body as a whole, and two, then four times
 * the width.  What is lost must not slide away along the surface, hence ten times `along`. */
static const npg_tracker_effort wide = {.steps = 40, .stiffness = 100, .width_unit = 0.2, .along = 10};
static const npg_tracker_effort wider = {.steps = 80, .stiffness = 100, .width_unit = 0.4, .along = 10};

typedef struct recovery {
    npg_attempts attempts; /* its `trial` is owned */
    npg_recover_frame *frames;
    size_t count;
    double level;       /* Chamfer distance of the best quarter */
    double *sorted;     /* count, scratch; owned                */
    float *looks;       /* count x LOOK_POINTS x 3; owned       */
    size_t *look_count; /* count; owned                         */
    size_t *lost;       /* count: which are lost; owned         */
    npg_recover_result *result;
} recovery;

static bool is_known(const npg_recover_frame *frame)
{
    return frame->cloud.count > 0;
}

static bool is_lost(const recovery *r, const npg_recover_frame *frame)
{
    return is_known(frame) && frame->tracked.chamfer > LOST * r->level;
}

static void set_level(recovery *r)
{
    size_t known = 0;
    for (size_t i = 0; i < r->count; i++)
        if (is_known(&r->frames[i])) r->sorted[known++] = r->frames[i].tracked.chamfer;
    qsort(r->sorted, known, sizeof *r->sorted, npg_order_double);
    r->level = fmax(LEVEL_LEAST, known ? r->sorted[known / 4] : 0);
}

/* ---- frames that look alike ---- */

/* Chamfer distance of the thinned points of two frames. */
static npg_status unlikeness(double *sum, const recovery *r, size_t a, size_t b)
{
    uint32_t near[LOOK_POINTS];
    float dist_sq[LOOK_POINTS];
    *sum = 0;
    for (int way = 0; way < 2; way++) {
        size_t of = way ? a : b, from = way ? b : a, count = r->look_count[from];
        npg_kdtree *tree;
        double part = 0;
        NPG_TRY(npg_kdtree_open(&tree, r->looks + of * LOOK_POINTS * 3, r->look_count[of]));
        npg_status status =
            npg_kdtree_nearest(tree, near, dist_sq, r->looks + from * LOOK_POINTS * 3, count, 1, 1);
        npg_kdtree_close(&tree);
        NPG_TRY(status);
        for (size_t i = 0; i < count; i++) part += (double)dist_sq[i];
        *sum += part / (double)count;
    }
    return NPG_OK;
}

/* The frames most like frame i that its tracker explains better, the most alike first. */
static npg_status find_alike(size_t alike[ALIKE], size_t *found, const recovery *r, size_t i)
{
    double sums[ALIKE];
    *found = 0;
    for (size_t k = 0; k < r->count; k++) {
        const npg_recover_frame *frame = &r->frames[k];
        double sum;
        if (k == i || !r->look_count[k] || frame->tracked.chamfer >= r->frames[i].tracked.chamfer) continue;
        NPG_TRY(unlikeness(&sum, r, i, k));
        size_t at = *found;
        for (; at > 0 && sum < sums[at - 1]; at--)
            if (at < ALIKE) sums[at] = sums[at - 1], alike[at] = alike[at - 1];
        if (at == ALIKE) continue;
        sums[at] = sum;
        alike[at] = k;
        *found += *found < ALIKE;
    }
    return NPG_OK;
}

/* ---- one frame ---- */

/* The frame `away` places from i in time, where it is there and has a pose. */
static const npg_recover_frame *frame_at(const recovery *r, size_t i, int away)
{
    int64_t at = (int64_t)i + away;
    if (at < 0 || at >= (int64_t)r->count) return NULL;
    const npg_recover_frame *frame = &r->frames[at];
    return frame->index == r->frames[i].index + away && is_known(frame) ? frame : NULL;
}

static npg_status find_starts(npg_start starts[STARTS_MOST], size_t *count, const recovery *r, size_t i,
                              int sweep)
{
    size_t alike[ALIKE], found;
    *count = 0;
    NPG_TRY(find_alike(alike, &found, r, i));
    for (size_t k = 0; k < found; k++) starts[(*count)++] = (npg_start){r->frames[alike[k]].pose, NULL, NULL};
    for (int way = -1; way <= 1; way += 2) {
        const npg_recover_frame *now = frame_at(r, i, way), *before = frame_at(r, i, 2 * way);
        if (now && before && !is_lost(r, now))
            starts[(*count)++] = (npg_start){now->pose, before->pose, &wide};
    }
    for (int way = -1; way <= 1; way += 2) {
        const npg_recover_frame *now = frame_at(r, i, way);
        if (now && !is_lost(r, now))
            starts[(*count)++] = (npg_start){now->pose, NULL, sweep ? &wider : &wide};
    }
    return NPG_OK;
}

static npg_status try_start(recovery *r, npg_recover_frame *frame, const npg_start *from)
{
    const npg_hold hold = {.pose = from->now};
    bool taken;
    NPG_TRY(npg_attempt(&r->attempts, &taken, frame, from, &hold, BETTER));
    r->result->tried++;
    return NPG_OK;
}

static npg_status recover_frame(recovery *r, size_t i, int sweep)
{
    npg_recover_frame *frame = &r->frames[i];
    npg_start starts[STARTS_MOST];
    size_t count;
    NPG_TRY(find_starts(starts, &count, r, i, sweep));
    for (size_t k = 0; k < count && is_lost(r, frame); k++) NPG_TRY(try_start(r, frame, &starts[k]));
    return NPG_OK;
}

/* ---- all of them ---- */

/* How well the better of the two frames beside it is explained. */
static double best_beside(const recovery *r, size_t i)
{
    const npg_recover_frame *before = frame_at(r, i, -1), *after = frame_at(r, i, 1);
    return fmin(before ? before->tracked.chamfer : HUGE_VAL, after ? after->tracked.chamfer : HUGE_VAL);
}

/* The lost frames, those beside the best ones first. */
static size_t list_lost(recovery *r)
{
    size_t count = 0;
    for (size_t i = 0; i < r->count; i++) {
        if (r->frames[i].is_fixed || !is_lost(r, &r->frames[i])) continue;
        size_t at = count++;
        for (; at > 0 && best_beside(r, i) < best_beside(r, r->lost[at - 1]); at--)
            r->lost[at] = r->lost[at - 1];
        r->lost[at] = i;
    }
    return count;
}

static npg_status sweep_once(bool *is_found, recovery *r, size_t lost_count, int sweep)
{
    int vain = 0;
    *is_found = false;
    for (size_t k = 0; k < lost_count && vain < VAIN_MOST; k++) {
        NPG_TRY(recover_frame(r, r->lost[k], sweep));
        bool is_this_found = !is_lost(r, &r->frames[r->lost[k]]);
        vain = is_this_found ? 0 : vain + 1;
        *is_found |= is_this_found;
    }
    return NPG_OK;
}

static npg_status open_recovery(recovery *r)
{
    NPG_TRY(npg_alloc_array(&r->sorted, NPG_FOR_FIT, r->count, sizeof *r->sorted));
    NPG_TRY(npg_alloc_array(&r->lost, NPG_FOR_FIT, r->count, sizeof *r->lost));
    set_level(r);
    if (!list_lost(r)) return NPG_END;
    NPG_TRY(npg_alloc(&r->attempts.trial, NPG_FOR_FIT,
                      npg_pose_bytes(npg_tracker_node_count(r->attempts.tracker))));
    NPG_TRY(npg_alloc_array(&r->looks, NPG_FOR_FIT, r->count * LOOK_POINTS, 3 * sizeof *r->looks));
    NPG_TRY(npg_alloc_array(&r->look_count, NPG_FOR_FIT, r->count, sizeof *r->look_count));
    for (size_t i = 0; i < r->count; i++) {
        const npg_recover_frame *frame = &r->frames[i];
        if (frame->cloud.points)
            r->look_count[i] = npg_points_spread(r->looks + i * LOOK_POINTS * 3, NULL, LOOK_POINTS,
                                                 frame->cloud.points, NULL, frame->cloud.count);
    }
    return NPG_OK;
}

static npg_status run_sweeps(recovery *r)
{
    bool is_found = true;
    for (int sweep = 0; sweep < SWEEPS && is_found; sweep++) {
        set_level(r);
        size_t lost = list_lost(r);
        if (!sweep) r->result->lost = (int64_t)lost;
        NPG_TRY(sweep_once(&is_found, r, lost, sweep));
    }
    set_level(r);
    r->result->found = r->result->lost - (int64_t)list_lost(r);
    if (r->result->found < 0) r->result->found = 0; /* the level has fallen: more count as lost now */
    return NPG_OK;
}

npg_status npg_recover(npg_tracker *tracker, npg_recover_result *result, npg_recover_frame *frames,
                       size_t count, bool (*should_stop)(void *user), void *user)
{
    recovery r = {.attempts = {tracker, NULL, "lost frames were tried again", should_stop, user},
                  .frames = frames,
                  .count = count,
                  .result = result};
    *result = (npg_recover_result){0};
    npg_status status = open_recovery(&r);
    if (!status) status = run_sweeps(&r);
    void *all[] = {&r.sorted, &r.attempts.trial, &r.looks, &r.look_count, &r.lost};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) npg_release(all[i]);
    return status == NPG_END ? NPG_OK : status;
}
