/* align: brings the reference coarsely into every frame, from the pose of the frame before it (tracking.h).
 *
 * Frames come from the key outward (plan.h), so that the neighbour towards the key is always known.  They
 * wait until their window is complete: then those that were lost are tried again from what is known around
 * them (recover.c). The aligned positions are where the joint fit starts. */
#include <math.h>
#include <string.h>

#include "align/align_internal.h"
#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "job/job.h"
#include "pipeline/cost.h"
#include "pipeline/options.h"
#include "pipeline/plan.h"

#define BLOCK_ALIGN "align" /* of a state on disk */

#define POINTS_MOST 4  /* times the samples: points of a frame that are kept for the alignment */
#define GROUP_MOST  96 /* frames that wait: a longer window is taken in parts                 */

/* Points past the border of a side of the body are carried by the border's motion, which is theirs while the
 * body moves as one piece: then it is followed as far as it has places for half of a frame's points, else as
 * far as the brief says. */
#define BENT 0.01 /* of its diagonal, what a rigid motion leaves; by trial, tests/bed/decisions.md */

typedef struct state {
    bool is_on;
    int64_t nodes, samples, steps;
    double stiffness, along;
    npg_tracker *tracker;
    npg_pose_cache cache;     /* from the pass before, to the next */
    npg_resume_points points; /* for states on disk */
    bool has_points;
    npg_group group;
    int64_t unreached_count;      /* frames that a side of the body is not followed to */
    int64_t read;                 /* frames of the plan so far                           */
    int64_t window_at, closes_at; /* of an open plan: the next window, and when it is complete */
    npg_recover_result sum;       /* lost and found, of the groups so far */
} state;

#define AT(member) offsetof(state, member)

/* clang-format off */
static const npg_option options[] = {
    /* type       name               place          default  least most  shown as */
    NPG_KEY(FLAG, "align",           AT(is_on),     "yes",
        "bring the reference coarsely into each frame before the joint fit"),
    NPG_KEY(INT,  "align-nodes",     AT(nodes),     "1600",  4,   20000, "N",
        "nodes of the deformation graph, about"),
    NPG_KEY(INT,  "align-samples",   AT(samples),   "5000",  100, 1e6,   "N",
        "points of a frame, and of the surface, that the coarse alignment looks at"),
    NPG_KEY(INT,  "align-steps",     AT(steps),     "12",    1,   1000,  "N",
        "most Gauss-Newton steps of a frame"),
    NPG_KEY(REAL, "align-stiffness", AT(stiffness), "0.006", 0,   1e6,   NULL,
        "weight of the graph's edges against the distances"),
    NPG_KEY(REAL, "align-along",     AT(along),     "0.001", 0,   1,     NULL,
        "share of distances along the surface, 0 to 1"),
    {0}};
/* clang-format on */

static void uninit(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    npg_tracker_close(&s->tracker);
    npg_pose_cache_close(&s->cache);
    if (s->has_points) npg_resume_points_close(&s->points);
    npg_group_close(&s->group);
}

/* ---- what a resumed run needs: both sides and the figures so far ---- */

static size_t nodes_of(const state *s)
{
    return npg_tracker_node_count(s->tracker);
}

static size_t state_bytes(const state *s)
{
    return npg_group_bytes(&s->group) + sizeof s->sum;
}

static void pack_state(const state *s, unsigned char *to)
{
    memcpy(to, s->group.sides[0], npg_group_bytes(&s->group));
    memcpy(to + npg_group_bytes(&s->group), &s->sum, sizeof s->sum);
}

/* Behind the last frame that a window waits for: the state on disk is written when that is solved. */
static npg_status keep_point(state *s)
{
    unsigned char *all;
    NPG_TRY(npg_alloc(&all, NPG_FOR_FIT, state_bytes(s)));
    pack_state(s, all);
    return npg_resume_points_add(&s->points, s->read, all, state_bytes(s));
}

static void unpack_state(state *s, const unsigned char *from)
{
    npg_group_begin(&s->group, from);
    memcpy(&s->sum, from + npg_group_bytes(&s->group), sizeof s->sum);
}

static npg_status restore_state(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    size_t size;
    const unsigned char *all = npg_record_find(npg_job_state(npg_job_of(worker)), BLOCK_ALIGN, &size);
    if (!all || size != state_bytes(s))
        return npg_error(NPG_BAD_INPUT, "the state to resume from has no poses for this reference");
    unpack_state(s, all);
    return NPG_OK;
}

