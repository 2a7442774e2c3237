/* Pose cache: in memory between two passes, in the job's store between two runs. */
#include "align/align_internal.h"

#include <math.h>
#include <xxhash.h>

#include "job/job.h"

#define BLOCK_POSE  "pose"        /* of a record of a frame                              */
#define BLOCK_STATE "state"       /* of one of a group                                   */
#define BLOCK_OF    "align.poses" /* of a state: what the poses of its map are of        */

/* What stays between two passes. */
typedef struct between {
    npg_tracker *tracker; /* of the reference that the poses are of      */
    npg_store *store;     /* where they are; NULL: there is no tracker   */
    uint64_t of;
    bool owns;
} between;

static void drop(between *b)
{
    npg_tracker_close(&b->tracker);
    if (b->owns) npg_store_close(&b->store);
    b->store = NULL;
}

static void release_between(void *thing)
{
    between *b = thing;
    drop(b);
    npg_release(&b);
}

void npg_pose_cache_close(npg_pose_cache *c)
{
    if (c->owns) npg_store_close(&c->known);
    if (c->owns) npg_store_close(&c->found);
    npg_pose_map_close(&c->map);
    npg_release(&c->known_pose);
}

/* ---- what is known ---- */

static npg_status restore_known(npg_pose_cache *c, const npg_worker *worker)
{
    npg_job *job = npg_job_of(worker);
    const npg_record *state = npg_job_state(job);
    NPG_TRY(npg_pose_map_load(&c->map, state));
    if (!c->map.count) return NPG_OK; /* the reference is the keyframe's own */
    NPG_TRY(npg_record_get(state, BLOCK_OF, &c->known_of, sizeof c->known_of));
    if (c->map.count != c->node_count)
        return npg_error(NPG_BAD_INPUT, "the state to resume from has poses for %zu nodes, not %zu",
                         c->map.count, c->node_count);
    c->known = npg_job_store(job);
    return NPG_OK;
}

/* The poses of the pass before, or of the run that is resumed. */
static npg_status open_known(npg_pose_cache *c, npg_worker *worker, const npg_tracker *tracker)
{
    between *b = npg_worker_kept(worker);
    npg_job *job = npg_job_of(worker);
    if (b && !npg_worker_facts(worker)->brief.takes_poses) drop(b); /* another key's, or stretched */
    if (b && b->store) {
        NPG_TRY(npg_pose_map_open(&c->map, b->tracker, tracker));
        c->known = b->store;
        c->known_of = b->of;
        b->store = NULL;
        npg_tracker_close(&b->tracker);
    } else if (npg_worker_facts(worker)->is_resumed) {
        NPG_TRY(restore_known(c, worker));
    }
    if (!c->known) return NPG_OK;
    if (job && npg_worker_pass(worker) == NPG_PASS_SOLVE) npg_job_keep_poses(job, c->known_of);
    return npg_alloc(&c->known_pose, NPG_FOR_FIT, npg_pose_bytes(c->map.old_count));
}

/* ---- what is found ---- */

/* What must be the same for poses to be taken over: job, reference, and sizes. */
static npg_status make_of(uint64_t *of, const npg_worker *worker, const npg_tracker *tracker,
                          size_t group_bytes)
{
    const npg_mesh *mesh = npg_tracker_reference(tracker);
    uint64_t key[5] = {0, XXH3_64bits(mesh->vert_pos, mesh->vert_count * 3 * sizeof(float)),
                       XXH3_64bits(mesh->faces, mesh->face_count * 3 * sizeof(uint32_t)),
                       npg_tracker_node_count(tracker), group_bytes};
    if (npg_job_of(worker)) NPG_TRY(npg_job_fusing_key(worker, &key[0]));
    *of = XXH3_64bits(key, sizeof key);
    return NPG_OK;
}

static npg_status open_found(npg_pose_cache *c, npg_worker *worker, const npg_tracker *tracker,
                             size_t group_bytes)
{
    if (c->owns)
        NPG_TRY(npg_store_open_nameless(&c->found, NULL));
    else
        c->found = npg_job_store(npg_job_of(worker));
    NPG_TRY(make_of(&c->found_of, worker, tracker, group_bytes));
    size_t groups = npg_store_count(c->found, NPG_RECORD_GROUP, c->found_of);
    if (groups)
        npg_worker_log(worker, NPG_LOG_INFO, -1,
                       "%zu groups of frames that an earlier run followed are read back", groups);
    return NPG_OK;
}

