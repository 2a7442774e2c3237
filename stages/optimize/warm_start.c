/* Warm start: windows without alignment. */
#include "optimize/fit.h"

#include <math.h>
#include <string.h>

#include "pipeline/parallel.h"

#define MATCHERS_MAX 8

/* By trial (tests/bed/decisions.md, "Warm starts"). */
#define SAMPLES       1500 /* where the option says 0                                          */
#define NEAR          3    /* solved frames beside a new one, which hold the field in place    */
#define FAR           3    /* and others, by turns                                             */
#define RATE_FACTOR   2    /* of the fit by few samples, to that over all vertices             */
#define DISTIL_EPOCHS 40   /* of a new frame to where it is predicted                          */
#define OPEN_ROUNDS   12   /* times that it is matched then                                    */
#define OPEN_EPOCHS   10   /* of each round                                                    */
#define OPEN_WIDTH    0.2  /* unit distances that count in full there                          */
#define OPEN_ISOMETRY 20   /* in the last round, beside match-total 5000 ...                   */
#define OPEN_STIFFER  20   /* ... and so much more in the first: limbs go as a whole at first  */
#define LAST_WIDTH    0.05 /* unit distances that count in full when all frames are fitted     */
#define RATE_END      0.1  /* at most, of the fit by vertices                                  */

/* What a window goes through, in this order. */
typedef enum phase {
    PHASE_NONE,
    PHASE_OPEN,     /* new frames are brought near their pose     */
    PHASE_SURFACE,  /* all frames by the surface; count is rounds */
    PHASE_VERTICES, /* all frames by vertices; count is epochs    */
    PHASE_LONGER    /* the same, of a window that was lost        */
} phase;

/* Where a window's fit is. */
typedef struct progress {
    int64_t phase, count, step;
    double loss, loss_before; /* sums over epochs, of what has to settle */
    double chamfer;           /* of the last of them                     */
    double lost_by;           /* see npg_warm_lost_by                    */
} progress;

struct npg_warm {
    npg_device *device;     /* loan */
    const npg_facts *facts; /* loan */
    npg_warm_settings settings;
    npg_fit_settings fit_settings;
    double isometry; /* of the samples' fit */
    uint64_t seed;
    npg_skinning *skinning;
    npg_fit *probe; /* over the samples */
    npg_matcher *matchers[MATCHERS_MAX];
    size_t matcher_count, samples, surface_verts;
    float *surfaces;    /* per matcher W x 3  */
    npg_fit_copy first; /* after window 0     */
    /* of the window at work */
    const npg_warm_frames *in; /* loan */
    npg_fit *dense;            /* loan */
    float *poses;              /* count x S x 3                              */
    bool *is_known;            /* count: has a pose                          */
    size_t *known;             /* count: places of some of those, and of a new one */
    float *wide;               /* count x V x 3, or NULL: the field's values */
    npg_pull *pulls;
    size_t *pull_start, *pull_count;
    npg_fit_watch *watch;
    void *user;
    int64_t step, steps; /* of the window's epochs of all kinds */
    npg_warm_keep *keep; /* or NULL */
    progress at;
    double usual;      /* Chamfer distance that other windows came to, or 0 */
    bool is_resumed;   /* `at`, poses and the fits are from a record */
    size_t pose_count; /* of a record: frames that have poses        */
};

/* ---- opening ---- */

/* A fresh one, in place of any before it. */
static npg_status open_probe(npg_warm *w)
{
    npg_fit_settings probe = w->fit_settings;
    npg_fit_close(&w->probe);
    probe.confidence = NPG_CONFIDENCE_CONSTANT;
    probe.rate_end = 0.1;
    if (w->settings.distance == NPG_DISTANCE_VERTICES) {
        probe.isometry = OPEN_ISOMETRY;
        probe.grid_rate *= RATE_FACTOR;
        probe.mlp_rate *= RATE_FACTOR;
    }
    w->isometry = probe.isometry;
    return npg_fit_open(&w->probe, w->device, &probe, w->skinning->samples->mesh, w->seed);
}

