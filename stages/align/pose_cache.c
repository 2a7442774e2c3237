/* Pose cache: in memory between two passes, in the job's folder between two runs. */
#include "align/pose_cache.h"

#include "job/job.h"

/* What stays between two passes. */
typedef struct between {
    npg_tracker *tracker; /* of the reference that the poses are of */
    npg_poses *poses;
    int64_t passes; /* fusing passes so far */
} between;

static void release_between(void *thing)
{
    between *b = thing;
    npg_tracker_close(&b->tracker);
    npg_poses_close(&b->poses);
    npg_release(&b);
}

int64_t npg_pose_cache_passes(const npg_worker *worker)
{
    const between *b = npg_worker_kept(worker);
    return b ? b->passes : 0;
}

void npg_pose_cache_close(npg_pose_cache *cache)
{
    npg_poses_close(&cache->known);
    npg_poses_close(&cache->found);
    npg_pose_map_close(&cache->map);
    npg_release(&cache->known_pose);
}

/* Where poses are kept: NULL for a run without a job folder. */
static npg_status poses_path(const npg_worker *worker, char **path, bool is_new)
{
    const npg_job *job = npg_job_of(worker);
    *path = NULL;
    return job ? npg_job_poses_path(job, path, is_new) : NPG_OK;
}

static npg_status remove_new_poses(const npg_worker *worker)
{
    const npg_job *job = npg_job_of(worker);
    return job ? npg_job_remove_new_poses(job) : NPG_OK;
}

static npg_status restore_known(npg_pose_cache *h, const npg_worker *worker, const npg_tracker *tracker)
{
    char *path;
    size_t size, nodes = npg_tracker_node_count(tracker);
    const unsigned char *map =
        npg_archive_find(npg_job_archive(npg_job_of(worker)), NPG_BLOCK_ALIGN_MAP, &size);
    if (!map) return NPG_OK; /* the reference is the keyframe's own */
    NPG_TRY(npg_pose_map_unpack(&h->map, map, size));
    if (h->map.count != nodes)
        return npg_error(NPG_BAD_INPUT, "the state to resume from has poses for %zu nodes, not %zu",
                         h->map.count, nodes);
    NPG_TRY(poses_path(worker, &path, false));
    npg_status status = npg_poses_open(&h->known, path, h->map.old_count);
    npg_release(&path);
    return status;
}

/* Of a capture that the reference does not explain to its ends: poses were stretched to what is new. */
static npg_status drop_if_changed(const npg_worker *worker, between *b)
{
    const npg_facts *facts = npg_worker_facts(worker);
    if (!b || facts->growing_passes || !npg_facts_has_changed(facts)) return NPG_OK;
    npg_poses_close(&b->poses);
    npg_tracker_close(&b->tracker);
    return remove_new_poses(worker);
}

/* The poses of the pass before, or of the run that is resumed. */
static npg_status open_known(npg_pose_cache *h, npg_worker *worker, const npg_tracker *tracker)
{
    between *b = npg_worker_kept(worker);
    NPG_TRY(drop_if_changed(worker, b));
    if (b && b->poses) {
        NPG_TRY(npg_pose_map_open(&h->map, b->tracker, tracker));
        h->known = b->poses;
        b->poses = NULL;
        npg_tracker_close(&b->tracker);
        if (npg_worker_pass(worker) == NPG_PASS_SOLVE && npg_job_of(worker))
            NPG_TRY(npg_job_keep_poses(npg_job_of(worker)));
    } else if (npg_worker_facts(worker)->is_resumed) {
        NPG_TRY(restore_known(h, worker, tracker));
    }
    if (!h->known) return NPG_OK;
    return npg_alloc(&h->known_pose, NPG_FOR_FIT, npg_pose_bytes(npg_poses_nodes(h->known)));
}

npg_status npg_pose_cache_open(npg_pose_cache *cache, npg_worker *worker, const npg_tracker *tracker)
{
    char *path;
    NPG_TRY(open_known(cache, worker, tracker));
    if (npg_worker_pass(worker) != NPG_PASS_FUSE) return NPG_OK;
    NPG_TRY(remove_new_poses(worker)); /* `known` still reads what had the name before */
    NPG_TRY(poses_path(worker, &path, true));
    npg_status status = npg_poses_create(&cache->found, path, npg_tracker_node_count(tracker));
    npg_release(&path);
    return status;
}

npg_status npg_pose_cache_start(const npg_pose_cache *cache, const npg_tracker *tracker, int64_t index,
                                double *pose, bool *is_known)
{
    *is_known = false;
    if (!cache->known) return NPG_OK;
    NPG_TRY(npg_poses_get(cache->known, index, cache->known_pose, is_known));
    if (*is_known) npg_pose_map_apply(&cache->map, tracker, pose, cache->known_pose);
    return NPG_OK;
}

npg_status npg_pose_cache_put(npg_pose_cache *cache, int64_t index, const double *pose)
{
    return cache->found ? npg_poses_put(cache->found, index, pose) : NPG_OK;
}

npg_status npg_pose_cache_leave(npg_pose_cache *cache, npg_worker *worker, npg_tracker **tracker)
{
    between *b = npg_worker_kept(worker);
    if (!cache->found) return NPG_OK;
    NPG_TRY(npg_poses_sync(cache->found));
    if (!b) {
        NPG_TRY(npg_alloc(&b, NPG_FOR_FIT, sizeof *b));
        npg_worker_keep(worker, b, release_between);
    }
    b->tracker = *tracker;
    b->poses = cache->found;
    b->passes++;
    *tracker = NULL;
    cache->found = NULL;
    return NPG_OK;
}

npg_status npg_pose_cache_save(const npg_pose_cache *cache, npg_archive_writer *out)
{
    unsigned char *bytes;
    size_t size;
    if (!cache->known) return NPG_OK;
    NPG_TRY(npg_pose_map_pack(&cache->map, &bytes, &size));
    npg_status status = npg_archive_put(out, NPG_BLOCK_ALIGN_MAP, bytes, size);
    npg_release(&bytes);
    return status;
}
