/* Rig alignment: Gauss-Newton over the corrections of all sensors at once. */
#include "ingest/rig/rig_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/parallel.h"

#define SOURCES_MAX 4000   /* points of a sight that are looked up in the others             */
#define STEPS_MAX   25     /* of Gauss-Newton; eight are usual                               */
#define STEP_TURN   0.035  /* radians at most in one step: beyond that pairs are wrong       */
#define DONE        2e-5   /* of the depth (0.05 mm at 2.5 m) and radians: a step that ends it */
#define HUBER       1.345  /* deviations; 95 % of the efficiency of least squares            */
#define CUT         5      /* deviations                                                     */
#define PRIOR_SHIFT 0.04   /* of the depth: 10 cm at 2.5 m                                   */
#define PRIOR_TURN  0.0524 /* radians: 3 degrees                                             */
#define SHARED      2      /* pairs that a pixel is in, as source and as target              */

/* What one frame adds. */
typedef struct frame_sums {
    double *square, *gradient; /* n x n, n */
    npg_rig_bins bins;         /* of |off|        */
} frame_sums;

typedef struct solving {
    npg_arena arena; /* of all its arrays */
    const npg_rig_sights *sights;
    npg_correction *corrections;
    int *slot;                        /* per sensor: place of its six unknowns, -1: held */
    double (*poses)[12];              /* frame_count x sensor_count: corrected;         */
    frame_sums *frames;               /*                                                */
    double *matrix, *gradient, *rows; /* n x n, n, 2 x n;                               */
    size_t unknowns;
    double reach, sigma;
} solving;

static npg_status open_solving(solving *s, const bool *is_free)
{
    size_t frames = s->sights->frame_count, sensors = s->sights->sensor_count;
    npg_arena *arena = &s->arena;
    s->slot = npg_arena_take(arena, sensors, sizeof *s->slot);
    NPG_TRY(npg_arena_status(arena));
    for (size_t k = 0; k < sensors; k++) s->slot[k] = is_free[k] ? (int)(6 * s->unknowns++) : -1;
    size_t n = s->unknowns *= 6;
    s->poses = npg_arena_take(arena, frames * sensors, sizeof *s->poses);
    s->frames = npg_arena_take(arena, frames, sizeof *s->frames);
    s->matrix = npg_arena_take(arena, n * n + 1, sizeof *s->matrix);
    s->rows = npg_arena_take(arena, n + 1, 2 * sizeof *s->rows);
    s->gradient = npg_arena_take(arena, n + 1, sizeof *s->gradient);
    for (size_t f = 0; f < frames && s->frames; f++) {
        s->frames[f].square = npg_arena_take(arena, n * n + 1, sizeof(double));
        s->frames[f].gradient = npg_arena_take(arena, n + 1, sizeof(double));
    }
    return npg_arena_status(arena);
}

/* ---- the sums of a frame ---- */

static void add_block(const solving *s, frame_sums *sums, int row, int column, const double a[6],
                      const double b[6], double weight)
{
    for (size_t i = 0; i < 6; i++)
        for (size_t j = 0; j < 6; j++)
            sums->square[((size_t)row + i) * s->unknowns + (size_t)column + j] += weight * a[i] * b[j];
}

/* d off / d (turn, shift) of the sensor that has the point: (p - centre) x n, n. */
static void jacobian(double out[6], const solving *s, const double point[3], const double normal[3],
                     double sign)
{
    double arm[3];
    npg_vec3_sub(arm, point, s->sights->centre);
    npg_vec3_cross(out, arm, normal);
    for (size_t a = 0; a < 3; a++) {
        out[a] *= sign;
        out[3 + a] = sign * normal[a];
    }
}

static void add_pair(const solving *s, frame_sums *sums, const npg_rig_sight_pair *pair, int of, int with)
{
    double size = fabs(pair->off), own[6], other[6];
    npg_rig_bins_add(&sums->bins, size);
    double weight = size <= HUBER * s->sigma ? 1 : HUBER * s->sigma / size;
    jacobian(own, s, pair->own, pair->normal, 1);
    jacobian(other, s, pair->other, pair->normal, -1);
    if (of >= 0) add_block(s, sums, of, of, own, own, weight);
    if (with >= 0) add_block(s, sums, with, with, other, other, weight);
    if (of >= 0 && with >= 0) {
        add_block(s, sums, of, with, own, other, weight);
        add_block(s, sums, with, of, other, own, weight);
    }
    for (size_t i = 0; i < 6; i++) {
        if (of >= 0) sums->gradient[(size_t)of + i] += weight * own[i] * pair->off;
        if (with >= 0) sums->gradient[(size_t)with + i] += weight * other[i] * pair->off;
    }
}