static npg_status open_matchers(npg_warm *w)
{
    size_t count = npg_parallel_parts(MATCHERS_MAX, 1, MATCHERS_MAX);
    w->surface_verts = w->skinning->surface->mesh->vert_count;
    NPG_TRY(npg_alloc_array(&w->surfaces, NPG_FOR_FIT, count * w->surface_verts, 3 * sizeof(float)));
    for (; w->matcher_count < count; w->matcher_count++)
        NPG_TRY(npg_matcher_open(&w->matchers[w->matcher_count], w->skinning, &w->settings.match));
    return NPG_OK;
}

/* What only windows need that start warm, once the first of them comes; each opens its probe itself. */
static npg_status open_samples(npg_warm *w)
{
    size_t samples = w->settings.samples ? (size_t)w->settings.samples : SAMPLES;
    if (w->skinning) return NPG_OK;
    NPG_TRY(npg_skinning_open(&w->skinning, w->facts->reference, samples, NPG_PROXY_SURFACE));
    w->samples = w->skinning->samples->mesh->vert_count;
    return open_matchers(w);
}

npg_status npg_warm_open(npg_warm **out, npg_device *device, const npg_warm_settings *settings,
                         const npg_fit_settings *fit, const npg_facts *facts, uint64_t seed)
{
    npg_warm *w;
    *out = NULL;
    NPG_TRY(npg_alloc(&w, NPG_FOR_FIT, sizeof *w));
    w->device = device;
    w->facts = facts;
    w->settings = *settings;
    w->fit_settings = *fit;
    w->seed = seed;
    *out = w;
    return NPG_OK;
}

static void close_window(npg_warm *w)
{
    npg_release(&w->poses);
    npg_release(&w->is_known);
    npg_release(&w->known);
    npg_release(&w->wide);
    npg_release(&w->pulls);
    npg_release(&w->pull_start);
    npg_release(&w->pull_count);
    w->in = NULL;
    w->dense = NULL;
}

void npg_warm_close(npg_warm **slot)
{
    npg_warm *w = *slot;
    if (!w) return;
    close_window(w);
    npg_fit_copy_clear(&w->first);
    npg_fit_close(&w->probe);
    for (size_t m = 0; m < MATCHERS_MAX; m++) npg_matcher_close(&w->matchers[m]);
    npg_release(&w->surfaces);
    npg_skinning_close(&w->skinning);
    npg_release(slot);
}

npg_fit_copy *npg_warm_first(npg_warm *warm)
{
    return &warm->first;
}

void npg_warm_set_keep(npg_warm *warm, npg_warm_keep *keep)
{
    warm->keep = keep;
}

void npg_warm_set_usual(npg_warm *warm, double chamfer)
{
    warm->usual = chamfer;
}

double npg_warm_lost_by(const npg_warm *warm)
{
    return warm->at.lost_by;
}

static npg_status keep(npg_warm *w, phase now, int64_t count)
{
    w->at.phase = now;
    w->at.count = count;
    w->at.step = w->step;
    return w->keep ? w->keep(w->user) : NPG_OK;
}

/* ---- the samples' fit ---- */

/* Progress over all the fits of a window. */
static npg_status watch_step(void *user, const npg_fit_step *step)
{
    npg_warm *w = user;
    npg_fit_step of_window = *step;
    of_window.epoch = w->step++;
    of_window.epochs = w->steps;
    return w->watch ? w->watch(w->user, &of_window) : NPG_OK;
}

static npg_status run(npg_warm *w, int64_t epochs)
{
    npg_fit_set_epochs(w->probe, epochs);
    return npg_fit_run(w->probe, 0, epochs, watch_step, w);
}

/* Some of the window's frames, by their places. */
typedef struct some {
    const size_t *place;
    size_t count;
} some;

static npg_status begin(npg_warm *w, some of)
{
    npg_fit_frame *frames;
    NPG_TRY(npg_alloc_array(&frames, NPG_FOR_FIT, of.count, sizeof *frames));
    for (size_t i = 0; i < of.count; i++) {
        const npg_fit_frame *from = &w->in->frames[of.place[i]];
        frames[i] = (npg_fit_frame){
            .index = from->index, .time = from->time, .base = w->skinning->samples->mesh->vert_pos};
    }
    npg_status status = npg_fit_begin(w->probe, frames, of.count, w->facts->plan.key);
    npg_release(&frames);
    return status;
}

