/* Follower: the tracker along a row of frames. */
#include "track/track.h"

#include <string.h>

npg_status npg_follower_open(npg_follower *f, npg_mesh *mesh, const npg_tracker_settings *settings)
{
    *f = (npg_follower){.arena = {.purpose = NPG_FOR_FIT}};
    NPG_TRY(npg_tracker_open(&f->tracker, mesh, settings));
    size_t bytes = npg_pose_bytes(npg_tracker_node_count(f->tracker));
    f->pose = npg_arena_take(&f->arena, 1, bytes);
    f->before = npg_arena_take(&f->arena, 1, bytes);
    f->next = npg_arena_take(&f->arena, 1, bytes);
    NPG_TRY(npg_arena_status(&f->arena));
    npg_follower_rest(f);
    return NPG_OK;
}

void npg_follower_close(npg_follower *f)
{
    npg_tracker_close(&f->tracker);
    npg_arena_release(&f->arena);
}

void npg_follower_rest(npg_follower *f)
{
    npg_pose_rest(f->pose, npg_tracker_node_count(f->tracker));
    npg_pose_rest(f->before, npg_tracker_node_count(f->tracker));
}

npg_status npg_follower_start(npg_follower *f, const float *placed)
{
    NPG_TRY(npg_pose_of(f->pose, npg_tracker_graph(f->tracker), npg_tracker_reference(f->tracker)->vert_pos,
                        placed));
    memcpy(f->before, f->pose, npg_pose_bytes(npg_tracker_node_count(f->tracker)));
    return NPG_OK;
}

npg_status npg_follower_go(npg_follower *f, const npg_tracker_cloud *cloud)
{
    npg_tracked tracked;
    double *oldest = f->before;
    npg_pose_extrapolate(f->next, f->pose, f->before, npg_tracker_node_count(f->tracker));
    f->before = f->pose;
    f->pose = f->next;
    f->next = oldest;
    return npg_tracker_fit(f->tracker, &tracked, f->pose, cloud, NULL, NULL);
}

void npg_follower_vertices(const npg_follower *f, float *vert_unit)
{
    npg_tracker_vertices(f->tracker, vert_unit, f->pose);
}
