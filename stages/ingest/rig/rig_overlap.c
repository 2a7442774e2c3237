/* How well the sensors of a rig agree: the share of what one sees that others see, too, how far their
 * surfaces lie apart there, and which sensors' poses are off. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "geometry/geometry.h"
#include "ingest/rig/rig_internal.h"

#define COMPARED    24     /* frames at most in which sensors are compared                      */
#define SIGHTS_MAX  256    /* read at once: a rig of many sensors is measured in fewer frames   */
#define SOURCES_MAX 1500   /* points of a sight that are looked up in the others for the overlap */
#define SAME_SHIFT  0.001  /* of the depth: 2.5 mm at 2.5 m, about what rigs are calibrated to      */
#define SAME_TURN   0.0035 /* radians: 0.2 degrees                                              */
#define SURE        3      /* deviations that a correction must be larger than                  */
#define SD_SHIFT    0.002  /* of the depth: with a deviation above this nothing can be said     */
#define SD_TURN     0.0026 /* radians: 0.15 degrees                                             */

/* ---- overlap ---- */

typedef struct sums {
    npg_rig_bins apart;
    size_t seen, asked;
} sums;

static void look_up(sums *all, const npg_rig_sights *s, size_t f, size_t sensor, size_t i)
{
    const npg_rig_sight *of = npg_rig_sights_of(s, f, sensor);
    bool is_seen = false;
    for (size_t o = 0; o < s->sensor_count; o++) {
        npg_rig_sight_pair pair;
        const npg_rig_sight *with = npg_rig_sights_of(s, f, o);
        if (o == sensor || !with->count) continue;
        if (!npg_rig_sight_match(&pair, of, i, of->pose, with, &s->rig->sensors[o].camera, with->pose,
                                 NPG_ALIGN_REACH * s->depth))
            continue;
        npg_rig_bins_add(&all->apart, fabs(pair.off));
        is_seen = true;
    }
    all->seen += is_seen;
    all->asked++;
}

static void compare_sensor(npg_rig_view *view, const npg_rig_sights *s, size_t sensor)
{
    sums all = {.apart.reach = NPG_ALIGN_REACH * s->depth};
    for (size_t f = 0; f < s->frame_count; f++) {
        const npg_rig_sight *of = npg_rig_sights_of(s, f, sensor);
        for (size_t i = 0; i < of->count; i += of->count / SOURCES_MAX + 1) look_up(&all, s, f, sensor, i);
        view->frames += of->is_there;
        view->points += of->point_count;
    }
    view->overlap = all.asked ? (double)all.seen / (double)all.asked : 0;
    view->apart = npg_rig_bins_deviation(&all.apart);
}

/* ---- which poses are off ---- */

/* How far two corrections differ: what the sensors see moves by, where the points are. */
static double difference(const npg_rig_sights *s, const npg_correction *a, const npg_correction *b)
{
    double back[12], between[12], to[3];
    npg_pose_invert(back, a->pose);
    npg_pose_combine(between, back, b->pose);
    npg_pose_apply(to, between, s->centre);
    npg_vec3_sub(to, to, s->centre);
    double cosine = fmin(fmax(0.5 * (between[0] + between[5] + between[10] - 1), -1), 1);
    return npg_vec3_length(to) + acos(cosine) * s->depth;
}

/* Sensors are measured against each other, so one must be right: the one that most agree with (the least sum
 * of differences), the first of equals. */
static size_t most_agreed(const npg_rig_sights *s, const npg_correction *corrections)
{
    size_t best = 0;
    double least = HUGE_VAL;
    for (size_t k = 0; k < s->sensor_count; k++) {
        double sum = 0;
        for (size_t o = 0; o < s->sensor_count; o++) sum += difference(s, &corrections[k], &corrections[o]);
        if (sum >= least * (1 - 1e-9)) continue;
        least = sum;
        best = k;
    }
    return best;
}