npg_status npg_pose_cache_open(npg_pose_cache *c, npg_worker *worker, const npg_tracker *tracker,
                               size_t group_bytes)
{
    c->owns = !npg_job_of(worker);
    c->node_count = npg_tracker_node_count(tracker);
    NPG_TRY(open_known(c, worker, tracker));
    if (npg_worker_pass(worker) != NPG_PASS_FUSE) return NPG_OK;
    return open_found(c, worker, tracker, group_bytes);
}

/* ---- frames and groups ---- */

static npg_status read_block(npg_store *store, const char *kind, int64_t index, uint64_t of,
                             const char *block, void *data, size_t size)
{
    npg_record *record;
    NPG_TRY(npg_store_read(store, &record, kind, index, of));
    npg_status status = npg_record_get(record, block, data, size);
    npg_record_close(&record);
    return status;
}

/* Rounded, as poses are good to start from. */
npg_status npg_pose_cache_start(const npg_pose_cache *c, const npg_tracker *tracker, int64_t index,
                                double *pose, bool *is_known)
{
    *is_known = false;
    if (!c->known || !npg_store_has(c->known, NPG_RECORD_POSE, index, c->known_of)) return NPG_OK;
    size_t count = c->map.old_count * NPG_POSE_SIZE;
    NPG_TRY(read_block(c->known, NPG_RECORD_POSE, index, c->known_of, BLOCK_POSE, c->known_pose,
                       count * sizeof(double)));
    for (size_t i = 0; i < count; i++) c->known_pose[i] = (double)(float)c->known_pose[i];
    *is_known = !isnan(c->known_pose[0]);
    if (*is_known) npg_pose_map_apply(&c->map, tracker, pose, c->known_pose);
    return NPG_OK;
}

bool npg_pose_cache_has_group(const npg_pose_cache *c)
{
    return c->found && npg_store_has(c->found, NPG_RECORD_GROUP, c->group_at, c->found_of);
}

npg_status npg_pose_cache_read(const npg_pose_cache *c, int64_t index, double *pose)
{
    return read_block(c->found, NPG_RECORD_POSE, index, c->found_of, BLOCK_POSE, pose,
                      npg_pose_bytes(c->node_count));
}

npg_status npg_pose_cache_read_end(npg_pose_cache *c, void *state, size_t size)
{
    return read_block(c->found, NPG_RECORD_GROUP, c->group_at++, c->found_of, BLOCK_STATE, state, size);
}

npg_status npg_pose_cache_put(const npg_pose_cache *c, int64_t index, const double *pose)
{
    if (!c->found) return NPG_OK;
    npg_store_begin(c->found, NPG_RECORD_POSE, index, c->found_of);
    npg_status status = npg_store_put(c->found, BLOCK_POSE, pose, npg_pose_bytes(c->node_count));
    return npg_store_end(c->found, status, false);
}

npg_status npg_pose_cache_put_end(npg_pose_cache *c, const void *state, size_t size)
{
    if (!c->found || c->owns) return NPG_OK;
    npg_store_begin(c->found, NPG_RECORD_GROUP, c->group_at++, c->found_of);
    npg_status status = npg_store_put(c->found, BLOCK_STATE, state, size);
    return npg_store_end(c->found, status, true);
}

/* ---- to the next pass ---- */

npg_status npg_pose_cache_leave(npg_pose_cache *c, npg_worker *worker, npg_tracker **tracker)
{
    between *b = npg_worker_kept(worker);
    if (!c->found) return NPG_OK;
    if (!b) {
        NPG_TRY(npg_alloc(&b, NPG_FOR_FIT, sizeof *b));
        npg_worker_keep(worker, b, release_between);
    }
    *b = (between){*tracker, c->found, c->found_of, c->owns};
    *tracker = NULL;
    c->found = NULL;
    return NPG_OK;
}

npg_status npg_pose_cache_save(const npg_pose_cache *c, npg_store *out)
{
    if (!c->known) return NPG_OK;
    NPG_TRY(npg_store_put(out, BLOCK_OF, &c->known_of, sizeof c->known_of));
    return npg_pose_map_save(&c->map, out);
}
