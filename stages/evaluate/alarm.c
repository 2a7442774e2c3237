/* Alarm: notices from which frame on the reference no longer explains the capture. */
#include "evaluate/evaluate_internal.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "pipeline/order.h"
#include "pipeline/stage.h"

/* Set by trial, on captures whose topology changes and on ones whose fit fails. */
#define HISTORY  64                     /* explained frames that the usual level is taken from        */
#define LOST_FIT 0.004                  /* of the frame's diagonal: nearer than that it isn't         */
#define RUN_MAX  (3 * NPG_ALARM_FRAMES) /* twice as many where each weighs half */

/* clang-format off */
static const struct {
    const char *name, *what;
    double floor;  /* of the bound, where a capture has no misfit of its own; set by trial */
    double weight; /* of an unexplained frame among NPG_ALARM_FRAMES                       */
} kinds[NPG_MISFITS] = {
    {"far",         "of the points are far from the surface in one place",          0.01,  1},
    {"unsupported", "of the surface have no points near them in one place",         0.015, 1},
    {"stretched",   "of the surface are torn apart in one place",                   0.003, 0.5},
    {"vacated",     "of the surface are one part that has lost most of its points", 0.015, 1}};
/* clang-format on */

typedef struct record {
    int64_t index, number, away; /* from the keyframe */
    npg_misfit misfits[NPG_MISFITS];
    double fit; /* median distance of the points, in diagonals */
} record;

typedef struct side {
    int64_t next;    /* how far away the frame is whose turn it is */
    record *waiting; /* came ahead of their turn; owned */
    size_t waiting_count, waiting_room;
    double history[NPG_MISFITS][HISTORY];
    size_t history_count; /* ever */
    double key_fit;       /* of the keyframe: what noise alone leaves */
    struct suspect {
        record frame;
        bool is_unexplained;
        npg_alarm_cause cause;    /* its clearest misfit */
    } run[RUN_MAX];               /* since the last explained one, the last of them */
    size_t run_count, run_length; /* kept, and in all */
    bool is_raised;
    npg_alarm_cause cause;
} side;

struct npg_alarm {
    int64_t key;
    side sides[NPG_DIRECTIONS];
};

npg_status npg_alarm_open(npg_alarm **out, int64_t key)
{
    NPG_TRY(npg_alloc(out, NPG_FOR_RUN, sizeof **out));
    (*out)->key = key;
    return NPG_OK;
}

void npg_alarm_close(npg_alarm **slot)
{
    if (!*slot) return;
    for (int d = 0; d < NPG_DIRECTIONS; d++) npg_release(&(*slot)->sides[d].waiting);
    npg_release(slot);
}

/* ---- the usual level ---- */

static double median_of(double *values, size_t count)
{
    qsort(values, count, sizeof *values, npg_order_double);
    return count ? 0.5 * (values[(count - 1) / 2] + values[count / 2]) : 0;
}

double npg_misfit_floor(int kind)
{
    return kinds[kind].floor;
}

npg_level npg_level_of(double *values, size_t count, double floor)
{
    double usual = median_of(values, count);
    for (size_t i = 0; i < count; i++) values[i] = fabs(values[i] - usual);
    double spread = NPG_CLEARLY * NPG_BEYOND * NPG_DEVIATIONS_PER_MEDIAN * median_of(values, count);
    return (npg_level){usual, fmax(fmax(floor, spread), usual)};
}

static npg_level level_of(const double *history, size_t ever, double floor)
{
    double values[HISTORY];
    size_t count = ever < HISTORY ? ever : HISTORY;
    memcpy(values, history, count * sizeof *values);
    qsort(values, count, sizeof *values, npg_order_double);
    double most = count ? values[(size_t)(NPG_MOST * (double)(count - 1))] : 0;
    /* The reference is made from the keyframe, which is better than usual; few others say what is. */
    npg_level level = npg_level_of(values, count, count > NPG_ALARM_FRAMES ? floor : NPG_CLEARLY * floor);
    /* What some frames have and most have not, as holes tear surface, has no median deviation. */
    level.bound = fmax(level.bound, NPG_CLEARLY * (most - level.usual));
    return level;
}

