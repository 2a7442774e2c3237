/* Topology: what a run does when its reference no longer explains the capture (alarm.h): it says from which
 * frame, or ends there so that another reference can take over (option alarm = split;
 * tools/segments/segments.h). */
#ifndef NPG_TOPOLOGY_H
#define NPG_TOPOLOGY_H

#include "pipeline/stage.h"

enum { NPG_ALARM_REPORT, NPG_ALARM_SPLIT }; /* the words of --alarm */

typedef struct npg_topology_settings {
    int mode;                          /* NPG_ALARM_*                                                   */
    int64_t segment_min;               /* frames that a segment must have, for a run to end for another */
    int64_t shared_first, shared_last; /* frames at the ends that other segments explain                */
} npg_topology_settings;

typedef struct npg_topology npg_topology;

/* facts->plan is known. */
npg_status npg_topology_open(npg_topology **topology, const npg_topology_settings *settings, int64_t key);
void npg_topology_close(npg_topology **topology);

/* Whether a frame belongs to another segment. */
bool npg_topology_is_shared(const npg_topology_settings *settings, const npg_facts *facts, int64_t index);

/* A frame with its figures; any order.  Warns when it makes the alarm go off.
 * With NPG_ALARM_SPLIT, where both segments get their least number of frames: the place is written to
 * OUT/topology.json and NPG_CHANGED returned. */
npg_status npg_topology_add(npg_topology *topology, npg_worker *worker, const npg_frame *frame);

/* After the last frame: the report's "topology", and facts->changed_at. */
npg_status npg_topology_finish(npg_topology *topology, npg_worker *worker);

#endif
