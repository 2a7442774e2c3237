/* Reading of one frame for a page. */
#include "tools/view/view.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "kernels/kernels.h"
#include "outlier/outlier.h"
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

/* From where they lie: as the run named it, or by the same name in the input folder, whose path is absolute; of a rig
 * its sensors'. */
static npg_status read_source(npg_frame *cloud, npg_origin *origin, const npg_view_frames *frames,
                              const npg_view_frame *frame)
{
    const char *input = json_string_value(json_object_get(frames->part->job, "input")),
               *source = frame->source;
    const char *moves =
        json_string_value(json_object_get(npg_view_run_options(frames->part), "align-sensors"));
    char text[NPG_PATH_SIZE], *path;
    if (!source) return npg_error(NPG_BAD_INPUT, "its points came from no file");
    if (input && npg_rig_is(input)) {
        if (moves && strcmp(moves, "no"))
            return npg_error(NPG_BAD_INPUT, "the run has moved the rig's sensors (align-sensors)");
        snprintf(text, sizeof text, "%s#%lld", input, (long long)frame->number);
        return npg_rig_read_frame(cloud, text, origin);
    }
    const char *slash = strrchr(source, '/');
    NPG_TRY(access(source, R_OK) == 0 || !input ? npg_copy_text(&path, source)
                                                : npg_join_path(&path, input, slash ? slash + 1 : source));
    npg_status status = npg_read_cloud(cloud, path, origin);
    npg_release(&path);
    return status;
}

/* The capture's coordinates to those of the meshes; points that are not finite go. */
static void place_point(npg_view_frames *frames, size_t *count, const float *local,
                        const npg_origin *of_cloud)
{
    const npg_origin *origin = &frames->part->origin;
    float *out = frames->points + 3 * (frames->point_count + frames->dropped_count);
    double at[3];
    for (size_t a = 0; a < 3; a++) at[a] = of_cloud->world[a] + (double)local[a];
    npg_place_point(&frames->part->placement, at, at);
    for (size_t a = 0; a < 3; a++) out[a] = (float)(at[a] - origin->world[a]);
    *count += isfinite(out[0]) && isfinite(out[1]) && isfinite(out[2]);
}

/* Those that the run kept, then those it dropped. */
static npg_status place_points(npg_view_frames *frames, npg_frame *cloud, const npg_origin *of_cloud)
{
    const json_t *options = npg_view_run_options(frames->part);
    const char *drops = json_string_value(json_object_get(options, "outliers"));
    double ratio = drops && !strcmp(drops, "no") ? 0 : npg_view_number(options, "outlier-ratio", 5);
    double most = npg_view_number(options, "points-max", 0), faces = npg_view_number(options, "faces", 0);
    uint8_t *keep;
    npg_status status = npg_frame_clean(cloud, &keep, npg_clean_point_max(most, faces), ratio);
    if (!status)
        status = npg_arena_grow(&frames->arena, &frames->points, &frames->point_capacity, cloud->point_count,
                                3 * sizeof *frames->points);
    for (int is_kept = 1; is_kept >= 0 && !status; is_kept--)
        for (size_t i = 0; i < cloud->point_count; i++)
            if (keep[i] == is_kept)
                place_point(frames, is_kept ? &frames->point_count : &frames->dropped_count,
                            cloud->pos_local + 3 * i, of_cloud);
    npg_release(&keep);
    return status;
}