/* Whether the last frame read is the last that a window waits for.  total: as in pipeline/plan.h. */
static bool closes_window(state *s, const npg_plan *plan, int64_t total)
{
    if (!npg_plan_is_open(plan)) {
        for (int64_t w = 0; w < npg_plan_window_count(plan, -1); w++)
            if (npg_plan_read_before(plan, w, -1) == s->read) return true;
        return false;
    }
    while (s->closes_at < s->read || !s->window_at) {
        npg_window window = npg_plan_window(plan, s->window_at++, total);
        s->closes_at += window.new_last - window.new_first + 1;
    }
    return s->closes_at == s->read;
}

/* Whether groups of frames do not end with the windows: the longer, the more of what is hidden has been seen
 * on both sides in time; only what is solved has to wait for its window. */
static bool ends_late(const npg_facts *facts, npg_pass pass)
{
    return pass == NPG_PASS_FUSE && facts->sensor_count_max;
}

/* ---- what is open for a pass ---- */

static npg_status save(const npg_worker *worker, npg_store *out, int64_t read)
{
    state *s = npg_worker_state(worker);
    if (!s->tracker) return NPG_OK; /* no frame came yet */
    NPG_TRY(npg_resume_points_save(&s->points, read, out, BLOCK_ALIGN));
    return npg_pose_cache_save(&s->cache, out);
}

static npg_status open_tracker(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_tracker_settings settings = {(size_t)s->nodes, (size_t)s->samples, (int)s->steps, s->stiffness,
                                           s->along};
    NPG_TRY(npg_tracker_open(&s->tracker, npg_worker_facts(worker)->reference, &settings));
    size_t nodes = nodes_of(s);
    npg_resume_points_open(&s->points);
    s->has_points = true;
    NPG_TRY(npg_group_open(&s->group, nodes));
    json_object_set_new(npg_worker_report(worker), "nodes", json_integer((json_int_t)nodes));
    NPG_TRY(npg_pose_cache_open(&s->cache, worker, s->tracker, state_bytes(s)));
    return npg_worker_facts(worker)->is_resumed ? restore_state(worker) : NPG_OK;
}

/* ---- frame after frame ---- */

static npg_status take_points(const npg_worker *worker, npg_waiting *w)
{
    const state *s = npg_worker_state(worker);
    const npg_frame *frame = &w->frame;
    const npg_frame_box *box = &npg_worker_facts(worker)->box;
    size_t most = POINTS_MOST * (size_t)s->samples;
    size_t count = frame->point_count < most ? frame->point_count : most;
    if (!count) return NPG_OK;
    w->points = npg_arena_take(&w->arena, count, 3 * sizeof(float));
    if (frame->normals) w->normals = npg_arena_take(&w->arena, count, 3 * sizeof(float));
    if (frame->sensor_count) w->sensors = npg_arena_take(&w->arena, frame->sensor_count, 3 * sizeof(float));
    NPG_TRY(npg_arena_status(&w->arena));
    npg_points_spread(w->points, w->normals, most, frame->pos_local, frame->normals, frame->point_count);
    npg_box_local_to_unit(box, w->points, w->points, count);
    if (frame->sensor_count) npg_box_local_to_unit(box, w->sensors, frame->sensor_local, frame->sensor_count);
    NPG_TRY(npg_free_space_open(&w->space, frame, box));
    w->cloud = (npg_tracker_cloud){w->points, w->normals, count, w->sensors, frame->sensor_count, w->space};
    return NPG_OK;
}

/* How long what sensors do not see of a frame has been hidden; in the keyframe nothing is, all is known. */
static npg_status count_hidden(const npg_worker *worker, npg_waiting *w, npg_side *at)
{
    const state *s = npg_worker_state(worker);
    size_t nodes = nodes_of(s);
    if (!w->cloud.sensor_count) return NPG_OK;
    w->since = npg_arena_take(&w->arena, nodes, sizeof *w->since);
    NPG_TRY(npg_arena_status(&w->arena));
    if (w->frame.index != npg_worker_facts(worker)->plan.key)
        npg_tracker_since(s->tracker, w->since, npg_side_since(at));
    memcpy(npg_side_since(at), w->since, nodes * sizeof *w->since);
    return NPG_OK;
}

