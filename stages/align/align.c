/* align: brings the reference coarsely into every frame, from the pose of the frame before it (tracker.h).
 *
 * Frames come from the key outward (plan.h), so that the neighbour towards the key is always known.  The
 * aligned positions are where the joint fit starts; the fit then only looks for what the coarse alignment
 * can't express. */
#include <math.h>
#include <string.h>

#include "align/tracker.h"
#include "job/job.h"

/* Set by trial on captures with fast motion. */
#define LOST               1.5 /* times the usual Chamfer distance, from which a frame counts as lost */
#define RETRIED_IN_ROW     3   /* lost frames in a row that are all tried again                       */
#define RETRIED_AFTERWARDS 4   /* of those behind them every so many                                  */

/* The two last poses on one side of the key. */
typedef struct side {
    double *now, *before; /* K x 12, owned */
    int64_t index;        /* of now        */
    bool has_before;
    int lost_in_row;
} side;

typedef struct state {
    bool is_on;
    int64_t nodes, samples, steps;
    double stiffness, along;
    npg_tracker *tracker;
    side sides[2]; /* forward, backward */
    float *points; /* of the frame at work, owned */
    size_t points_capacity;
    double *start, *trial; /* K x 12 each, owned */
    int64_t read;          /* frames of the plan so far */
    struct figures {
        double worst_dist, dist_sum, chamfer_sum;
        int64_t worst_frame, frames, tried_again;
    } sum;
} state;

#define AT(member) offsetof(state, member)

/* clang-format off */
static const npg_option options[] = {
    /* type      name               place          default  least  most   shown as */
    NPG_ROW_FLAG("align",           AT(is_on),     "yes",
        "bring the reference coarsely into each frame before the joint fit"),
    NPG_ROW_INT ("align-nodes",     AT(nodes),     "1600",  4,     20000, "N",
        "nodes of the deformation graph, about"),
    NPG_ROW_INT ("align-samples",   AT(samples),   "5000",  100,   1e6,   "N",
        "points of a frame, and of the surface, that the coarse alignment looks at"),
    NPG_ROW_INT ("align-steps",     AT(steps),     "12",    1,     1000,  "N",
        "most Gauss-Newton steps of a frame"),
    NPG_ROW_REAL("align-stiffness", AT(stiffness), "0.006", 0,     1e6,   NULL,
        "weight of the graph's edges against the distances"),
    NPG_ROW_REAL("align-along",     AT(along),     "0.001", 0,     1,     NULL,
        "share of distances along the surface, 0 to 1"),
    {0}};
/* clang-format on */

static void uninit(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    npg_tracker_close(&s->tracker);
    for (int i = 0; i < 2; i++) {
        npg_release(&s->sides[i].now);
        npg_release(&s->sides[i].before);
    }
    npg_release(&s->points);
    npg_release(&s->start);
    npg_release(&s->trial);
}

/* ---- what a resumed run needs: both sides and the figures so far ---- */

static size_t pose_bytes(const state *s)
{
    return npg_tracker_node_count(s->tracker) * NPG_POSE_SIZE * sizeof(double);
}

/* The last frame that a window waits for takes it along: it comes to the stage that writes the state just
 * when the window can be solved. */
static npg_status attach_state(const state *s, npg_frame *frame)
{
    size_t bytes = pose_bytes(s), at = 0, size = 2 * (sizeof(side) + 2 * bytes) + sizeof s->sum;
    unsigned char *all;
    NPG_TRY(npg_alloc(&all, NPG_FOR_FIT, size));
    for (int i = 0; i < 2; i++) {
        const side plain = {.index = s->sides[i].index,
                            .has_before = s->sides[i].has_before,
                            .lost_in_row = s->sides[i].lost_in_row};
        memcpy(all + at, &plain, sizeof plain);
        memcpy(all + at + sizeof plain, s->sides[i].now, bytes);
        memcpy(all + at + sizeof plain + bytes, s->sides[i].before, bytes);
        at += sizeof plain + 2 * bytes;
    }
    memcpy(all + at, &s->sum, sizeof s->sum);
    frame->align_state = all;
    frame->align_state_size = size;
    return NPG_OK;
}

static npg_status restore_state(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    size_t bytes = pose_bytes(s), size, at = 0;
    const unsigned char *all = npg_archive_find(npg_job_archive(npg_job_of(worker)), NPG_BLOCK_ALIGN, &size);
    if (!all || size != 2 * (sizeof(side) + 2 * bytes) + sizeof s->sum)
        return npg_error(NPG_BAD_INPUT, "the state to resume from has no poses for this reference");
    for (int i = 0; i < 2; i++) {
        side plain;
        memcpy(&plain, all + at, sizeof plain);
        s->sides[i].index = plain.index;
        s->sides[i].has_before = plain.has_before;
        s->sides[i].lost_in_row = plain.lost_in_row;
        memcpy(s->sides[i].now, all + at + sizeof plain, bytes);
        memcpy(s->sides[i].before, all + at + sizeof plain + bytes, bytes);
        at += sizeof plain + 2 * bytes;
    }
    memcpy(&s->sum, all + at, sizeof s->sum);
    return NPG_OK;
}

