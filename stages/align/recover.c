/* Recover: which frames are lost, where they may start from, and the sweeps over them. */
#include "align/align_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

#include "geometry/limits.h"
#include "pipeline/order.h"

/* Set by trial on a fast gallop: tests/bed/decisions.md, lost frames. */
#define LOST        1.4  /* times what the best quarter has: its Chamfer distance, and ...              */
#define MORE        1.1  /* ... its points' distances alone, which holes do not raise; the least excess */
#define APART       10   /* times what lies between the best quarter and the middle: no chance          */
#define LEVEL_LEAST 1e-6 /* square units: what is below does not matter                                 */
#define BETTER      0.95 /* times the cost of a frame's pose: what a new one must reach                 */
#define SWEEPS      5    /* at most                                                                     */
#define ALIKE       3    /* frames whose points look alike that are started from                        */
#define VAIN_MOST   4    /* lost frames in a row that no start finds: the reference does not fit        */
#define WORSE       (2 - BETTER) /* what the way back may have, for what it says of the rest */
#define STARTS_MOST (ALIKE + 6)
#define MOVED_MOST  (ALIKE + 2) /* of these from poses that are moved first */

/* The usual fit begins ten times as stiff as it ends, and its weight is 0.08 wide.  A lost frame has moved
 * farther than that: more steps, a stiffer beginning that moves the body as a whole, and two, then four times
 * the width.  What is lost must not slide away along the surface, hence ten times `along`. */
static const npg_tracker_effort wide = {.steps = 40, .stiffness = 100, .width_unit = 0.2, .along = 10};
static const npg_tracker_effort wider = {.steps = 80, .stiffness = 100, .width_unit = 0.4, .along = 10};

/* ---- one fit, compared ---- */

/* Who tries, and what for. */
typedef struct attempts {
    npg_tracker *tracker;
    double *trial;    /* K x 12, scratch                                   */
    const char *what; /* is done with frames, for the error: "followed on" */
    bool (*should_stop)(void *user);
    void *user;
} attempts;

/* Where an attempt starts. */
typedef struct start {
    const double *now, *before;       /* K x 12; before: NULL, or the motion since then goes on */
    const npg_tracker_effort *effort; /* NULL: the usual one */
} start;

/* Fit the frame from there, hidden parts held by `poses`.  *taken: whether its pose and what was tracked
 * become the new ones, those of a cost of at most `share` times the old one. */
static npg_status attempt(const attempts *a, bool *taken, npg_recover_frame *frame, const start *from,
                          const npg_prior_poses *poses, double share)
{
    size_t nodes = npg_tracker_node_count(a->tracker), bytes = npg_pose_bytes(nodes);
    npg_tracker_effort effort = from->effort ? *from->effort : npg_tracker_usual(a->tracker);
    npg_tracked tracked;
    effort.cost_best = fmax(share, 1) * frame->tracked.cost;
    effort.cost_most = share * frame->tracked.cost;
    *taken = false;
    if (a->should_stop && a->should_stop(a->user)) return npg_error(NPG_STOPPED, "stopped while %s", a->what);
    if (from->before)
        npg_pose_extrapolate(a->trial, from->now, from->before, nodes);
    else
        memcpy(a->trial, from->now, bytes);
    NPG_TRY(npg_tracker_fit(a->tracker, &tracked, a->trial, &frame->cloud, poses, &effort));
    if (tracked.cost > share * frame->tracked.cost) return NPG_OK;
    *taken = true;
    frame->tracked = tracked;
    memcpy(frame->pose, a->trial, bytes);
    return NPG_OK;
}

/* ---- lost frames ---- */

typedef struct recovery {
    attempts by;
    npg_recover_frame *frames;
    size_t count, tried_count;
    double level; /* Chamfer distance of the best quarter */
    double apart; /* and what holes, which differ in all frames, do not come to; infinite: too few frames */
    double point_level; /* the points' part of the distance, of the best quarter */
    double usual_count; /* of points, median */
    double *sorted;     /* count, scratch          */
    npg_look *looks;    /* count; closed with the recovery             */
    double *moved;      /* MOVED_MOST x K x 12, scratch                */
    size_t *lost;       /* count: which are lost                       */
    uint64_t *tried;    /* keys of starts: of all sweeps               */
    npg_recover_result *result;
} recovery;