/* The pose that the motion so far leads to, fitted to the points; without any it stays. */
static npg_status fit_pose(npg_worker *worker, npg_waiting *w, npg_side *at)
{
    const state *s = npg_worker_state(worker);
    npg_tracker_effort again = npg_tracker_again(s->tracker);
    /* What is new comes along with what was there, and where that stands is all that is asked. */
    if (npg_worker_facts(worker)->brief.is_last_look) again.steps = 1;
    NPG_TRY(npg_pose_cache_start(&s->cache, s->tracker, w->frame.index, at->now, &w->is_known));
    if (w->cloud.count) {
        const npg_prior_poses prior = {.pose =
                                           w->is_known || !at->has_before ? at->now : npg_side_before(at)};
        NPG_TRY(npg_tracker_fit(s->tracker, &w->tracked, at->now, &w->cloud, &prior,
                                w->is_known ? &again : NULL));
        NPG_TRY(count_hidden(worker, w, at));
        npg_worker_log(worker, NPG_LOG_DEBUG, w->frame.number,
                       "coarse alignment: mean distance %.5f, Chamfer %.6f in %d steps",
                       w->tracked.point_dist_mean, w->tracked.chamfer, w->tracked.steps);
    }
    memcpy(w->pose, at->now, npg_pose_bytes(nodes_of(s)));
    at->now_tracked = w->tracked;
    at->has_now = w->cloud.count > 0;
    return NPG_OK;
}

/* Whether points are gathered for a reference that is a side of the body. */
static bool gathers_side(const npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    return ends_late(npg_worker_facts(worker), npg_worker_pass(worker)) && npg_tracker_is_open(s->tracker);
}

/* Whether it has places for enough of the frame's points. */
static npg_status reaches(bool *is_reached, const npg_worker *worker, const npg_waiting *w)
{
    const state *s = npg_worker_state(worker);
    const npg_mesh *reference = npg_tracker_reference(s->tracker);
    double bend, size = npg_points_diagonal(reference->vert_pos, reference->vert_count);
    NPG_TRY(npg_pose_bend(&bend, npg_tracker_graph(s->tracker), w->pose));
    *is_reached = w->tracked.explained >=
                  (bend > BENT * size ? npg_worker_facts(worker)->brief.explained_least : NPG_MAJORITY);
    return NPG_OK;
}

/* A frame that a side of the body is not followed to, nor those beyond it: a pose that is no number says so, in
 * the log, too. */
static void leave_past(npg_waiting *w, npg_side *at)
{
    at->is_past = true;
    at->has_now = false;
    w->pose[0] = (double)NAN;
    w->cloud.count = 0;
}

static bool is_past(const npg_waiting *w)
{
    return isnan(w->pose[0]);
}

/* Takes the frame's content. */
static npg_status align_frame(npg_worker *worker, npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    npg_waiting *w;
    NPG_TRY(npg_group_add(&w, &s->group, frame));
    if (npg_pose_cache_has_group(&s->cache)) return npg_pose_cache_read(&s->cache, w->frame.index, w->pose);
    NPG_TRY(take_points(worker, w));
    npg_side *at = s->group.ways[w->frame.index < facts->plan.key];
    bool is_key = w->frame.index == facts->plan.key;
    if (at->is_past) {
        leave_past(w, at);
        return NPG_OK;
    }
    if (!is_key) npg_side_step_on(at, w->frame.index);
    NPG_TRY(fit_pose(worker, w, at));
    bool is_reached = true;
    if (!is_key && gathers_side(worker)) NPG_TRY(reaches(&is_reached, worker, w));
    if (!is_reached) leave_past(w, at);
    at->index = w->frame.index;
    if (is_key) npg_side_copy(s->group.ways[1], at);
    return NPG_OK;
}

/* ---- a group ---- */

/* Lost frames are tried again, `frames` become what was found. */
static npg_status recover_group(npg_worker *worker, npg_recover_frame *frames, size_t count)
{
    state *s = npg_worker_state(worker);
    npg_recover_result result;
    NPG_TRY(npg_recover(s->tracker, &result, frames, count, npg_worker_should_stop, worker));
    s->sum.lost += result.lost;
    s->sum.found += result.found;
    if (result.lost)
        npg_worker_log(worker, NPG_LOG_INFO, -1,
                       "of %zu frames %lld were lost, %lld of them found again in %lld fits", s->group.count,
                       (long long)result.lost, (long long)result.found, (long long)result.tried);
    return NPG_OK;
}

/* Frames of which sensors saw a part are followed back from the group's ends, `frames` become what was
 * found. */