static float *pose_of(const npg_warm *w, size_t place)
{
    return w->poses + place * 3 * w->samples;
}

static npg_status read_poses(npg_warm *w, some of, size_t first)
{
    for (size_t i = first; i < of.count; i++) NPG_TRY(npg_fit_vertices(w->probe, pose_of(w, of.place[i]), i));
    return NPG_OK;
}

/* ---- what pulls ---- */

typedef struct pulling {
    npg_warm *w;
    some of;
    size_t tied;    /* the first so many frames are held at their pose             */
    bool with_ties; /* of the others, too: those an earlier window solved          */
    size_t most;
} pulling;

/* Where the surface is that points are matched with (W x 3). */
static void place_surface(const npg_warm *w, float *surface, size_t place)
{
    const npg_proxy *thin = w->skinning->surface;
    if (w->wide) {
        npg_proxy_gather(thin, surface, w->wide + place * 3 * w->skinning->vert_count);
        return;
    }
    memcpy(surface, thin->mesh->vert_pos, w->surface_verts * 3 * sizeof(float));
    npg_skin_move(w->skinning->surface_weights, w->surface_verts, surface,
                  w->skinning->samples->mesh->vert_pos, pose_of(w, place));
}

static npg_status pull_frame(const pulling *p, size_t i, npg_matcher *matcher, float *surface)
{
    npg_warm *w = p->w;
    size_t place = p->of.place[i], *count = &w->pull_count[i];
    const npg_fit_frame *frame = &w->in->frames[place];
    npg_pull *pulls = w->pulls + i * p->most;
    *count = 0;
    if (i < p->tied) {
        npg_match_tie(matcher, pulls, count, pose_of(w, place));
        return NPG_OK;
    }
    place_surface(w, surface, place);
    NPG_TRY(npg_match_points(matcher, pulls, count, surface, pose_of(w, place), frame->points,
                             w->in->normals[place], frame->count));
    if (!p->with_ties || !w->in->solved[place]) return NPG_OK;
    npg_skinning_gather(w->skinning, surface, w->in->solved[place]); /* no more than W */
    npg_match_tie(matcher, pulls, count, surface);
    return NPG_OK;
}

static npg_status pull_share(void *user, size_t part)
{
    const pulling *p = user;
    float *surface = p->w->surfaces + 3 * part * p->w->surface_verts;
    for (size_t i = part; i < p->of.count; i += p->w->matcher_count)
        NPG_TRY(pull_frame(p, i, p->w->matchers[part], surface));
    return NPG_OK;
}

static void widen(npg_warm *w, double width)
{
    for (size_t m = 0; m < w->matcher_count; m++) npg_matcher_widen(w->matchers[m], width);
}

/* The pulls of the frames of the fit that was begun. */
static npg_status set_pulls(npg_warm *w, some of, size_t tied, bool with_ties)
{
    pulling p = {w, of, tied, with_ties, npg_matcher_most(w->matchers[0])};
    npg_release(&w->pulls);
    NPG_TRY(npg_alloc_array(&w->pulls, NPG_FOR_FIT, of.count * p.most, sizeof *w->pulls));
    NPG_TRY(npg_parallel(pull_share, &p, w->matcher_count));
    for (size_t i = 0; i < of.count; i++) { /* one behind the other */
        memmove(w->pulls + w->pull_start[i], w->pulls + i * p.most, w->pull_count[i] * sizeof *w->pulls);
        w->pull_start[i + 1] = w->pull_start[i] + w->pull_count[i];
    }
    return npg_fit_set_pulls(w->probe, w->pulls, w->pull_start);
}

/* ---- new frames, brought near their pose ---- */

/* The pose of the frame beyond the last known one, which moves on as it did. */
static void predict(npg_warm *w, size_t place, size_t last, int step)
{
    const float *now = pose_of(w, last), *before = now;
    float *out = pose_of(w, place);
    size_t behind = last - (size_t)step;
    if (behind < w->in->count && w->is_known[behind]) before = pose_of(w, behind);
    for (size_t i = 0; i < 3 * w->samples; i++) out[i] = now[i] + (now[i] - before[i]);
}

