/* Reading of one frame for a page. */
#include "tools/view/view.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "kernels/kernels.h"
#include "pipeline/file.h"

/* ---- the mesh ---- */

npg_status npg_view_read_mesh(npg_view_frames *frames, const npg_view_frame *frame)
{
    npg_origin origin = frames->part->origin;
    size_t v = frames->part->reference->vert_count;
    npg_mesh *mesh = NULL;
    char path[NPG_PATH_SIZE];
    if (!frame->file) return NPG_OK;
    if (!npg_path_stays(frame->file))
        return npg_error(NPG_BAD_INPUT, "%s: its list of frames names %s, which is not in it",
                         frames->part->folder, frame->file);
    NPG_TRY(npg_path_of(path, frames->part->folder, frame->file));
    npg_status status = npg_read_mesh(&mesh, path, &origin);
    if (!status && mesh->vert_count != v)
        status =
            npg_error(NPG_BAD_INPUT, "%s has %zu vertices, its reference.ply %zu", path, mesh->vert_count, v);
    if (!status) status = npg_mesh_require_finite(mesh, path);
    if (!status) memcpy(frames->vert_pos, mesh->vert_pos, 3 * v * sizeof *frames->vert_pos);
    npg_mesh_unref(&mesh);
    return status;
}

/* ---- the points ---- */

/* Where the points lie: as the run named them, or by the same name in the input folder, whose path is
 * absolute. */
static npg_status find_source(char **path, const npg_view_frames *frames, const char *source)
{
    const char *input = json_string_value(json_object_get(frames->part->job, "input"));
    const char *slash = strrchr(source, '/');
    if (access(source, R_OK) == 0 || !input) return npg_copy_text(path, source);
    return npg_join_path(path, input, slash ? slash + 1 : source);
}

/* The capture's coordinates to those of the meshes; points that are not finite go. */
static npg_status place_points(npg_view_frames *frames, const npg_frame *cloud, const npg_origin *of_cloud)
{
    const npg_origin *origin = &frames->part->origin;
    NPG_TRY(npg_arena_grow(&frames->arena, &frames->points, &frames->point_capacity, cloud->point_count,
                           3 * sizeof *frames->points));
    for (size_t i = 0; i < cloud->point_count; i++) {
        float *out = frames->points + 3 * frames->point_count;
        double at[3];
        for (size_t a = 0; a < 3; a++) at[a] = of_cloud->world[a] + (double)cloud->pos_local[3 * i + a];
        npg_place_point(&frames->part->placement, at, at);
        for (size_t a = 0; a < 3; a++) out[a] = (float)(at[a] - origin->world[a]);
        frames->point_count += isfinite(out[0]) && isfinite(out[1]) && isfinite(out[2]);
    }
    return NPG_OK;
}

npg_status npg_view_read_points(npg_view_frames *frames, const npg_view_frame *frame)
{
    npg_frame cloud = {0};
    npg_origin origin = {0};
    char *path = NULL;
    frames->point_count = 0;
    npg_status status = frame->source ? find_source(&path, frames, frame->source)
                                      : npg_error(NPG_BAD_INPUT, "its points came from no file");
    if (!status) status = npg_read_cloud(&cloud, path, &origin);
    npg_release(&path);
    if (!status) status = place_points(frames, &cloud, &origin);
    npg_frame_clear(&cloud);
    frames->with_points += frames->point_count > 0;
    if (frames->point_count || status == NPG_MEMORY) return status;
    if (!frames->without_points++)
        snprintf(frames->why, sizeof frames->why, "frame %lld: %s", (long long)frame->number,
                 status ? npg_error_text() : "the file has no points");
    return NPG_OK;
}

/* ---- how far they are from each other ---- */

static void judge_vertices(npg_view_frames *frames, int32_t *errors, const float *dist_sq)
{
    const npg_view_part *part = frames->part;
    double most = NPG_VIEW_ERROR_MAX * part->diagonal, cover = part->cover_share * part->diagonal;
    for (size_t i = 0; i < part->reference->vert_count; i++) {
        double dist = sqrt((double)dist_sq[i]), share = dist / most;
        errors[i] = share < 1 ? (int32_t)lrint(255 * sqrt(share)) : 255;
        frames->seen[i] += dist <= cover;
    }
}

npg_status npg_view_measure(npg_view_frames *frames, int32_t *errors)
{
    size_t v = frames->part->reference->vert_count;
    npg_arena scratch = {.purpose = NPG_FOR_QUERY};
    npg_kdtree *tree = NULL;
    memset(errors, 0, v * sizeof *errors);
    if (!frames->point_count) return NPG_OK;
    uint32_t *index = npg_arena_take(&scratch, v, sizeof *index);
    float *dist_sq = npg_arena_take(&scratch, v, sizeof *dist_sq);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_kdtree_open(&tree, frames->points, frames->point_count);
    if (!status) status = npg_kdtree_nearest(tree, index, dist_sq, frames->vert_pos, v, 1, 0);
    if (!status) judge_vertices(frames, errors, dist_sq);
    npg_kdtree_close(&tree);
    npg_arena_release(&scratch);
    return status;
}

/* ---- the points that are shown ---- */

npg_status npg_view_choose_points(npg_view_frames *frames, size_t *count)
{
    npg_arena scratch = {.purpose = NPG_FOR_FRAMES};
    size_t limit = frames->point_limit;
    *count = frames->point_count < limit ? frames->point_count : limit;
    if (!*count) return NPG_OK;
    NPG_TRY(npg_arena_grow(&frames->arena, &frames->some, &frames->some_capacity, *count,
                           3 * sizeof *frames->some));
    float *spread = npg_arena_take(&scratch, *count, 3 * sizeof *spread);
    uint32_t *order = npg_arena_take(&scratch, *count, sizeof *order);
    npg_status status = npg_arena_status(&scratch);
    if (!status) *count = npg_points_spread(spread, NULL, *count, frames->points, NULL, frames->point_count);
    if (!status) status = npg_morton_order(order, spread, *count);
    for (size_t i = 0; i < *count && !status; i++)
        memcpy(frames->some + 3 * i, spread + 3 * (size_t)order[i], 3 * sizeof *spread);
    npg_arena_release(&scratch);
    return status;
}