static npg_status sweep_group(npg_worker *worker, npg_recover_frame *frames, size_t count)
{
    state *s = npg_worker_state(worker);
    npg_backward_result result;
    NPG_TRY(npg_track_backward(s->tracker, &result, frames, count, npg_worker_facts(worker)->plan.key,
                               npg_worker_should_stop, worker));
    if (result.tried)
        npg_worker_log(worker, NPG_LOG_INFO, -1, "of %lld frames followed back %lld are better, or as good",
                       (long long)result.tried, (long long)result.taken);
    return NPG_OK;
}

/* Where frames see a side of the body each, and no image tells what is lost, none is tried again: distances differ by
 * what is seen, and the frames that look most alike are those of a body's front and back. */
static npg_status finish_group(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    bool is_of_one_side = facts->brief.is_side || gathers_side(worker);
    npg_recover_frame *frames;
    NPG_TRY(npg_alloc_array(&frames, NPG_FOR_FIT, s->group.count + NPG_GROUP_FIXED, sizeof *frames));
    size_t count = npg_group_list(&s->group, frames);
    npg_status status = sweep_group(worker, frames, count);
    if (!status && (!is_of_one_side || facts->view_count_max)) status = recover_group(worker, frames, count);
    if (!status) npg_group_take(&s->group, frames, count);
    npg_release(&frames);
    return status;
}

static npg_status pass_on(npg_worker *worker, npg_waiting *w)
{
    state *s = npg_worker_state(worker);
    const npg_mesh *reference = npg_worker_facts(worker)->reference;
    npg_chunk *chunk;
    npg_frame *frame = &w->frame;
    NPG_TRY(npg_alloc_array(&frame->vert_unit, NPG_FOR_FRAMES, reference->vert_count, 3 * sizeof(float)));
    frame->vert_count = reference->vert_count;
    frame->fields |= NPG_FIELD_POSE;
    if (is_past(w)) {
        memcpy(frame->vert_unit, reference->vert_pos, reference->vert_count * 3 * sizeof(float));
        frame->point_count = 0; /* nothing of it can be compared with the surface */
        s->unreached_count++;
    } else {
        npg_tracker_vertices(s->tracker, frame->vert_unit, w->pose);
    }
    NPG_TRY(npg_chunk_open(&chunk, 1));
    npg_chunk_add(chunk, frame);
    npg_status status = npg_worker_push(worker, &chunk);
    npg_chunk_close(&chunk);
    return status;
}

/* As it was left by an earlier run that followed the group, or for one that comes. */
static npg_status follow_group(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    unsigned char *packed;
    if (!npg_pose_cache_has_group(&s->cache)) {
        NPG_TRY(finish_group(worker));
        const npg_waiting *w = s->group.frames;
        for (size_t i = 0; i < s->group.count; i++)
            NPG_TRY(npg_pose_cache_put(&s->cache, w[i].frame.index, w[i].pose));
    }
    NPG_TRY(npg_alloc(&packed, NPG_FOR_FIT, state_bytes(s)));
    npg_status status = NPG_OK;
    if (npg_pose_cache_has_group(&s->cache)) {
        status = npg_pose_cache_read_end(&s->cache, packed, state_bytes(s));
        if (!status) unpack_state(s, packed);
    } else {
        pack_state(s, packed);
        status = npg_pose_cache_put_end(&s->cache, packed, state_bytes(s));
    }
    npg_release(&packed);
    return status;
}

/* with_state: the group ends a window, or may. */
static npg_status close_group(npg_worker *worker, bool with_state)
{
    state *s = npg_worker_state(worker);
    if (!s->group.count) return NPG_OK;
    NPG_TRY(follow_group(worker));
    if (with_state && npg_job_of(worker) && npg_worker_pass(worker) == NPG_PASS_SOLVE) NPG_TRY(keep_point(s));
    for (size_t i = 0; i < s->group.count; i++) NPG_TRY(pass_on(worker, &s->group.frames[i]));
    npg_group_clear(&s->group);
    return NPG_OK;
}

/* Of a live source that goes on a fusing pass has the look-ahead; in the solving one nobody knows: -1. */
static int64_t frames_of_pass(const npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    return npg_worker_pass(worker) == NPG_PASS_FUSE ? facts->planned_count : facts->frame_count;
}

/* Frames that are followed, and those that are passed on: between the two, lost ones are searched. */
static void report_progress(npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    double frames = (double)frames_of_pass(worker), followed = (double)s->read;
    double both = 2 * followed - (double)s->group.count;
    if (frames > 0) npg_worker_step(worker, both / (2 * frames), s->read, (int64_t)frames);
}