/* The last of `of` is new, the others are held at their poses: the field forgets none of them. */
static npg_status fit_new(npg_warm *w, some of)
{
    size_t known = of.count - 1;
    widen(w, OPEN_WIDTH);
    NPG_TRY(begin(w, of));
    NPG_TRY(set_pulls(w, of, of.count, false));
    NPG_TRY(run(w, DISTIL_EPOCHS));
    NPG_TRY(read_poses(w, of, known));
    for (int round = 0; round < OPEN_ROUNDS; round++) {
        double stiffness = 1 - (double)round / (OPEN_ROUNDS - 1);
        npg_fit_set_isometry(w->probe, OPEN_ISOMETRY * pow(OPEN_STIFFER, stiffness));
        NPG_TRY(set_pulls(w, of, known, false));
        NPG_TRY(run(w, OPEN_EPOCHS));
        NPG_TRY(read_poses(w, of, known));
    }
    npg_fit_set_isometry(w->probe, w->isometry);
    return NPG_OK;
}

/* Known frames that are held while the one after `last` is opened: those before it, and some of the others,
 * by turns, so that the field forgets none of them. */
static void remember(const npg_warm *w, some *of, size_t last, int step)
{
    size_t *place = w->known, others = 0, near = 0;
    for (size_t at = last; near < NEAR && at < w->in->count && w->is_known[at]; at -= (size_t)step)
        place[near++] = at;
    for (size_t i = 0; i < w->in->count; i++) others += w->is_known[i];
    others -= near;
    size_t every = (others + FAR - 1) / FAR, seen = 0;
    of->count = near;
    for (size_t i = 0; i < w->in->count && every; i++) {
        bool is_near = step > 0 ? i <= last && i + near > last : i >= last && i < last + near;
        if (w->is_known[i] && !is_near && seen++ % every == last % every) place[of->count++] = i;
    }
}

static npg_status open_frame(npg_warm *w, size_t place, size_t last, int step)
{
    some of = {w->known, 0};
    remember(w, &of, last, step);
    w->known[of.count++] = place;
    predict(w, place, last, step);
    NPG_TRY(fit_new(w, of));
    w->is_known[place] = true;
    return keep(w, PHASE_OPEN, 0);
}

/* Solved frames are known from the beginning, and the keyframe: it is the reference. */
static bool was_known(const npg_warm *w, size_t place)
{
    return w->in->solved[place] || w->in->frames[place].index == w->facts->plan.key;
}

static void find_known(npg_warm *w)
{
    for (size_t i = 0; i < w->in->count; i++) {
        w->is_known[i] = was_known(w, i);
        if (!w->skinning) continue; /* nothing is brought near */
        if (w->in->solved[i])
            npg_skinning_gather(w->skinning, pose_of(w, i), w->in->solved[i]);
        else if (w->is_known[i])
            memcpy(pose_of(w, i), w->skinning->samples->mesh->vert_pos, 3 * w->samples * sizeof(float));
    }
}

/* Outward both ways by turns: the field forgets what was opened long ago.  Whose turn it is follows from what
 * is known, so that a resumed run takes the same turns. */
static npg_status open_new(npg_warm *w)
{
    size_t first = 0, last = w->in->count - 1, before = 0, after = 0;
    while (first < w->in->count && !w->is_known[first]) first++;
    while (last > first && !w->is_known[last]) last--;
    if (first == w->in->count) return npg_error(NPG_FAILED, "no frame of the window is known");
    while (!was_known(w, first + before)) before++;
    while (!was_known(w, last - after)) after++;
    while (first > 0 || last + 1 < w->in->count) {
        bool is_after = last + 1 < w->in->count && (first == 0 || after <= before);
        NPG_TRY(is_after ? open_frame(w, last + 1, last, 1) : open_frame(w, first - 1, first, -1));
        *(is_after ? &after : &before) += 1;
        last += is_after;
        first -= !is_after;
    }
    return NPG_OK;
}

/* ---- all frames together ---- */

/* The field's values at every vertex, into the dense fit. */
static npg_status decode(npg_warm *w)
{
    NPG_TRY(npg_fit_hand_over(w->dense, w->probe));
    return npg_fit_run(w->dense, 0, 0, NULL, NULL);
}

