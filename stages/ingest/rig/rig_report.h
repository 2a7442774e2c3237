/* Rig report: what comparing sensors found, as JSON and text. */
#ifndef NPG_RIG_REPORT_H
#define NPG_RIG_REPORT_H

#include "ingest/rig/rig.h"
#include "pipeline/json_file.h"

/* Put "pose" ("aligned", "off" ...), "shift", "turn_deg", their deviations, and "correction" (four rows of
 * four, only where it is off) into a sensor's object; lengths in the rig's unit, null: not known. */
void npg_rig_report_pose(json_t *sensor, const npg_rig_view *view);

/* The same as one phrase: "off by 12.3 mm and 0.70 deg (deviation 0.8 mm, 0.03 deg)". */
void npg_rig_describe_pose(char *text, size_t size, const npg_rig *rig, const npg_rig_view *view);

/* A length in the rig's unit: "12.3 mm" where that is m, cm or mm. */
void npg_rig_describe_length(char *text, size_t size, const npg_rig *rig, double length);

#endif