static bool is_known(const npg_recover_frame *frame)
{
    return frame->cloud.count > 0;
}

/* Depth images tell by themselves: a part of the body is lost, or stands where nothing is. */
static bool is_off(const recovery *r, const npg_recover_frame *frame)
{
    const npg_tracked *tracked = &frame->tracked;
    return is_known(frame) && (tracked->by_images ? tracked->astray > NPG_FEW
                                                  : tracked->chamfer > fmin(LOST * r->level, r->apart));
}

/* Off because its surface has no points near it is not lost, unless the others are all alike and it has as many points
 * as they: a frame with fewer, or with holes, has that, too. */
static bool is_lost(const recovery *r, const npg_recover_frame *frame)
{
    const npg_tracked *tracked = &frame->tracked;
    bool is_whole = MORE * (double)frame->cloud.count >= r->usual_count;
    return is_off(r, frame) && (tracked->by_images || tracked->point_dist_sq > MORE * r->point_level ||
                                (is_whole && tracked->chamfer > r->apart));
}

enum figure { CHAMFER, POINTS_PART, POINT_COUNT };

/* Puts a figure of the known frames in order; returns how many there are. */
static size_t sort(recovery *r, enum figure figure)
{
    size_t known = 0;
    for (size_t i = 0; i < r->count; i++) {
        const npg_recover_frame *f = &r->frames[i];
        const double of[] = {f->tracked.chamfer, f->tracked.point_dist_sq, (double)f->cloud.count};
        if (is_known(f)) r->sorted[known++] = of[figure];
    }
    qsort(r->sorted, known, sizeof *r->sorted, npg_order_double);
    return known;
}

static void set_levels(recovery *r)
{
    size_t known = sort(r, CHAMFER);
    r->level = fmax(LEVEL_LEAST, known ? r->sorted[known / 4] : 0);
    double middle = fmax(r->level, known ? r->sorted[known / 2] : 0);
    r->apart =
        known / 4 < NPG_CONFIRMED ? HUGE_VAL : fmax(MORE * r->level, r->level + APART * (middle - r->level));
    sort(r, POINTS_PART);
    r->point_level = known ? r->sorted[known / 4] : 0;
    sort(r, POINT_COUNT);
    r->usual_count = known ? r->sorted[known / 2] : 0;
}

/* ---- frames that look alike ---- */

typedef struct alike {
    size_t frame;
    npg_rigid motion; /* from there */
    double unlike;
} alike;

/* How frame i stands against frame k.  Even a frame that is lost mostly has its body in place, if not its
 * limbs, so its pose is a guess at that. */
static npg_status compare(alike *found, const recovery *r, size_t k, size_t i)
{
    const npg_graph *graph = npg_tracker_graph(r->by.tracker);
    npg_rigid guess;
    found->frame = k;
    NPG_TRY(npg_pose_between(&guess, graph, r->frames[k].pose, r->frames[i].pose));
    return npg_rigid_icp(&found->motion, &found->unlike, &r->looks[k], &r->looks[i], &guess);
}

/* Whether frame i may be started from its pose. */
static bool is_better(const recovery *r, const npg_recover_frame *frame, size_t i)
{
    const npg_tracked *of = &frame->tracked;
    return is_known(frame) && (of->by_images ? !is_off(r, frame) : of->cost < r->frames[i].tracked.cost);
}