static npg_status begin_dense(npg_warm *w, bool is_pulled, bool is_handed_over)
{
    for (size_t i = 0; i < w->in->count; i++) {
        w->in->frames[i].base = is_pulled ? w->facts->reference->vert_pos : NULL;
        w->in->frames[i].tie = is_pulled ? NULL : w->in->solved[i];
    }
    if (is_handed_over) NPG_TRY(npg_fit_hand_over(w->dense, w->probe));
    return npg_fit_begin(w->dense, w->in->frames, w->in->count, w->facts->plan.key);
}

/* Where the field has all frames now, from which they are matched next. */
static npg_status read_field(npg_warm *w, some all)
{
    size_t size = 3 * w->skinning->vert_count;
    if (!w->wide) NPG_TRY(npg_alloc_array(&w->wide, NPG_FOR_FIT, w->in->count, size * sizeof(float)));
    NPG_TRY(decode(w));
    for (size_t i = 0; i < all.count; i++) NPG_TRY(npg_fit_vertices(w->dense, w->wide + i * size, i));
    return read_poses(w, all, 0);
}

/* First matched from the poses that frames were opened to, not from what the field remembers of those. */
static npg_status fit_surface(npg_warm *w, some all)
{
    int64_t epochs = w->fit_settings.epochs;
    NPG_TRY(begin_dense(w, true, true));
    widen(w, LAST_WIDTH);
    for (int64_t round = w->is_resumed ? w->at.count : 0; round < w->settings.rounds; round++) {
        if (!w->is_resumed) NPG_TRY(keep(w, PHASE_SURFACE, round));
        w->is_resumed = false;
        if (round) NPG_TRY(read_field(w, all));
        NPG_TRY(set_pulls(w, all, 0, true));
        npg_fit_set_epochs(w->probe, epochs);
        NPG_TRY(npg_fit_run(w->probe, round * epochs / w->settings.rounds,
                            (round + 1) * epochs / w->settings.rounds, watch_step, w));
    }
    return decode(w);
}

/* ---- the paper's distance, until the loss has settled ---- */

#define LOOK_BACK 10   /* epochs whose mean loss is compared with that of those before           */
#define SETTLED   0.01 /* share that it has fallen at least while it is going on                 */
#define LOST      1.5  /* times the usual distance: such a window gets all the epochs of a cold one */

static npg_status watch_cold(void *user, const npg_fit_step *step)
{
    npg_warm *w = user;
    NPG_TRY(watch_step(w, step));
    return keep(w, PHASE_VERTICES, step->epoch + 1);
}

/* In the last quarter: before it the steps are long, and what they leave is one draw of many. */
static npg_status watch_settling(void *user, const npg_fit_step *step)
{
    npg_warm *w = user;
    int64_t count = step->epoch + 1;
    bool is_settled = false;
    NPG_TRY(watch_step(w, step));
    w->at.chamfer = step->chamfer;
    w->at.loss += step->chamfer + w->fit_settings.isometry * step->isometry;
    if (count % LOOK_BACK == 0) {
        is_settled = 4 * count > 3 * step->epochs && w->at.loss > (1 - SETTLED) * w->at.loss_before;
        w->at.loss_before = w->at.loss;
        w->at.loss = 0;
    }
    return is_settled ? NPG_END : keep(w, (phase)w->at.phase, count);
}

static npg_status fit_epochs(npg_warm *w, phase now, int64_t epochs, npg_fit_watch *watch_epoch)
{
    int64_t first = w->is_resumed ? w->at.count : 0;
    w->is_resumed = false;
    w->at.phase = now;
    npg_fit_set_epochs(w->dense, epochs);
    return npg_fit_run(w->dense, first, epochs, watch_epoch, w);
}

/* Frames that were brought near need no gate, and a third of the epochs at most; a window that does not get
 * where the others are gets as many as from a cold start. */
