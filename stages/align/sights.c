/* Sights: thinned frames, and following a surface through them. */
#include "align/sights.h"

#include <math.h>
#include <string.h>

#include "align/pose.h"
#include "geometry/mesh_tools.h"

#define FLIPPED_MOST                                                                                         \
    0.1 /* share of given normals on the wrong side, beyond which those of other frames are not used */

/* ---- the list ---- */

static npg_status copy_points(npg_sight *sight, const npg_frame *frame, const npg_frame_box *box)
{
    size_t count = frame->point_count < NPG_SIGHT_POINTS ? frame->point_count : NPG_SIGHT_POINTS;
    NPG_TRY(npg_alloc_array(&sight->points, NPG_FOR_FRAMES, count, 3 * sizeof(float)));
    if (frame->normals) NPG_TRY(npg_alloc_array(&sight->normals, NPG_FOR_FRAMES, count, 3 * sizeof(float)));
    npg_points_spread(sight->points, sight->normals, count, frame->pos_local, frame->normals,
                      frame->point_count);
    npg_box_local_to_unit(box, sight->points, sight->points, count);
    sight->point_count = count;
    return NPG_OK;
}

npg_status npg_sights_add(npg_sights *sights, const npg_frame *frame, const npg_frame_box *box,
                          bool is_candidate)
{
    if (frame->is_skipped || !frame->point_count) return NPG_OK;
    NPG_TRY(
        npg_grow(&sights->list, &sights->capacity, sights->count + 1, sizeof *sights->list, NPG_FOR_FRAMES));
    npg_sight *sight = &sights->list[sights->count++];
    *sight = (npg_sight){.index = frame->index, .number = frame->number, .is_candidate = is_candidate};
    if (is_candidate) {
        sights->given += frame->cleaning.normals_given;
        sights->flipped += frame->cleaning.normals_flipped;
    }
    return copy_points(sight, frame, box);
}

static void release_sights(void *value)
{
    npg_sights *sights = value;
    npg_sights_close(&sights);
}

const npg_fact_kind npg_fact_sights = {"sights", "keyframe", release_sights};

npg_status npg_sights_open(npg_sights **sights)
{
    return npg_alloc(sights, NPG_FOR_RUN, sizeof **sights);
}

void npg_sights_close(npg_sights **slot)
{
    npg_sights *sights = *slot;
    if (!sights) return;
    for (size_t i = 0; i < sights->count; i++) {
        npg_release(&sights->list[i].points);
        npg_release(&sights->list[i].normals);
    }
    npg_release(&sights->list);
    npg_release(slot);
}

size_t npg_sights_find(const npg_sights *sights, int64_t index)
{
    size_t at = 0;
    while (at < sights->count && sights->list[at].index != index) at++;
    return at;
}

/* ---- following ---- */

typedef struct follower {
    const npg_sights *sights;
    npg_tracker *tracker;
    size_t node_count;
    double *pose, *before, *next; /* K x 12 each, owned */
    float *vert_unit;             /* V x 3, owned       */
    bool with_normals;
    npg_sight_seen seen;
    void *user;
} follower;

static void close_follower(follower *f)
{
    npg_tracker_close(&f->tracker);
    npg_release(&f->pose);
    npg_release(&f->before);
    npg_release(&f->next);
    npg_release(&f->vert_unit);
}

static npg_status open_follower(follower *f, npg_mesh *mesh, const npg_tracker_settings *settings)
{
    NPG_TRY(npg_tracker_open(&f->tracker, mesh, settings));
    f->node_count = npg_tracker_node_count(f->tracker);
    size_t size = NPG_POSE_SIZE * sizeof(double);
    NPG_TRY(npg_alloc_array(&f->pose, NPG_FOR_FIT, f->node_count, size));
    NPG_TRY(npg_alloc_array(&f->before, NPG_FOR_FIT, f->node_count, size));
    NPG_TRY(npg_alloc_array(&f->next, NPG_FOR_FIT, f->node_count, size));
    return npg_alloc_array(&f->vert_unit, NPG_FOR_FIT, mesh->vert_count, 3 * sizeof(float));
}

static npg_status follow_to(follower *f, const npg_sight *sight)
{
    npg_tracked tracked;
    npg_pose_extrapolate(f->next, f->pose, f->before, f->node_count);
    double *oldest = f->before;
    f->before = f->pose;
    f->pose = f->next;
    f->next = oldest;
    const npg_tracker_cloud cloud = {.points = sight->points,
                                     .normals = f->with_normals ? sight->normals : NULL,
                                     .count = sight->point_count};
    NPG_TRY(npg_tracker_fit(f->tracker, &tracked, f->pose, &cloud, NULL, NULL));
    npg_tracker_vertices(f->tracker, f->vert_unit, f->pose);
    return f->seen(f->user, sight, f->vert_unit, &tracked);
}

npg_status npg_sights_follow(const npg_sights *sights, size_t from, npg_mesh *mesh,
                             const npg_tracker_settings *settings, npg_sight_seen seen, void *user)
{
    follower f = {.sights = sights, .seen = seen, .user = user};
    f.with_normals = sights->given && (double)sights->flipped <= FLIPPED_MOST * (double)sights->given;
    npg_status status = open_follower(&f, mesh, settings);
    for (int step = -1; step <= 1 && !status; step += 2) {
        npg_pose_rest(f.pose, f.node_count);
        npg_pose_rest(f.before, f.node_count);
        for (size_t i = from + (size_t)step; i < sights->count && !status; i += (size_t)step)
            status = follow_to(&f, &sights->list[i]);
    }
    close_follower(&f);
    return status;
}