static npg_status sum_frame(void *user, size_t f)
{
    solving *s = user;
    const npg_rig_sights *sights = s->sights;
    frame_sums *sums = &s->frames[f];
    size_t count = sights->sensor_count, n = s->unknowns;
    memset(sums->square, 0, n * n * sizeof *sums->square);
    memset(sums->gradient, 0, n * sizeof *sums->gradient);
    sums->bins = (npg_rig_bins){.reach = s->reach};
    for (size_t a = 0; a < count; a++)
        for (size_t b = 0; b < count; b++) {
            const npg_rig_sight *of = npg_rig_sights_of(sights, f, a),
                                *with = npg_rig_sights_of(sights, f, b);
            if (a == b || !with->count) continue;
            for (size_t i = 0; i < of->count; i += of->count / SOURCES_MAX + 1) {
                npg_rig_sight_pair pair;
                if (npg_rig_sight_match(&pair, of, i, s->poses[f * count + a], with,
                                        &sights->rig->sensors[b].camera, s->poses[f * count + b], s->reach))
                    add_pair(s, sums, &pair, s->slot[a], s->slot[b]);
            }
        }
    return NPG_OK;
}

static void pose_all(solving *s)
{
    size_t count = s->sights->sensor_count;
    for (size_t i = 0; i < s->sights->frame_count * count; i++)
        npg_pose_combine(s->poses[i], s->corrections[i % count].pose, s->sights->of[i].pose);
}

/* Robust deviation of the residuals. */
static double deviation(const solving *s)
{
    npg_rig_bins all = {.reach = s->reach};
    for (size_t f = 0; f < s->sights->frame_count; f++)
        for (size_t b = 0; b < NPG_RIG_BINS; b++) all.count[b] += s->frames[f].bins.count[b];
    return npg_rig_bins_deviation(&all);
}

static npg_status sum_all(solving *s)
{
    size_t n = s->unknowns;
    pose_all(s);
    NPG_TRY(npg_parallel(sum_frame, s, s->sights->frame_count));
    memset(s->matrix, 0, n * n * sizeof *s->matrix);
    memset(s->gradient, 0, n * sizeof *s->gradient);
    for (size_t f = 0; f < s->sights->frame_count; f++) {
        for (size_t i = 0; i < n * n; i++) s->matrix[i] += s->frames[f].square[i];
        for (size_t i = 0; i < n; i++) s->gradient[i] += s->frames[f].gradient[i];
    }
    s->sigma = fmax(deviation(s), 1e-7 * s->sights->depth);
    return NPG_OK;
}

/* ---- one step ---- */

/* Turn (as a vector of radians) and shift (of the centre) of a correction. */
static void parts_of(double out[6], const npg_correction *c, const double centre[3])
{
    const double *m = c->pose;
    const double axis[3] = {m[9] - m[6], m[2] - m[8], m[4] - m[1]};
    double sine = 0.5 * npg_vec3_length(axis), angle = atan2(sine, 0.5 * (m[0] + m[5] + m[10] - 1)), to[3];
    for (size_t a = 0; a < 3; a++) out[a] = sine > 0 ? 0.5 * axis[a] * angle / sine : 0;
    npg_pose_apply(to, m, centre);
    for (size_t a = 0; a < 3; a++) out[3 + a] = to[a] - centre[a];
}

static void add_prior(solving *s)
{
    size_t n = s->unknowns;
    double shift = PRIOR_SHIFT * s->sights->depth;
    for (size_t k = 0; k < s->sights->sensor_count; k++) {
        double at[6];
        if (s->slot[k] < 0) continue;
        parts_of(at, &s->corrections[k], s->sights->centre);
        for (size_t i = 0; i < 6; i++) {
            size_t row = (size_t)s->slot[k] + i;
            double size = i < 3 ? PRIOR_TURN : shift, weight = s->sigma * s->sigma / (size * size);
            s->matrix[row * n + row] += weight;
            s->gradient[row] += weight * at[i];
        }
    }
}

/* pose = (turn about the centre, then shift) after pose.  The turn is Rodrigues' formula. */
static void move(double pose[12], const double step[6], const double centre[3])
{
    double angle = npg_vec3_length(step), by[12] = {0}, to[3], before[12], axis[3] = {0};
    for (size_t a = 0; a < 3 && angle > 0; a++) axis[a] = step[a] / angle;
    for (size_t r = 0; r < 3; r++) {
        for (size_t c = 0; c < 3; c++)
            by[4 * r + c] = (1 - cos(angle)) * axis[r] * axis[c] + (r == c ? cos(angle) : 0);
        by[4 * r + (r + 1) % 3] -= sin(angle) * axis[(r + 2) % 3];
        by[4 * r + (r + 2) % 3] += sin(angle) * axis[(r + 1) % 3];
    }
    npg_pose_apply(to, by, centre);
    for (size_t a = 0; a < 3; a++) by[4 * a + 3] = centre[a] - to[a] + step[3 + a];
    memcpy(before, pose, sizeof before);
    npg_pose_combine(pose, by, before);
}