static npg_status fit_vertices(npg_warm *w)
{
    int64_t epochs = w->fit_settings.epochs;
    npg_fit_set_confidence(w->dense, NPG_CONFIDENCE_CONSTANT);
    npg_fit_set_rate_end(w->dense, fmin(RATE_END, w->fit_settings.rate_end));
    if (w->at.phase != PHASE_LONGER) {
        NPG_TRY(fit_epochs(w, PHASE_VERTICES, (epochs + 2) / 3, watch_settling));
        if (!(w->usual > 0 && w->at.chamfer > LOST * w->usual)) return NPG_OK;
        w->at.lost_by = w->at.chamfer / w->usual;
        w->steps += epochs;
    }
    return fit_epochs(w, PHASE_LONGER, epochs, watch_settling);
}

/* ---- a window ---- */

static npg_status open_window(npg_warm *w, const npg_warm_frames *in)
{
    size_t size = 3 * w->samples * sizeof(float);
    if (!w->is_resumed) {
        close_window(w);
        NPG_TRY(npg_alloc_array(&w->poses, NPG_FOR_FIT, in->count, size));
        NPG_TRY(npg_alloc_array(&w->is_known, NPG_FOR_FIT, in->count, sizeof *w->is_known));
    } else if (w->pose_count != in->count) {
        return npg_error(NPG_BAD_INPUT, "the state inside the window has %zu frames, not %zu", w->pose_count,
                         in->count);
    }
    w->in = in;
    NPG_TRY(npg_alloc_array(&w->known, NPG_FOR_FIT, in->count, sizeof *w->known));
    NPG_TRY(npg_alloc_array(&w->pull_start, NPG_FOR_FIT, in->count + 1, sizeof *w->pull_start));
    return npg_alloc_array(&w->pull_count, NPG_FOR_FIT, in->count + 1, sizeof *w->pull_count);
}

/* Epochs of all kinds, for the progress. */
static int64_t steps_of(const npg_warm *w, bool is_cold)
{
    int64_t new_frames = 0, epochs = w->fit_settings.epochs;
    for (size_t i = 0; i < w->in->count; i++) new_frames += !w->is_known[i];
    if (is_cold) return epochs;
    if (w->settings.distance == NPG_DISTANCE_VERTICES) epochs = (epochs + 2) / 3;
    return new_frames * (DISTIL_EPOCHS + OPEN_ROUNDS * OPEN_EPOCHS) + epochs;
}

/* What was known after the window that this one borders on, into both fits. */
static npg_status start(npg_warm *w, const npg_window *window)
{
    if (window->from == 0 && w->first.bytes) NPG_TRY(npg_fit_copy_give(&w->first, w->dense));
    NPG_TRY(open_probe(w)); /* afresh: a resumed run knows no more than what is handed over */
    return npg_fit_hand_over(w->probe, w->dense);
}

static npg_status solve_cold(npg_warm *w)
{
    NPG_TRY(npg_fit_begin(w->dense, w->in->frames, w->in->count, w->facts->plan.key));
    return fit_epochs(w, PHASE_VERTICES, w->fit_settings.epochs, watch_cold);
}

/* Up to where all frames of the window are near their pose and the samples' fit has them all. */
static npg_status come_near(npg_warm *w, const npg_window *window, some all)
{
    bool is_near = w->is_resumed && w->at.phase == PHASE_SURFACE;
    if (!w->is_resumed) NPG_TRY(start(w, window));
    if (!is_near) {
        w->is_resumed = false;
        NPG_TRY(open_new(w));
    }
    NPG_TRY(begin(w, all));
    return npg_fit_run(w->probe, 0, 0, NULL, NULL);
}

static npg_status solve_warm(npg_warm *w, const npg_window *window)
{
    size_t *place;
    bool is_by_surface = w->settings.distance == NPG_DISTANCE_SURFACE,
         is_near = w->at.phase >= PHASE_VERTICES;
    NPG_TRY(npg_alloc_array(&place, NPG_FOR_FIT, w->in->count, sizeof *place));
    for (size_t i = 0; i < w->in->count; i++) place[i] = i;
    some all = {place, w->in->count};
    npg_status status = is_near ? NPG_OK : come_near(w, window, all);
    if (!status && is_by_surface) status = fit_surface(w, all);
    npg_release(&place);
    if (status || is_by_surface) return status;
    NPG_TRY(begin_dense(w, false, !is_near));
    return fit_vertices(w);
}