static void add_to_history(side *s, const record *r)
{
    if (!s->history_count) s->key_fit = r->fit;
    size_t at = s->history_count++ % HISTORY;
    for (int k = 0; k < NPG_MISFITS; k++) s->history[k][at] = r->misfits[k].share;
}

/* ---- one frame in its turn ---- */

static double excess(const record *r, const npg_level *levels, int kind)
{
    return r->misfits[kind].share - levels[kind].usual;
}

static bool is_lost(const side *s, const record *r)
{
    return r->fit > fmax(LOST_FIT, NPG_BEYOND * s->key_fit);
}

/* Which misfits are a sign of another topology, and not of a surface that has lost the points: where points
 * and surface miss each other, much is far and much is unsupported. */
static void select_misfits(bool counts[NPG_MISFITS], const side *s, const record *r, const npg_level *levels)
{
    double far = fmax(excess(r, levels, NPG_MISFIT_FAR), 0),
           unsupported = fmax(excess(r, levels, NPG_MISFIT_UNSUPPORTED), 0);
    bool is_off = is_lost(s, r);
    counts[NPG_MISFIT_FAR] = far > NPG_CLEARLY * unsupported;
    counts[NPG_MISFIT_UNSUPPORTED] = !is_off && unsupported > NPG_CLEARLY * far;
    counts[NPG_MISFIT_STRETCHED] = !is_off && NPG_CLEARLY * far < levels[NPG_MISFIT_FAR].bound;
    counts[NPG_MISFIT_VACATED] = counts[NPG_MISFIT_STRETCHED];
}

/* What a misfit of so many times its bound adds to a row of unexplained frames. */
static double weight_of(int kind, double times)
{
    return times > 1 ? kinds[kind].weight : 0;
}

static bool is_clearer(int kind, double times, int than_kind, double than_times)
{
    double more = weight_of(kind, times) - weight_of(than_kind, than_times);
    return more > 0 || (more >= 0 && times > than_times);
}

/* The clearest misfit of a frame; the result is how many times its bound it lies above the usual. */
static double clearest(npg_alarm_cause *cause, const side *s, const record *r)
{
    npg_level levels[NPG_MISFITS];
    bool counts[NPG_MISFITS];
    double most = -1;
    for (int k = 0; k < NPG_MISFITS; k++)
        levels[k] = level_of(s->history[k], s->history_count, kinds[k].floor);
    select_misfits(counts, s, r, levels);
    for (int k = 0; k < NPG_MISFITS; k++) {
        double times = excess(r, levels, k) / levels[k].bound;
        if (!counts[k]) times = fmin(times, 1); /* no sign by itself, but a change may begin so */
        if (!(times > -1) || (most > -1 && !is_clearer(k, times, cause->misfit, most))) continue;
        most = times;
        *cause = (npg_alarm_cause){.seen_index = r->index,
                                   .seen_number = r->number,
                                   .misfit = k,
                                   .value = r->misfits[k].share,
                                   .usual = levels[k].usual,
                                   .bound = levels[k].bound};
        memcpy(cause->at, r->misfits[k].at, sizeof cause->at);
    }
    return most;
}

static double times_bound(const npg_alarm_cause *cause)
{
    return (cause->value - cause->usual) / cause->bound;
}

/* The last `row` frames of the run are unexplained: it dates from the first suspect one. */
static void raise_alarm(side *s, size_t row)
{
    size_t first_unexplained = s->run_count - row, best = first_unexplained;
    size_t first = first_unexplained > NPG_ALARM_FRAMES ? first_unexplained - NPG_ALARM_FRAMES : 0;
    for (size_t i = first_unexplained; i < s->run_count; i++)
        if (is_clearer(s->run[i].cause.misfit, times_bound(&s->run[i].cause), s->run[best].cause.misfit,
                       times_bound(&s->run[best].cause)))
            best = i;
    s->cause = s->run[best].cause;
    s->cause.index = s->run[first].frame.index;
    s->cause.number = s->run[first].frame.number;
    s->is_raised = true;
}

static void clear_suspects(side *s)
{
    for (size_t i = 0; i < s->run_count; i++) add_to_history(s, &s->run[i].frame);
    s->run_count = s->run_length = 0;
}

/* The oldest suspect frame goes into the history: a long run of merely suspect frames becomes usual. */
static void drop_oldest_suspect(side *s)
{
    if (s->run_count < RUN_MAX) return;
    add_to_history(s, &s->run[0].frame);
    memmove(s->run, s->run + 1, (RUN_MAX - 1) * sizeof *s->run);
    s->run_count--;
}

