/* Candidate clouds: thinned frames, and following a surface through them. */
#include "track/track.h"

#include <string.h>
#include <xxhash.h>

#define HELD_OUT     5   /* one point of so many */
#define FLIPPED_MOST 0.1 /* of given normals: beyond, those of other frames are not used */

/* ---- the list ---- */

/* Whether a point takes no part in what is fitted, so that it can tell how good the fit is. */
static bool is_held_out(const float point[3])
{
    return XXH3_64bits(point, 3 * sizeof *point) % HELD_OUT == 0;
}

static void copy_row(float *to, size_t *count, const float *from, size_t i)
{
    memcpy(to + 3 * (*count)++, from + 3 * i, 3 * sizeof *to);
}

static npg_status hold_out(npg_candidate_cloud *cloud, npg_arena *arena)
{
    size_t normals = 0;
    for (size_t i = 0; i < cloud->point_count; i++) cloud->held_count += is_held_out(cloud->points + 3 * i);
    size_t held = cloud->held_count, fit = cloud->point_count - held;
    cloud->fit = npg_arena_take(arena, fit, 3 * sizeof(float));
    cloud->held = npg_arena_take(arena, held, 3 * sizeof(float));
    if (cloud->normals) cloud->fit_normals = npg_arena_take(arena, fit, 3 * sizeof(float));
    NPG_TRY(npg_arena_status(arena));
    cloud->held_count = 0;
    for (size_t i = 0; i < cloud->point_count; i++) {
        if (is_held_out(cloud->points + 3 * i)) {
            copy_row(cloud->held, &cloud->held_count, cloud->points, i);
            continue;
        }
        copy_row(cloud->fit, &cloud->fit_count, cloud->points, i);
        if (cloud->normals) copy_row(cloud->fit_normals, &normals, cloud->normals, i);
    }
    return NPG_OK;
}

static npg_status copy_points(npg_candidate_cloud *cloud, npg_arena *arena, const npg_frame *frame,
                              const npg_frame_box *box)
{
    size_t count = frame->point_count < NPG_CANDIDATE_POINTS ? frame->point_count : NPG_CANDIDATE_POINTS;
    cloud->points = npg_arena_take(arena, count, 3 * sizeof(float));
    if (frame->normals) cloud->normals = npg_arena_take(arena, count, 3 * sizeof(float));
    if (frame->sensor_count) cloud->sensors = npg_arena_take(arena, frame->sensor_count, 3 * sizeof(float));
    NPG_TRY(npg_arena_status(arena));
    npg_points_spread(cloud->points, cloud->normals, count, frame->pos_local, frame->normals,
                      frame->point_count);
    npg_box_local_to_unit(box, cloud->points, cloud->points, count);
    cloud->point_count = count;
    cloud->sensor_count = frame->sensor_count;
    if (frame->sensor_count)
        npg_box_local_to_unit(box, cloud->sensors, frame->sensor_local, frame->sensor_count);
    return hold_out(cloud, arena);
}

npg_status npg_candidate_clouds_add(npg_candidate_clouds *clouds, const npg_frame *frame,
                                    const npg_frame_box *box, bool is_candidate)
{
    if (frame->is_skipped || !frame->point_count) return NPG_OK;
    NPG_TRY(
        npg_grow(&clouds->list, &clouds->capacity, clouds->count + 1, sizeof *clouds->list, NPG_FOR_FRAMES));
    npg_candidate_cloud *cloud = &clouds->list[clouds->count++];
    *cloud =
        (npg_candidate_cloud){.index = frame->index, .number = frame->number, .is_candidate = is_candidate};
    if (is_candidate) {
        clouds->given += frame->cleaning.normals_given;
        clouds->flipped += frame->cleaning.normals_flipped;
    }
    NPG_TRY(npg_free_space_open(&cloud->space, frame, box));
    return copy_points(cloud, &clouds->arena, frame, box);
}

static void release_clouds(void *value)
{
    npg_candidate_clouds *clouds = value;
    npg_candidate_clouds_close(&clouds);
}

const npg_fact_kind npg_fact_candidate_clouds = {"candidate_clouds", "keyframe", release_clouds};

npg_status npg_candidate_clouds_open(npg_candidate_clouds **clouds)
{
    NPG_TRY(npg_alloc(clouds, NPG_FOR_RUN, sizeof **clouds));
    (*clouds)->arena.purpose = NPG_FOR_FRAMES;
    return NPG_OK;
}

void npg_candidate_clouds_close(npg_candidate_clouds **slot)
{
    npg_candidate_clouds *clouds = *slot;
    if (!clouds) return;
    for (size_t i = 0; i < clouds->count; i++) npg_free_space_close(&clouds->list[i].space);
    npg_arena_release(&clouds->arena);
    npg_release(&clouds->list);
    npg_release(slot);
}

size_t npg_candidate_clouds_find(const npg_candidate_clouds *clouds, int64_t index)
{
    size_t at = 0;
    while (at < clouds->count && clouds->list[at].index != index) at++;
    return at;
}

/* ---- following ---- */

npg_status npg_candidate_follow(const npg_candidate_clouds *clouds, size_t from, npg_mesh *mesh,
                                const npg_tracker_settings *settings, npg_candidate_seen seen, void *user)
{
    npg_follower follower;
    float *vert_unit = NULL;
    bool with_normals = clouds->given && (double)clouds->flipped <= FLIPPED_MOST * (double)clouds->given;
    npg_status status = npg_follower_open(&follower, mesh, settings);
    if (!status) status = npg_alloc_array(&vert_unit, NPG_FOR_FIT, mesh->vert_count, 3 * sizeof *vert_unit);
    for (int step = -1; step <= 1 && !status; step += 2) {
        npg_follower_rest(&follower);
        for (size_t i = from + (size_t)step; i < clouds->count && !status; i += (size_t)step) {
            const npg_candidate_cloud *next = &clouds->list[i];
            const npg_tracker_cloud cloud = {.points = next->fit,
                                             .normals = with_normals ? next->fit_normals : NULL,
                                             .count = next->fit_count,
                                             .sensors = next->sensors,
                                             .sensor_count = next->sensor_count,
                                             .space = next->space};
            status = npg_follower_go(&follower, &cloud);
            if (!status) npg_follower_vertices(&follower, vert_unit);
            if (!status) status = seen(user, next, vert_unit);
        }
    }
    npg_release(&vert_unit);
    npg_follower_close(&follower);
    return status;
}