npg_status npg_warm_solve(npg_warm *w, npg_fit *fit, const npg_warm_frames *frames, const npg_window *window,
                          npg_fit_watch *watch, void *user)
{
    bool is_first = window->direction == 0, by_vertices = w->settings.distance == NPG_DISTANCE_VERTICES;
    bool is_alone = w->facts->plan.window >= w->facts->plan.frame_count; /* then it is the paper's */
    bool is_cold = by_vertices && is_alone;
    NPG_TRY(is_cold ? NPG_OK : open_samples(w));
    NPG_TRY(open_window(w, frames));
    w->dense = fit;
    w->watch = watch;
    w->user = user;
    if (!w->is_resumed) {
        w->at = (progress){.phase = PHASE_NONE};
        find_known(w);
    }
    w->step = w->at.step;
    w->steps = steps_of(w, is_cold);
    npg_status status = is_cold ? solve_cold(w) : solve_warm(w, window);
    w->is_resumed = false;
    if (!status && is_first) status = npg_fit_copy_take(&w->first, fit);
    close_window(w);
    return status;
}

/* ---- states inside a window ---- */

npg_status npg_warm_save(npg_warm *w, npg_store *store)
{
    size_t count = w->in->count;
    NPG_TRY(npg_store_put(store, "inside", &w->at, sizeof w->at));
    if (w->skinning)
        NPG_TRY(npg_store_put(store, "inside.poses", w->poses, count * 3 * w->samples * sizeof(float)));
    NPG_TRY(npg_store_put(store, "inside.known", w->is_known, count * sizeof *w->is_known));
    NPG_TRY(npg_fit_save(w->dense, store, "inside.fit"));
    return w->probe ? npg_fit_save(w->probe, store, "inside.probe") : NPG_OK;
}

static npg_status restore_poses(npg_warm *w, const npg_record *record)
{
    size_t poses = 0, known = 0;
    npg_record_find(record, "inside.known", &known);
    if (npg_record_find(record, "inside.poses", &poses)) {
        NPG_TRY(open_samples(w));
        NPG_TRY(open_probe(w));
        NPG_TRY(npg_fit_restore(w->probe, record, "inside.probe"));
        NPG_TRY(npg_alloc(&w->poses, NPG_FOR_FIT, poses));
        NPG_TRY(npg_record_get(record, "inside.poses", w->poses, poses));
        if (poses != known / sizeof *w->is_known * 3 * w->samples * sizeof(float))
            return npg_error(NPG_BAD_INPUT, "the block inside.poses has not the size of its frames");
    }
    NPG_TRY(npg_alloc(&w->is_known, NPG_FOR_FIT, known));
    w->pose_count = known / sizeof *w->is_known;
    return npg_record_get(record, "inside.known", w->is_known, known);
}

npg_status npg_warm_restore(npg_warm *w, npg_fit *fit, const npg_record *record)
{
    close_window(w);
    NPG_TRY(npg_record_get(record, "inside", &w->at, sizeof w->at));
    NPG_TRY(npg_fit_restore(fit, record, "inside.fit"));
    NPG_TRY(restore_poses(w, record));
    w->is_resumed = true;
    return NPG_OK;
}

/* ---- memory ---- */

#define UNITS         2 /* as window.c has it */
#define SURFACE_BYTES 400

size_t npg_warm_memory(const npg_warm_settings *settings, const npg_fit_settings *fit, size_t vert_count,
                       size_t frames)
{
    size_t all = settings->samples ? (size_t)settings->samples : SAMPLES, count = all + all / 10 + 16;
    if (count > vert_count) count = vert_count;
    size_t pulls = frames * ((size_t)settings->match.points + 2 * count) * sizeof(npg_pull);
    size_t wide = settings->distance == NPG_DISTANCE_SURFACE ? 2 : 0, vector = 3 * sizeof(float);
    return 2 * npg_fit_memory(fit, count, frames, 0, UNITS) + 2 * pulls + 2 * frames * count * vector +
           wide * frames * vert_count * vector + vert_count * (sizeof(npg_skin_weights) + vector) +
           (1 + MATCHERS_MAX) * vert_count * SURFACE_BYTES;
}