static void process_frame(side *s, const record *r)
{
    npg_alarm_cause cause;
    if (s->is_raised || !isfinite(r->misfits[NPG_MISFIT_FAR].share)) return;
    double times = s->history_count ? clearest(&cause, s, r) : -1; /* the keyframe is what is usual */
    if (!(NPG_CLEARLY * times > 1)) {
        clear_suspects(s);
        /* A frame whose fit is off everywhere must not raise what is usual. */
        if (!s->history_count || !is_lost(s, r)) add_to_history(s, r);
        return;
    }
    drop_oldest_suspect(s);
    s->run_length++;
    s->run[s->run_count++] = (struct suspect){*r, times > 1, cause};
    size_t row = 0;
    double weight = 0;
    while (row < s->run_count && s->run[s->run_count - 1 - row].is_unexplained) {
        row++;
        weight += kinds[s->run[s->run_count - row].cause.misfit].weight;
    }
    if (weight >= NPG_ALARM_FRAMES && s->run_length - row <= 2 * NPG_ALARM_FRAMES) raise_alarm(s, row);
}

/* ---- order ---- */

static void process_waiting(side *s, bool is_end)
{
    size_t done = 0;
    while (done < s->waiting_count && (is_end || s->waiting[done].away == s->next)) {
        s->next = s->waiting[done].away + 1;
        process_frame(s, &s->waiting[done++]);
    }
    s->waiting_count -= done;
    if (s->waiting_count) memmove(s->waiting, s->waiting + done, s->waiting_count * sizeof *s->waiting);
}

/* Those nearest the keyframe come first. */
static npg_status queue_frame(side *s, const record *r)
{
    NPG_TRY(npg_grow(&s->waiting, &s->waiting_room, s->waiting_count + 1, sizeof *s->waiting, NPG_FOR_RUN));
    size_t at = s->waiting_count++;
    for (; at > 0 && s->waiting[at - 1].away > r->away; at--) s->waiting[at] = s->waiting[at - 1];
    s->waiting[at] = *r;
    process_waiting(s, false);
    return NPG_OK;
}

npg_status npg_alarm_add(npg_alarm *alarm, const npg_frame *frame)
{
    record r = {.index = frame->index, .number = frame->number, .away = llabs(frame->index - alarm->key)};
    memcpy(r.misfits, frame->figures.misfits, sizeof r.misfits);
    r.fit = (double)(float)frame->figures.point_dist_median; /* as a resumed run reads it back */
    if (frame->index >= alarm->key) NPG_TRY(queue_frame(&alarm->sides[NPG_FORWARD], &r));
    return frame->index <= alarm->key ? queue_frame(&alarm->sides[NPG_BACKWARD], &r) : NPG_OK;
}

void npg_alarm_finish(npg_alarm *alarm)
{
    for (int d = 0; d < NPG_DIRECTIONS; d++) process_waiting(&alarm->sides[d], true);
}

const npg_alarm_cause *npg_alarm_raised(const npg_alarm *alarm, int direction)
{
    const side *s = &alarm->sides[direction];
    return s->is_raised ? &s->cause : NULL;
}

/* ---- as text and as JSON ---- */

void npg_alarm_text(char *text, size_t size, const npg_alarm_cause *cause)
{
    snprintf(text, size, "%.3g %% %s, around (%.4g, %.4g, %.4g) in frame %lld; usual is %.3g %%",
             100 * cause->value, kinds[cause->misfit].what, cause->at[0], cause->at[1], cause->at[2],
             (long long)cause->seen_number, 100 * cause->usual);
}

json_t *npg_alarm_json(const npg_alarm_cause *cause)
{
    char text[256];
    if (!cause) return json_null();
    npg_alarm_text(text, sizeof text, cause);
    return json_pack("{sI sI ss sf sf sf sI so ss}", "from_frame", (json_int_t)cause->number, "from_index",
                     (json_int_t)cause->index, "figure", kinds[cause->misfit].name, "value", cause->value,
                     "usual", cause->usual, "bound", cause->bound, "frame", (json_int_t)cause->seen_number,
                     "at", npg_json_place(cause->at), "cause", text);
}