npg_status npg_view_read_points(npg_view_frames *frames, const npg_view_frame *frame)
{
    npg_frame cloud = {0};
    npg_origin origin = {0};
    frames->point_count = frames->dropped_count = 0;
    npg_status status = read_source(&cloud, &origin, frames, frame);
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

typedef struct measuring {
    npg_arena arena;
    const npg_mesh *mesh;  /* as it lies in the frame       */
    float *normals;        /* V x 3                         */
    float *dist_sq;        /* V: to the nearest point       */
    double *sum, *weights; /* V: of distances spread so far */
} measuring;

/* A point's distance, to the corners of the face it fell to. */
static void spread_hit(measuring *m, const npg_surface_hit *hit, const float p[3])
{
    double foot[3] = {0}, normal[3] = {0}, side = 0;
    if (hit->face == UINT32_MAX) return;
    const uint32_t *corners = m->mesh->faces + 3 * (size_t)hit->face;
    for (size_t i = 0; i < 9; i++) {
        double w = (double)hit->weights[i / 3];
        foot[i % 3] += w * (double)m->mesh->vert_pos[3 * (size_t)corners[i / 3] + i % 3];
        normal[i % 3] += w * (double)m->normals[3 * (size_t)corners[i / 3] + i % 3];
    }
    for (size_t a = 0; a < 3; a++) side += ((double)p[a] - foot[a]) * normal[a];
    double dist = copysign(sqrt((double)hit->dist_sq), side);
    for (size_t k = 0; k < 3; k++) {
        m->sum[corners[k]] += (double)hit->weights[k] * dist;
        m->weights[corners[k]] += (double)hit->weights[k];
    }
}

/* What a vertex has got, to its neighbours as well: less of the noise.  more: room for 2 V. */
static void share_with_ring(measuring *m, double *more)
{
    for (size_t i = 0; i < 3 * m->mesh->face_count; i++)
        for (size_t k = i - i % 3; k < i - i % 3 + 3; k++) {
            more[2 * (size_t)m->mesh->faces[i]] += m->sum[m->mesh->faces[k]];
            more[2 * (size_t)m->mesh->faces[i] + 1] += m->weights[m->mesh->faces[k]];
        }
    for (size_t i = 0; i < m->mesh->vert_count; i++) {
        m->sum[i] = more[2 * i];
        m->weights[i] = more[2 * i + 1];
    }
}

/* One ring of vertices that none fell to, from their neighbours; returns how many got something.  more: room
 * for 2 V. */
static size_t fill_ring(measuring *m, double *more, double cover)
{
    size_t filled = 0, v = m->mesh->vert_count;
    memset(more, 0, 2 * v * sizeof *more);
    for (size_t i = 0; i < 3 * m->mesh->face_count; i++) {
        size_t at = m->mesh->faces[i];
        if (m->weights[at] > 0) continue;
        for (size_t k = i - i % 3; k < i - i % 3 + 3; k++) {
            size_t other = m->mesh->faces[k];
            if (!(m->weights[other] > 0)) continue;
            more[2 * at] += m->sum[other] / m->weights[other];
            more[2 * at + 1] += 1;
        }
    }
    for (size_t i = 0; i < v; i++) {
        double mean = more[2 * i + 1] > 0 ? more[2 * i] / more[2 * i + 1] : 0;
        if (!(more[2 * i + 1] > 0) || sqrt((double)m->dist_sq[i]) > cover + fabs(mean)) continue;
        m->sum[i] = mean;
        m->weights[i] = 1;
        filled++;
    }
    return filled;
}

static void write_errors(npg_view_frames *frames, int32_t *errors, const measuring *m)
{
    const npg_view_part *part = frames->part;
    double most = NPG_VIEW_ERROR_MAX * part->diagonal, cover = part->cover_share * part->diagonal;
    for (size_t i = 0; i < m->mesh->vert_count; i++) {
        int is_near = sqrt((double)m->dist_sq[i]) <= cover;
        double share = m->weights[i] > 0 ? m->sum[i] / m->weights[i] / most : 0;
        int32_t code = (int32_t)lrint(copysign(127 * sqrt(fmin(fabs(share), 1)), share));
        errors[i] = 2 * (m->weights[i] > 0 ? 128 + code : 0) + is_near;
        frames->seen[i] += is_near;
    }
}

static npg_status measure_in(measuring *m, npg_view_frames *frames)
{
    size_t v = m->mesh->vert_count, n = frames->point_count;
    double cover = frames->part->cover_share * frames->part->diagonal;
    uint32_t *index = npg_arena_take(&m->arena, v, sizeof *index);
    npg_surface_hit *hits = npg_arena_take(&m->arena, n, sizeof *hits);
    double *more = npg_arena_take(&m->arena, 2 * v, sizeof *more);
    m->dist_sq = npg_arena_take(&m->arena, v, sizeof *m->dist_sq);
    m->normals = npg_arena_take(&m->arena, v, 3 * sizeof *m->normals);
    m->sum = npg_arena_take(&m->arena, v, sizeof *m->sum);
    m->weights = npg_arena_take(&m->arena, v, sizeof *m->weights);
    NPG_TRY(npg_arena_status(&m->arena));
    NPG_TRY(npg_points_nearest(index, m->dist_sq, frames->points, n, m->mesh->vert_pos, v, 1));
    NPG_TRY(npg_mesh_closest(hits, m->mesh, frames->points, n));
    npg_mesh_vertex_normals(m->normals, m->mesh->vert_pos, v, m->mesh->faces, m->mesh->face_count);
    for (size_t i = 0; i < n; i++) spread_hit(m, &hits[i], frames->points + 3 * i);
    share_with_ring(m, more);
    while (fill_ring(m, more, cover)) continue;
    return NPG_OK;
}

npg_status npg_view_measure(npg_view_frames *frames, int32_t *errors)
{
    npg_mesh mesh = *frames->part->reference;
    measuring m = {.arena = {.purpose = NPG_FOR_QUERY}, .mesh = &mesh};
    memset(errors, 0, mesh.vert_count * sizeof *errors);
    if (!frames->point_count) return NPG_OK;
    mesh.vert_pos = frames->vert_pos;
    double noise;
    npg_status status = npg_cloud_noise(&noise, frames->points, NULL, frames->point_count);
    if (!status) frames->noise_sum += noise;
    if (!status) frames->noise_count++;
    if (!status) status = measure_in(&m, frames);
    if (!status) write_errors(frames, errors, &m);
    npg_arena_release(&m.arena);
    return status;
}

/* ---- the points that are shown ---- */

static npg_status add_some(npg_view_frames *frames, size_t at, size_t *count, const float *points, size_t n)
{
    npg_arena scratch = {.purpose = NPG_FOR_FRAMES};
    *count = n < frames->point_limit ? n : frames->point_limit;
    if (!*count) return NPG_OK;
    NPG_TRY(npg_arena_grow(&frames->arena, &frames->some, &frames->some_capacity, at + *count,
                           3 * sizeof *frames->some));
    float *spread = npg_arena_take(&scratch, *count, 3 * sizeof *spread);
    uint32_t *order = npg_arena_take(&scratch, *count, sizeof *order);
    npg_status status = npg_arena_status(&scratch);
    if (!status) *count = npg_points_spread(spread, NULL, *count, points, NULL, n);
    if (!status) status = npg_morton_order(order, spread, *count);
    for (size_t i = 0; i < *count && !status; i++)
        memcpy(frames->some + 3 * (at + i), spread + 3 * (size_t)order[i], 3 * sizeof *spread);
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_view_choose_points(npg_view_frames *frames, size_t *count, size_t *dropped)
{
    const float *gone = frames->point_count ? frames->points + 3 * frames->point_count : frames->points;
    NPG_TRY(add_some(frames, 0, count, frames->points, frames->point_count));
    NPG_TRY(add_some(frames, *count, dropped, gone, frames->dropped_count));
    *count += *dropped;
    return NPG_OK;
}