static npg_status process(npg_worker *worker, npg_chunk **chunk)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    if (!s->tracker) {
        s->read = facts->resumed_read;
        NPG_TRY(open_tracker(worker));
    }
    for (size_t i = 0; i < npg_chunk_count(*chunk); i++) {
        npg_frame *frame = npg_chunk_frame(*chunk, i);
        int64_t number = frame->number;
        NPG_TRY(npg_error_prefix(align_frame(worker, frame), "frame %lld", (long long)number));
        s->read++;
        report_progress(worker);
        /* where an open source will end, and with it the last window, is not known */
        int64_t total = npg_worker_pass(worker) == NPG_PASS_FUSE ? facts->planned_count : -1;
        bool is_window = closes_window(s, &facts->plan, total);
        bool with_state = is_window || npg_plan_is_open(&facts->plan);
        bool is_done = is_window && !ends_late(facts, npg_worker_pass(worker));
        if (is_done || s->group.count == GROUP_MOST) NPG_TRY(close_group(worker, with_state));
        if (npg_worker_stopping(worker)) return NPG_STOPPED;
    }
    npg_chunk_close(chunk);
    return NPG_OK;
}

static npg_status flush(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    json_t *report = npg_worker_report(worker);
    NPG_TRY(close_group(worker, npg_plan_is_open(&npg_worker_facts(worker)->plan)));
    report_progress(worker);
    NPG_TRY(npg_pose_cache_leave(&s->cache, worker, &s->tracker));
    if (npg_worker_pass(worker) == NPG_PASS_FUSE) *npg_own(worker, unreached_count) = s->unreached_count;
    json_object_set_new(report, "frames_lost", json_integer(s->sum.lost));
    json_object_set_new(report, "frames_found_again", json_integer(s->sum.found));
    return NPG_OK;
}

/* What is done to an aligned frame beside it is counted here, too. */
static double expects(const npg_worker *worker, npg_pass pass)
{
    const npg_facts *facts = npg_worker_facts(worker);
    return pass == NPG_PASS_CHOOSE
               ? 0
               : npg_cost_pass_s((double)facts->frame_count, (double)facts->point_count_max);
}

static bool takes_part(const npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    return s->is_on;
}

static size_t memory(const npg_worker *worker, size_t *chunks_held)
{
    const state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    size_t verts = npg_worker_verts_at_most(worker), nodes = (size_t)s->nodes;
    npg_window window = npg_plan_window(&facts->plan, 0, -1);
    int64_t length = ends_late(facts, NPG_PASS_FUSE) ? GROUP_MOST : window.last - window.first + 1;
    int64_t most = length < GROUP_MOST ? length : GROUP_MOST;
    size_t group = (size_t)most, chunk = (size_t)npg_worker_settings(worker)->chunk_frames;
    size_t points = facts->point_count_max < POINTS_MOST * (size_t)s->samples
                        ? facts->point_count_max
                        : POINTS_MOST * (size_t)s->samples;
    /* the pose of the pass before, its record, and what an old and a new node have in the map */
    size_t known = NPG_POSE_SIZE * (sizeof(double) + sizeof(float)) + NPG_GRAPH_BIND * 2 * sizeof(float) +
                   3 * sizeof(float);
    *chunks_held = (group + chunk - 1) / chunk + 1;
    /* two sides of two poses, twice; the waiting frames' poses, once more for the log, what they hide, thinned
     * points, and free space */
    return npg_tracker_memory(nodes, (size_t)s->samples, verts) +
           nodes * (8 * NPG_POSE_SIZE * sizeof(double) + known) +
           group * (nodes * (2 * NPG_POSE_SIZE * sizeof(double) + sizeof(float)) +
                    points * 6 * sizeof(float) + npg_free_space_memory(facts->view_count_max));
}

const npg_stage npg_stage_align = {
    .name = "align",
    .help = "brings the reference coarsely into each frame",
    .options = options,
    .state_size = sizeof(state),
    .passes = NPG_PASS_FUSE | NPG_PASS_SOLVE,
    .needs = NPG_FIELD_CLEAN | NPG_FIELD_KEY | NPG_FIELD_REFERENCE,
    .gives = NPG_FIELD_POSE,
    .takes_part = takes_part,
    .process = process,
    .flush = flush,
    .uninit = uninit,
    .memory = memory,
    .save = save,
    .expects = expects,
};