/* The frames most like frame i that its tracker explains better, the most alike first. */
static npg_status find_alike(alike found[ALIKE], size_t *found_count, const recovery *r, size_t i)
{
    *found_count = 0;
    for (size_t k = 0; k < r->count; k++) {
        const npg_recover_frame *frame = &r->frames[k];
        alike next;
        if (k == i || !is_better(r, frame, i)) continue;
        NPG_TRY(compare(&next, r, k, i));
        size_t at = *found_count;
        for (; at > 0 && next.unlike < found[at - 1].unlike; at--)
            if (at < ALIKE) found[at] = found[at - 1];
        if (at == ALIKE) continue;
        found[at] = next;
        *found_count += *found_count < ALIKE;
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

typedef struct starts {
    start list[STARTS_MOST];
    size_t count, moved; /* moved: of them, in r->moved */
} starts;

static void add_moved(starts *s, const recovery *r, const alike *from, const npg_tracker_effort *effort)
{
    const npg_graph *graph = npg_tracker_graph(r->by.tracker);
    double *pose = r->moved + s->moved++ * graph->node_count * NPG_POSE_SIZE;
    npg_pose_move(pose, graph, r->frames[from->frame].pose, &from->motion);
    s->list[s->count++] = (start){pose, NULL, effort};
}

static npg_status find_starts(starts *s, const recovery *r, size_t i, int sweep)
{
    alike all[ALIKE], beside;
    size_t found;
    NPG_TRY(find_alike(all, &found, r, i));
    for (size_t k = 0; k < found; k++) add_moved(s, r, &all[k], NULL);
    for (int way = -1; way <= 1; way += 2) {
        const npg_recover_frame *now = frame_at(r, i, way), *before = frame_at(r, i, 2 * way);
        if (!now || is_off(r, now)) continue;
        NPG_TRY(compare(&beside, r, (size_t)(now - r->frames), i));
        add_moved(s, r, &beside, &wide);
        if (before) s->list[s->count++] = (start){now->pose, before->pose, &wide};
    }
    for (int way = -1; way <= 1 && sweep; way += 2) {
        const npg_recover_frame *now = frame_at(r, i, way);
        if (now && !is_off(r, now)) s->list[s->count++] = (start){now->pose, NULL, &wider};
    }
    return NPG_OK;
}

/* Whether a sweep before has tried it, from where it would end as it did; from now on this one has. */
static bool was_tried(recovery *r, const npg_recover_frame *frame, const start *from)
{
    size_t bytes = npg_pose_bytes(npg_tracker_node_count(r->by.tracker)), i = 0;
    const uint64_t all[] = {(uint64_t)frame->index, from->effort ? (uint64_t)from->effort->steps : 0,
                            XXH3_64bits(from->now, bytes),
                            from->before ? XXH3_64bits(from->before, bytes) : 0};
    uint64_t key = XXH3_64bits(all, sizeof all);
    while (i < r->tried_count && r->tried[i] != key) i++;
    r->tried[r->tried_count] = key;
    return i < r->tried_count++;
}

static npg_status recover_frame(recovery *r, size_t i, int sweep)
{
    npg_recover_frame *frame = &r->frames[i];
    starts from = {.count = 0};
    NPG_TRY(find_starts(&from, r, i, sweep));
    for (size_t k = 0; k < from.count && is_off(r, frame); k++) {
        const npg_prior_poses prior = {.pose = from.list[k].now};
        bool taken;
        if (was_tried(r, frame, &from.list[k])) continue;
        NPG_TRY(attempt(&r->by, &taken, frame, &from.list[k], &prior, BETTER));
        r->result->tried++;
    }
    return NPG_OK;
}

/* ---- all of them ---- */

/* How well the better of the two frames beside it is explained. */
static double best_beside(const recovery *r, size_t i)
{
    const npg_recover_frame *before = frame_at(r, i, -1), *after = frame_at(r, i, 1);
    return fmin(before ? before->tracked.cost : HUGE_VAL, after ? after->tracked.cost : HUGE_VAL);
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

/* Of a frame without points, of the group before, its pose says where the body was. */
static npg_status open_look(npg_look *look, const recovery *r, const npg_recover_frame *frame)
{
    const npg_graph *graph = npg_tracker_graph(r->by.tracker);
    float *places;
    if (!is_known(frame)) return NPG_OK;
    if (frame->cloud.points) return npg_look_open(look, frame->cloud.points, frame->cloud.count);
    NPG_TRY(npg_alloc_array(&places, NPG_FOR_FIT, graph->node_count, 3 * sizeof *places));
    npg_pose_places(places, graph, frame->pose);
    npg_status status = npg_look_open(look, places, graph->node_count);
    npg_release(&places);
    return status;
}

static npg_status open_recovery(recovery *r, npg_arena *scratch)
{
    r->sorted = npg_arena_take(scratch, r->count, sizeof *r->sorted);
    r->lost = npg_arena_take(scratch, r->count, sizeof *r->lost);
    NPG_TRY(npg_arena_status(scratch));
    set_levels(r);
    if (!list_lost(r)) return NPG_END;
    size_t pose_bytes = npg_pose_bytes(npg_tracker_node_count(r->by.tracker));
    r->by.trial = npg_arena_take(scratch, 1, pose_bytes);
    r->moved = npg_arena_take(scratch, MOVED_MOST, pose_bytes);
    r->tried = npg_arena_take(scratch, r->count * STARTS_MOST * SWEEPS, sizeof *r->tried);
    r->looks = npg_arena_take(scratch, r->count, sizeof *r->looks);
    NPG_TRY(npg_arena_status(scratch));
    for (size_t i = 0; i < r->count; i++) NPG_TRY(open_look(&r->looks[i], r, &r->frames[i]));
    return NPG_OK;
}

static npg_status run_sweeps(recovery *r)
{
    bool is_found = true;
    for (int sweep = 0; sweep < SWEEPS && is_found; sweep++) {
        set_levels(r);
        size_t lost = list_lost(r);
        if (!sweep) r->result->lost = (int64_t)lost;
        is_found = false;
        for (size_t k = 0, vain = 0; k < lost && vain < VAIN_MOST; k++) {
            NPG_TRY(recover_frame(r, r->lost[k], sweep));
            bool is_this_found = !is_off(r, &r->frames[r->lost[k]]);
            vain = is_this_found ? 0 : vain + 1;
            is_found |= is_this_found;
        }
    }
    set_levels(r);
    r->result->found = r->result->lost - (int64_t)list_lost(r);
    if (r->result->found < 0) r->result->found = 0; /* the level has fallen: more count as lost now */
    return NPG_OK;
}

npg_status npg_recover(npg_tracker *tracker, npg_recover_result *result, npg_recover_frame *frames,
                       size_t count, bool (*should_stop)(void *user), void *user)
{
    recovery r = {.by = {tracker, NULL, "lost frames were tried again", should_stop, user},
                  .frames = frames,
                  .count = count,
                  .result = result};
    *result = (npg_recover_result){0};
    npg_arena scratch = {.purpose = NPG_FOR_FIT};
    npg_status status = open_recovery(&r, &scratch);
    if (!status) status = run_sweeps(&r);
    for (size_t i = 0; r.looks && i < count; i++) npg_look_close(&r.looks[i]);
    npg_arena_release(&scratch);
    return status == NPG_END ? NPG_OK : status;
}

/* ---- backward ---- */

/* step: +1 from the first frame on, -1 from the last one. */
static npg_status sweep_side(const attempts *by, npg_backward_result *result, npg_recover_frame *frames,
                             size_t count, int64_t key, int step)
{
    start from = {0}; /* the poses of the two frames beyond */
    for (size_t i = 0; i < count; i++) {
        npg_recover_frame *frame = &frames[step > 0 ? i : count - 1 - i];
        if (step > 0 ? frame->index >= key : frame->index <= key) break;
        if (frame->is_fixed || !frame->cloud.count || !frame->since) continue;
        if (from.now) {
            const npg_prior_poses prior = {frame->pose, from.now, frame->since};
            bool taken;
            NPG_TRY(attempt(by, &taken, frame, &from, &prior, WORSE));
            result->tried++;
            result->taken += taken;
        }
        from.before = from.now;
        from.now = frame->pose;
    }
    return NPG_OK;
}

npg_status npg_track_backward(npg_tracker *tracker, npg_backward_result *result, npg_recover_frame *frames,
                              size_t count, int64_t key, bool (*should_stop)(void *user), void *user)
{
    attempts by = {tracker, NULL, "frames were followed back", should_stop, user};
    *result = (npg_backward_result){0};
    NPG_TRY(npg_alloc(&by.trial, NPG_FOR_FIT, npg_pose_bytes(npg_tracker_node_count(tracker))));
    npg_status status = sweep_side(&by, result, frames, count, key, 1);
    if (!status) status = sweep_side(&by, result, frames, count, key, -1);
    npg_release(&by.trial);
    return status;
}
