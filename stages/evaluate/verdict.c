/* Verdict: what is wrong with a frame shows, for some faults, only beside the others of its capture. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "evaluate/evaluate_internal.h"
#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "pipeline/order.h"

/* NPG_BEYOND times the motion of the frames around is a jump: motions of dancers and animals, at an eighth of their frames too,
 * reach 2, a film's chicken 2.6 and 4 to 9 where it leaps; mirrored frames and other bodies 4 to 28. */
enum { AROUND = NPG_ALARM_FRAMES }; /* motions on either side that tell what is usual, odd frames in a row */

typedef struct npg_verdict_record {
    int64_t index, number;
    double fit, uncovered, vertex_dist, torn, bare; /* the last two: of the largest place, of the area */
    float marks[3 * NPG_MARKS];
    int fault; /* NPG_FAULT_*: what the frame's own bars have found, then what is found here */
    bool is_late;
    double value, bound;
} record;

npg_status npg_verdict_add(npg_verdict *verdict, const npg_frame *frame)
{
    const npg_figures *f = &frame->figures;
    if (frame->is_shared || !isfinite(f->coverage)) return NPG_OK;
    NPG_TRY(npg_grow(&verdict->records, &verdict->room, verdict->count + 1, sizeof *verdict->records,
                     NPG_FOR_RUN));
    record *r = &verdict->records[verdict->count++];
    *r = (record){.index = frame->index,
                  .number = frame->number,
                  .fit = (double)(float)f->point_dist_median, /* as a resumed run reads it back */
                  .uncovered = (double)(float)(1 - f->coverage),
                  .vertex_dist = (double)(float)f->vertex_dist_mean,
                  .torn = (double)(float)f->misfits[NPG_MISFIT_STRETCHED].share,
                  .bare = (double)(float)f->misfits[NPG_MISFIT_UNSUPPORTED].share,
                  .fault = f->fault};
    memcpy(r->marks, f->marks, sizeof r->marks);
    return NPG_OK;
}

/* ---- beside what is usual in the capture ---- */

static npg_status values_of_all(double **values, const npg_verdict *v, size_t offset)
{
    NPG_TRY(npg_alloc_array(values, NPG_FOR_RUN, v->count, sizeof **values));
    for (size_t i = 0; i < v->count; i++)
        (*values)[i] = *(const double *)((const char *)&v->records[i] + offset);
    return NPG_OK;
}

static npg_status level_of_all(npg_level *level, const npg_verdict *v, size_t offset, double floor)
{
    double *values;
    NPG_TRY(values_of_all(&values, v, offset));
    *level = npg_level_of(values, v->count, floor);
    npg_release(&values);
    return NPG_OK;
}

/* The share without points that a frame may have.  Half of the frames may be wrong, but hardly three of four; holes in
 * the points differ less than that, but a side that turns away from its sensors is no hole. */
static npg_status judge_holes(double *most, const npg_verdict *v)
{
    double *values, floor = v->bars.uncovered;
    NPG_TRY(values_of_all(&values, v, offsetof(record, uncovered)));
    qsort(values, v->count, sizeof *values, npg_order_double);
    double best = NPG_CLEARLY * (values[v->count / 4] + 2 * NPG_FEW * floor);
    npg_level level = npg_level_of(values, v->count, floor);
    *most = v->bars.is_seen_from || floor >= 1 ? level.usual + level.bound : best;
    npg_release(&values);
    return NPG_OK;
}

static void find_fault(record *r, int fault, double value, double bound)
{
    if (r->fault || !(value > bound)) return;
    r->fault = fault;
    r->is_late = true;
    r->value = value;
    r->bound = bound;
}

static npg_status judge_levels(npg_verdict *v, npg_level *dist)
{
    npg_level torn, bare;
    double most;
    NPG_TRY(judge_holes(&most, v));
    NPG_TRY(level_of_all(dist, v, offsetof(record, vertex_dist), v->bars.vertex_dist));
    NPG_TRY(level_of_all(&torn, v, offsetof(record, torn), npg_misfit_floor(NPG_MISFIT_STRETCHED)));
    NPG_TRY(level_of_all(&bare, v, offsetof(record, bare), npg_misfit_floor(NPG_MISFIT_UNSUPPORTED)));
    for (size_t i = 0; i < v->count; i++) {
        record *r = &v->records[i];
        find_fault(r, NPG_FAULT_UNCOVERED, r->uncovered, most);
        find_fault(r, NPG_FAULT_DISTANCE, r->vertex_dist, dist->usual + 2 * dist->bound);
        /* Over a hole in the points surface stretches, too; no more of it is bare than of a hole elsewhere. */
        if (NPG_CLEARLY * (r->bare - bare.usual) > bare.bound)
            find_fault(r, NPG_FAULT_TORN, r->torn, torn.usual + torn.bound);
    }
    return NPG_OK;
}

