/* Rig report: what comparing sensors found, as JSON and text. */
#include "ingest/rig/rig_internal.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

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