static bool closes_window(const npg_plan *plan, int64_t read)
{
    for (int64_t w = 0; w < npg_plan_window_count(plan); w++)
        if (npg_plan_read_before(plan, w) == read) return true;
    return false;
}

static npg_status open_tracker(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    const npg_tracker_settings settings = {(size_t)s->nodes, (size_t)s->samples, (int)s->steps, s->stiffness,
                                           s->along};
    NPG_TRY(npg_tracker_open(&s->tracker, npg_worker_facts(worker)->reference, &settings));
    size_t nodes = npg_tracker_node_count(s->tracker);
    for (int i = 0; i < 2; i++) {
        NPG_TRY(npg_alloc_array(&s->sides[i].now, NPG_FOR_FIT, nodes, NPG_POSE_SIZE * sizeof(double)));
        NPG_TRY(npg_alloc_array(&s->sides[i].before, NPG_FOR_FIT, nodes, NPG_POSE_SIZE * sizeof(double)));
        npg_pose_rest(s->sides[i].now, nodes);
    }
    NPG_TRY(npg_alloc_array(&s->start, NPG_FOR_FIT, nodes, NPG_POSE_SIZE * sizeof(double)));
    NPG_TRY(npg_alloc_array(&s->trial, NPG_FOR_FIT, nodes, NPG_POSE_SIZE * sizeof(double)));
    json_object_set_new(npg_worker_report(worker), "nodes", json_integer((json_int_t)nodes));
    return npg_worker_facts(worker)->is_resumed ? restore_state(worker) : NPG_OK;
}

/* The pose to start from becomes `now`, the last one `before`. */
static void step_on(state *s, side *at, int64_t index)
{
    size_t nodes = npg_tracker_node_count(s->tracker), bytes = nodes * NPG_POSE_SIZE * sizeof(double);
    double *start = at->before; /* its content is not needed once the extrapolation is made */
    if (at->has_before)
        npg_pose_extrapolate(start, at->now, at->before, nodes);
    else
        memcpy(start, at->now, bytes);
    at->before = at->now;
    at->now = start;
    at->has_before = true;
    at->index = index;
}

static npg_status fit_pose(npg_worker *worker, npg_tracked *tracked, double *pose, const npg_frame *frame,
                           const npg_tracker_effort *effort)
{
    state *s = npg_worker_state(worker);
    NPG_TRY(
        npg_tracker_fit(s->tracker, tracked, pose, s->points, frame->normals, frame->point_count, effort));
    npg_worker_log(worker, NPG_LOG_DEBUG, frame->number,
                   "coarse alignment: mean distance %.5f, Chamfer %.6f in %d steps", tracked->point_dist_mean,
                   tracked->chamfer, tracked->steps);
    return NPG_OK;
}

static bool is_lost(const state *s, const npg_tracked *tracked)
{
    return s->sum.frames && tracked->chamfer > LOST * s->sum.chamfer_sum / (double)s->sum.frames;
}

/* Where the usual fit lost the surface: with more effort, from where the motion should have led
 * and from where the surface was.  The pose that explains the frame best stays. */
static npg_status fit_with_effort(npg_worker *worker, npg_tracked *best, side *at, const npg_frame *frame)
{
    /* The usual fit has up to --align-steps steps, begins ten times as stiff as it ends, and is 0.08 wide.
     * A lost frame has moved farther than that: more steps, a stiffer beginning that moves the body
     * as a whole, and twice, then four times the width.  What is lost must not slide away along the surface,
     * hence ten times `along`. Figures: why_these_defaults.md, lost frames. */
    static const npg_tracker_effort efforts[] = {
        {.steps = 40, .stiffness = 100, .width_unit = 0.2, .along = 10},
        {.steps = 80, .stiffness = 100, .width_unit = 0.4, .along = 10},
    };
    state *s = npg_worker_state(worker);
    const double *starts[] = {at->before, s->start};
    s->sum.tried_again++;
    for (int i = 0; i < 4 && is_lost(s, best); i++) {
        npg_tracked tracked;
        if (i % 2 == 0 && !at->has_before) continue; /* both starts are the same */
        memcpy(s->trial, starts[i % 2], pose_bytes(s));
        NPG_TRY(fit_pose(worker, &tracked, s->trial, frame, &efforts[i / 2]));
        if (npg_worker_stopping(worker)) return NPG_STOPPED;
        if (tracked.chamfer >= best->chamfer) continue;
        *best = tracked;
        memcpy(at->now, s->trial, pose_bytes(s));
    }
    return NPG_OK;
}