/* All corrections as seen from sensor `fixed`, whose own becomes none. */
static void fix(npg_correction *corrections, size_t count, size_t fixed)
{
    double back[12], pose[12];
    npg_pose_invert(back, corrections[fixed].pose);
    for (size_t k = 0; k < count; k++) {
        npg_pose_combine(pose, back, corrections[k].pose);
        memcpy(corrections[k].pose, pose, sizeof pose);
    }
    npg_pose_identity(corrections[fixed].pose);
}

static npg_rig_verdict judge(const npg_rig_sights *s, const npg_correction *c)
{
    if (!(c->shift_sd <= SD_SHIFT * s->depth && c->turn_sd <= SD_TURN)) return NPG_RIG_UNKNOWN;
    bool is_shifted = c->shift > fmax(SAME_SHIFT * s->depth, SURE * c->shift_sd);
    bool is_turned = c->turn > fmax(SAME_TURN, SURE * c->turn_sd);
    return is_shifted || is_turned ? NPG_RIG_OFF : NPG_RIG_ALIGNED;
}

static void tell(npg_rig_view *view, const npg_correction *c)
{
    double known = view->overlap > 0 ? 1 : HUGE_VAL; /* else the deviations are the prior's */
    view->shift = c->shift;
    view->turn_deg = c->turn * 180 / M_PI;
    view->shift_sd = known * c->shift_sd;
    view->turn_sd_deg = known * c->turn_sd * 180 / M_PI;
}

typedef struct aligning {
    const npg_rig_sights *sights;
    npg_rig_view *views;
    npg_correction of[NPG_FRAME_SENSORS_MOST];
    bool is_free[NPG_FRAME_SENSORS_MOST];
} aligning;

static void start(npg_correction *c)
{
    *c = (npg_correction){.shift_sd = HUGE_VAL, .turn_sd = HUGE_VAL};
    npg_pose_identity(c->pose);
}

/* Solve for all sensors but one, and judge them. */
static npg_status find_off(aligning *a)
{
    const npg_rig_sights *s = a->sights;
    for (size_t k = 0; k < s->sensor_count; k++) {
        start(&a->of[k]);
        a->is_free[k] = k > 0;
    }
    NPG_TRY(npg_rig_solve(a->of, s, a->is_free));
    size_t fixed = most_agreed(s, a->of);
    if (fixed) {
        fix(a->of, s->sensor_count, fixed);
        a->is_free[0] = true;
        a->is_free[fixed] = false;
        NPG_TRY(npg_rig_solve(a->of, s, a->is_free));
    }
    for (size_t k = 0; k < s->sensor_count; k++) {
        a->views[k].verdict = k == fixed ? NPG_RIG_FIXED : judge(s, &a->of[k]);
        if (k != fixed) tell(&a->views[k], &a->of[k]);
    }
    return NPG_OK;
}

/* The corrections of those that are off, all others as the files have them: what is right stays as it is, and
 * helps to determine what is not. */
static npg_status correct(aligning *a)
{
    const npg_rig_sights *s = a->sights;
    bool is_any = false;
    for (size_t k = 0; k < s->sensor_count; k++) {
        a->is_free[k] = a->views[k].verdict == NPG_RIG_OFF;
        is_any = is_any || a->is_free[k];
        if (!a->is_free[k]) start(&a->of[k]);
    }
    if (is_any) NPG_TRY(npg_rig_solve(a->of, s, a->is_free));
    for (size_t k = 0; k < s->sensor_count; k++) {
        memcpy(a->views[k].correction, a->of[k].pose, sizeof a->of[k].pose);
        if (a->is_free[k]) tell(&a->views[k], &a->of[k]);
    }
    return NPG_OK;
}

static npg_status align(npg_rig_view *views, const npg_rig_sights *sights)
{
    aligning a = {.sights = sights, .views = views};
    NPG_TRY(find_off(&a));
    return correct(&a);
}

/* ---- the answer ---- */