/* One step; how large it was, in depths and radians. */
static double step(solving *s)
{
    size_t n = s->unknowns;
    double largest = 0, turned = 0;
    add_prior(s);
    npg_cholesky_factor(s->matrix, n, 1e-300); /* the prior makes it positive definite */
    for (size_t i = 0; i < n; i++) s->gradient[i] = -s->gradient[i];
    npg_cholesky_solve(s->matrix, n, s->gradient);
    for (size_t i = 0; i < n; i++) {
        bool is_turn = i % 6 < 3;
        largest = fmax(largest, fabs(s->gradient[i]) / (is_turn ? 1 : s->sights->depth));
        if (is_turn) turned = fmax(turned, fabs(s->gradient[i]));
    }
    for (size_t i = 0; i < n && turned > STEP_TURN; i++) s->gradient[i] *= STEP_TURN / turned;
    for (size_t k = 0; k < s->sights->sensor_count; k++)
        if (s->slot[k] >= 0) move(s->corrections[k].pose, s->gradient + s->slot[k], s->sights->centre);
    return largest;
}

/* ---- deviations ---- */

/* Mean position of a sensor, corrected. */
static void place_of(double out[3], const solving *s, size_t k)
{
    size_t count = s->sights->sensor_count, seen = 0;
    double sum[3] = {0};
    for (size_t f = 0; f < s->sights->frame_count; f++) {
        if (!npg_rig_sights_of(s->sights, f, k)->is_there) continue;
        for (size_t a = 0; a < 3; a++) sum[a] += s->poses[f * count + k][4 * a + 3];
        seen++;
    }
    for (size_t a = 0; a < 3; a++) out[a] = seen ? sum[a] / (double)seen : s->sights->centre[a];
}

/* Variance of the sum over the unknowns, each times its entry in s->rows (n, and n of scratch behind them):
 * by the residuals' deviation, and by the frames' gradients. */
static double variance(solving *s)
{
    size_t n = s->unknowns, frames = s->sights->frame_count;
    double model = 0, spread = 0, *solved = s->rows + n;
    memcpy(solved, s->rows, n * sizeof *solved);
    npg_cholesky_solve(s->matrix, n, solved);
    for (size_t i = 0; i < n; i++) model += s->rows[i] * solved[i];
    for (size_t f = 0; f < frames; f++) {
        double one = 0;
        for (size_t i = 0; i < n; i++) one += solved[i] * s->frames[f].gradient[i];
        spread += one * one;
    }
    if (frames > 1) spread *= (double)frames / (double)(frames - 1);
    return fmax(SHARED * s->sigma * s->sigma * model, spread);
}

/* The length of a sensor's correction, and its deviation. */
static void describe(solving *s, size_t k)
{
    npg_correction *c = &s->corrections[k];
    double at[6], place[3], before[12], from[3], arm[3], turned = 0, shifted = 0;
    place_of(place, s, k);
    npg_pose_invert(before, c->pose);
    npg_pose_apply(from, before, place);
    npg_vec3_sub(arm, place, s->sights->centre);
    parts_of(at, c, s->sights->centre);
    c->turn = npg_vec3_length(at);
    npg_vec3_sub(from, place, from);
    c->shift = npg_vec3_length(from);
    for (size_t a = 0; a < 3; a++) {
        double *row = s->rows + s->slot[k];
        memset(s->rows, 0, s->unknowns * sizeof *s->rows);
        row[a] = 1;
        turned += variance(s);
        /* component a of turn x arm + shift */
        row[a] = 0;
        row[(a + 1) % 3] = arm[(a + 2) % 3];
        row[(a + 2) % 3] = -arm[(a + 1) % 3];
        row[3 + a] = 1;
        shifted += variance(s);
    }
    c->turn_sd = sqrt(turned);
    c->shift_sd = sqrt(shifted);
}

/* ---- the whole ---- */

static npg_status iterate(solving *s)
{
    double most = NPG_ALIGN_REACH * s->sights->depth;
    s->reach = most;
    s->sigma = most / CUT; /* of the first step: nothing is known yet */
    NPG_TRY(sum_all(s));
    for (int i = 0; i < STEPS_MAX; i++) {
        s->reach = fmin(CUT * s->sigma, most);
        NPG_TRY(sum_all(s));
        if (step(s) < DONE) break;
    }
    for (size_t k = 0; k < s->sights->sensor_count; k++)
        if (s->slot[k] >= 0) describe(s, k);
    return NPG_OK;
}

npg_status npg_rig_solve(npg_correction *corrections, const npg_rig_sights *sights, const bool *is_free)
{
    solving s = {.arena.purpose = NPG_FOR_FILES, .sights = sights, .corrections = corrections};
    npg_status status = open_solving(&s, is_free);
    if (!status && s.unknowns && sights->depth > 0) status = iterate(&s);
    npg_arena_release(&s.arena);
    return status;
}
