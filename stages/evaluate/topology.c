/* Topology: what a run does when its reference stops to explain the capture. */

#include "evaluate/evaluate_internal.h"
#include "pipeline/json_file.h"

static const char *const directions[NPG_DIRECTIONS] = {"forward", "backward"};

/* One behind the last frame that is the run's own; open while the source is. */
static int64_t own_end(const npg_topology *t, const npg_facts *facts)
{
    return facts->frame_count < 0 ? INT64_MAX : facts->frame_count - t->shared_last;
}

bool npg_topology_is_shared(const npg_topology *t, const npg_facts *facts, int64_t index)
{
    return index < t->shared_first || index >= own_end(t, facts);
}

/* Whether both parts are long enough to stand alone. */
static bool may_split(const npg_topology *t, const npg_facts *facts, int direction, int64_t index)
{
    int64_t first = t->shared_first, end = own_end(t, facts);
    int64_t cut = direction == NPG_FORWARD ? index : index + 1;
    return t->mode == NPG_ALARM_SPLIT && cut - first >= t->segment_min && end - cut >= t->segment_min;
}

/* ---- the end of a run for another reference: OUT/topology.json ---- */

static npg_status end_for_split(npg_topology *t, npg_worker *worker, int direction)
{
    const npg_alarm_cause *cause = npg_alarm_raised(t->alarm, direction);
    json_t *record =
        json_pack("{ss sI so}", "direction", directions[direction], "key_index",
                  (json_int_t)npg_worker_facts(worker)->plan.key, "alarm", npg_alarm_json(cause));
    npg_status status = npg_json_write(npg_worker_settings(worker)->output, "topology.json", record);
    json_decref(record);
    return status
               ? status
               : npg_error(NPG_CHANGED, "the reference does not explain frame %lld: the run ends for another",
                           (long long)cause->number);
}

/* ---- frames ---- */

static npg_status report_direction(npg_topology *t, npg_worker *worker, int direction)
{
    const npg_alarm_cause *cause = npg_alarm_raised(t->alarm, direction);
    const char *on = direction == NPG_FORWARD ? "on" : "back";
    char text[256];
    if (!cause || t->is_reported[direction]) return NPG_OK;
    t->is_reported[direction] = true;
    npg_alarm_text(text, sizeof text, cause);
    if (may_split(t, npg_worker_facts(worker), direction, cause->index)) {
        npg_worker_log(worker, NPG_LOG_INFO, cause->number,
                       "from here %s the reference no longer explains the points: %s", on, text);
        return end_for_split(t, worker, direction);
    }
    npg_worker_warn(worker, true, cause->number,
                    "from here %s the reference no longer explains the points: %s", on, text);
    return NPG_OK;
}

/* A fusing pass only wants to know. */
static npg_status report_both(npg_topology *t, npg_worker *worker)
{
    if (npg_worker_pass(worker) == NPG_PASS_FUSE) return NPG_OK;
    for (int d = 0; d < NPG_DIRECTIONS; d++) NPG_TRY(report_direction(t, worker, d));
    return NPG_OK;
}

npg_status npg_topology_add(npg_topology *t, npg_worker *worker, const npg_frame *frame)
{
    if (!t->alarm) NPG_TRY(npg_alarm_open(&t->alarm, npg_worker_facts(worker)->plan.key));
    if (frame->is_shared) return NPG_OK;
    NPG_TRY(npg_alarm_add(t->alarm, frame));
    return report_both(t, worker);
}

npg_status npg_topology_finish(npg_topology *t, npg_worker *worker)
{
    if (!t->alarm) return NPG_OK;
    json_t *record = json_object();
    npg_alarm_finish(t->alarm);
    for (int d = 0; d < NPG_DIRECTIONS; d++) {
        const npg_alarm_cause *cause = npg_alarm_raised(t->alarm, d);
        json_object_set_new(record, directions[d], npg_alarm_json(cause));
        (*npg_own(worker, has_changed))[d] = cause != NULL;
        (*npg_own(worker, changed_at))[d] = cause ? cause->index : 0;
    }
    json_object_set_new(npg_worker_report(worker), "topology", record);
    return report_both(t, worker);
}