npg_status npg_rig_compare(npg_rig *rig, npg_rig_view *views, const size_t *frames, size_t count)
{
    npg_rig_sights sights;
    size_t most = SIGHTS_MAX / rig->sensor_count;
    memset(views, 0, rig->sensor_count * sizeof *views);
    for (size_t k = 0; k < rig->sensor_count; k++) npg_pose_identity(views[k].correction);
    size_t chosen[COMPARED];
    if (most > COMPARED) most = COMPARED;
    if (most > count) most = count;
    for (size_t i = 0; i < most; i++) chosen[i] = frames[npg_spread_index(i, most, count)];
    NPG_TRY(npg_rig_sights_open(&sights, rig, chosen, most));
    for (size_t k = 0; k < rig->sensor_count; k++) {
        views[k].depth = sights.depth;
        compare_sensor(&views[k], &sights, k);
    }
    npg_status status = rig->sensor_count > 1 ? align(views, &sights) : NPG_OK;
    npg_rig_sights_close(&sights);
    return status;
}

/* ---- as JSON and text ---- */

static const char *const verdicts[] = {[NPG_RIG_ALONE] = "alone",
                                       [NPG_RIG_FIXED] = "reference",
                                       [NPG_RIG_ALIGNED] = "aligned",
                                       [NPG_RIG_OFF] = "off",
                                       [NPG_RIG_UNKNOWN] = "not determined"};

static bool is_measured(const npg_rig_view *view)
{
    return view->verdict != NPG_RIG_ALONE && view->verdict != NPG_RIG_FIXED && isfinite(view->shift_sd);
}

static json_t *json_of_pose(const double pose[12])
{
    json_t *rows = json_array();
    for (size_t i = 0; i < 16; i++) json_array_append_new(rows, json_real(i < 12 ? pose[i] : i == 15));
    return rows;
}

void npg_rig_report_pose(json_t *sensor, const npg_rig_view *view)
{
    bool has = is_measured(view);
    json_object_set_new(sensor, "pose", json_string(verdicts[view->verdict]));
    json_object_set_new(sensor, "shift", has ? npg_json_real(view->shift) : json_null());
    json_object_set_new(sensor, "turn_deg", has ? npg_json_real(view->turn_deg) : json_null());
    json_object_set_new(sensor, "shift_sd", has ? npg_json_real(view->shift_sd) : json_null());
    json_object_set_new(sensor, "turn_sd_deg", has ? npg_json_real(view->turn_sd_deg) : json_null());
    if (view->verdict == NPG_RIG_OFF)
        json_object_set_new(sensor, "correction", json_of_pose(view->correction));
}

void npg_rig_describe_length(char *text, size_t size, const npg_rig *rig, double length)
{
    const char *unit = rig->unit ? rig->unit : "m";
    double to_mm = !strcmp(unit, "m") ? 1000 : !strcmp(unit, "cm") ? 10 : !strcmp(unit, "mm");
    if (to_mm > 0)
        snprintf(text, size, "%.1f mm", to_mm * length);
    else
        snprintf(text, size, "%.4g %.20s", length, unit);
}

void npg_rig_describe_pose(char *text, size_t size, const npg_rig *rig, const npg_rig_view *view)
{
    char shift[48], sd[48];
    if (view->verdict == NPG_RIG_ALONE || view->verdict == NPG_RIG_FIXED) {
        snprintf(text, size, "%s",
                 view->verdict == NPG_RIG_FIXED ? "the one that others are measured against" : "alone");
        return;
    }
    if (!is_measured(view)) {
        snprintf(text, size, "not determined: nothing is seen together with others");
        return;
    }
    npg_rig_describe_length(shift, sizeof shift, rig, view->shift);
    npg_rig_describe_length(sd, sizeof sd, rig, view->shift_sd);
    if (view->verdict == NPG_RIG_UNKNOWN)
        snprintf(text, size, "not determined (deviation %s, %.2f deg)", sd, view->turn_sd_deg);
    else
        snprintf(text, size, "%s %s and %.2f deg (deviation %s, %.2f deg)",
                 view->verdict == NPG_RIG_OFF ? "off by" : "aligned:", shift, view->turn_deg, sd,
                 view->turn_sd_deg);
}