/* A capture that the reference does not explain at all must not cost every frame five fits. */
static npg_status retry_lost(npg_worker *worker, npg_tracked *tracked, side *at, const npg_frame *frame)
{
    const state *s = npg_worker_state(worker);
    bool is_retried = at->lost_in_row < RETRIED_IN_ROW || at->lost_in_row % RETRIED_AFTERWARDS == 0;
    if (is_lost(s, tracked) && is_retried) NPG_TRY(fit_with_effort(worker, tracked, at, frame));
    at->lost_in_row = is_lost(s, tracked) ? at->lost_in_row + 1 : 0;
    return NPG_OK;
}

static void add_to_report(state *s, const npg_tracked *tracked, const npg_frame *frame)
{
    s->sum.frames++;
    s->sum.dist_sum += tracked->point_dist_mean;
    s->sum.chamfer_sum += tracked->chamfer;
    if (tracked->point_dist_mean <= s->sum.worst_dist) return;
    s->sum.worst_dist = tracked->point_dist_mean;
    s->sum.worst_frame = frame->number;
}

static npg_status fit_side(npg_worker *worker, side *at, const npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    npg_tracked tracked;
    if (!frame->point_count) return NPG_OK; /* nothing to see: the motion goes on as before */
    NPG_TRY(npg_grow(&s->points, &s->points_capacity, frame->point_count, 3 * sizeof(float), NPG_FOR_FIT));
    npg_box_local_to_unit(&npg_worker_facts(worker)->box, s->points, frame->pos_local, frame->point_count);
    memcpy(s->start, at->now, pose_bytes(s));
    NPG_TRY(fit_pose(worker, &tracked, at->now, frame, NULL));
    NPG_TRY(retry_lost(worker, &tracked, at, frame));
    add_to_report(s, &tracked, frame);
    return NPG_OK;
}

static npg_status align_frame(npg_worker *worker, npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_mesh *reference = facts->reference;
    size_t bytes = npg_tracker_node_count(s->tracker) * NPG_POSE_SIZE * sizeof(double);
    side *at = &s->sides[frame->index < facts->plan.key];
    if (frame->index != facts->plan.key) step_on(s, at, frame->index);
    NPG_TRY(fit_side(worker, at, frame));
    if (frame->index == facts->plan.key) memcpy(s->sides[1].now, at->now, bytes);
    NPG_TRY(npg_alloc_array(&frame->vert_unit, NPG_FOR_FRAMES, reference->vert_count, 3 * sizeof(float)));
    frame->vert_count = reference->vert_count;
    frame->fields |= NPG_FIELD_POSE;
    npg_tracker_vertices(s->tracker, frame->vert_unit, at->now);
    return NPG_OK;
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
        NPG_TRY(npg_error_prefix(align_frame(worker, frame), "frame %lld", (long long)frame->number));
        s->read++;
        if (npg_job_of(worker) && closes_window(&facts->plan, s->read)) NPG_TRY(attach_state(s, frame));
        if (npg_worker_stopping(worker)) return NPG_STOPPED;
    }
    return NPG_OK;
}

static npg_status flush(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    json_t *report = npg_worker_report(worker);
    if (!s->sum.frames) return NPG_OK;
    json_object_set_new(report, "mean_distance_unit", json_real(s->sum.dist_sum / (double)s->sum.frames));
    json_object_set_new(report, "worst_distance_unit", json_real(s->sum.worst_dist));
    json_object_set_new(report, "worst_frame", json_integer(s->sum.worst_frame));
    json_object_set_new(report, "frames_tried_again", json_integer(s->sum.tried_again));
    return NPG_OK;
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
    *chunks_held = 1;
    /* two sides of two poses; blocks of the equations, about 20 pairs a node; per vertex weights and the
     * graph's search for them, positions, normals */
    return nodes * (4 * NPG_POSE_SIZE * sizeof(double) + 22 * 36 * sizeof(double)) + verts * 320 +
           facts->point_count_max * 40;
}

extern const npg_stage npg_stage_align;
const npg_stage npg_stage_align = {
    .name = "align",
    .help = "brings the reference coarsely into each frame",
    .options = options,
    .state_size = sizeof(state),
    .passes = NPG_PASS_SOLVE,
    .needs = NPG_FIELD_CLEAN | NPG_FIELD_KEY | NPG_FIELD_REFERENCE,
    .gives = NPG_FIELD_POSE,
    .takes_part = takes_part,
    .process = process,
    .flush = flush,
    .uninit = uninit,
    .memory = memory,
};