/* ---- beside the frames around ---- */

/* How far the marks have moved between two frames, on average and for each step in time. */
static double motion_between(const record *a, const record *b)
{
    double sum = 0;
    for (size_t k = 0; k < NPG_MARKS; k++) sum += npg_vec3_distance(a->marks + 3 * k, b->marks + 3 * k);
    return sum / NPG_MARKS / (double)(b->index - a->index);
}

/* Of what the frames around move from one to the next, `at` and the one before it left out: the second largest,
 * so that one more jump doesn't count, and a body that begins to move or swings does not jump.  As many at the
 * capture's ends. */
static double motion_around(const npg_verdict *v, size_t at)
{
    double motions[2 * AROUND];
    size_t count = 0, most = v->count - 1, first = at > AROUND + 1 ? at - AROUND : 1;
    if (first + 2 * AROUND > most) first = most > 2 * AROUND ? most - 2 * AROUND : 1;
    for (size_t i = first; i <= first + 2 * AROUND && i <= most; i++)
        if (i != at) motions[count++] = motion_between(&v->records[i - 1], &v->records[i]);
    qsort(motions, count, sizeof *motions, npg_order_double);
    return count > 2 ? motions[count - 2] : (double)INFINITY;
}

/* Whether the body has jumped on its way to a frame.  Less than points lie from the surface is no motion. */
static bool has_jumped(const npg_verdict *v, size_t at, double least, double *motion, double *bound)
{
    if (at < 1 || at >= v->count) return false;
    *motion = motion_between(&v->records[at - 1], &v->records[at]);
    *bound = fmax(NPG_BEYOND * motion_around(v, at), least);
    return *motion > *bound;
}

/* How many frames from `at` on are odd: after them the body is where it would have come to at its usual motion.
 * 0: it stays away. */
static size_t count_odd(const npg_verdict *v, size_t at, double usual)
{
    for (size_t odd = 1; odd <= AROUND && at + odd < v->count; odd++)
        if (motion_between(&v->records[at - 1], &v->records[at + odd]) <= usual) return odd;
    return 0;
}

/* Of two frames with a jump between them, the one farther from the keyframe is the first that can't be
 * trusted. */
static void judge_jumps(npg_verdict *v, double least)
{
    double motion, bound;
    for (size_t i = 1; i < v->count; i++) {
        if (!has_jumped(v, i, least, &motion, &bound)) continue;
        size_t odd = count_odd(v, i, bound / NPG_BEYOND);
        size_t first = !odd && v->records[i].index <= v->key ? i - 1 : i;
        for (size_t k = first; k < first + (odd ? odd : 1); k++)
            find_fault(&v->records[k], NPG_FAULT_JUMP, motion, bound);
        i += odd; /* and the way back is none */
    }
}

/* ---- all of it ---- */

static int by_index(const void *left, const void *right)
{
    const record *a = left, *b = right;
    return (a->index > b->index) - (a->index < b->index);
}

static npg_status list_faults(const npg_verdict *v, npg_late_faults *late)
{
    NPG_TRY(npg_alloc_array(&late->faults, NPG_FOR_RUN, v->count, sizeof *late->faults));
    for (size_t i = 0; i < v->count; i++) {
        const record *r = &v->records[i];
        if (!r->is_late) continue;
        late->faults[late->count++] =
            (struct npg_late_fault){r->index, r->number, r->fault, 100 * r->value, 100 * r->bound};
    }
    return NPG_OK;
}

npg_status npg_verdict_finish(npg_verdict *v, npg_late_faults *late)
{
    npg_level fit = {0}, dist;
    *late = (npg_late_faults){0};
    if (v->count) NPG_TRY(level_of_all(&fit, v, offsetof(record, fit), 0));
    v->fit = fit.usual;
    if (v->count <= NPG_ALARM_FRAMES) return NPG_OK; /* too few to say what is usual */
    qsort(v->records, v->count, sizeof *v->records, by_index);
    NPG_TRY(judge_levels(v, &dist));
    judge_jumps(v, fmax(dist.usual, v->bars.jump));
    return list_faults(v, late);
}
