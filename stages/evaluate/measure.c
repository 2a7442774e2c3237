/* Measure: see measure.h.  Flipped and stretched faces are counted on the whole reference, distances measured
 * to a surface of at most about NPG_PROXY_SURFACE of its vertices. */

#include <math.h>
#include <stdlib.h>

#include "evaluate/evaluate_internal.h"
#include "geometry/geometry.h"
#include "pipeline/memory.h"
#include "pipeline/order.h"
#include "track/track.h"

/* ---- the shape against that of the reference ---- */

/* A face is against its neighbourhood below the cosine NPG_AGAINST and with it above minus that; between, as
 * across a crease, it counts as neither. */
#define STRETCH 10.0 /* times the area, or a tenth of it: the measure of bad faces in neupig eval */

struct npg_shape {
    npg_arena arena;
    const npg_mesh *reference; /* loan */
    uint32_t (*edges)[2];      /* E x 2; owned */
    size_t edge_count;
    double *areas;     /* F, of the reference                                     */
    double *cosines;   /* F, each face against its neighbourhood in the reference */
    double *normals;   /* F x 3 scratch                                           */
    double *vert_sums; /* V x 3 scratch                                           */
};

/* Sums of the faces' normals around each vertex, weighted by reference area. */
static void sum_normals(const npg_shape *shape)
{
    const npg_mesh *mesh = shape->reference;
    for (size_t i = 0; i < 3 * mesh->vert_count; i++) shape->vert_sums[i] = 0;
    for (size_t f = 0; f < mesh->face_count; f++)
        for (size_t k = 0; k < 3; k++)
            for (size_t a = 0; a < 3; a++)
                shape->vert_sums[3 * (size_t)mesh->faces[3 * f + k] + a] +=
                    shape->areas[f] * shape->normals[3 * f + a];
}

/* Cosine between a face's normal and the mean normal of the faces that share a vertex with it; 1 for a face
 * that stands alone, 0 where one of the two has no direction. */
static double cosine_of(const npg_shape *shape, size_t f)
{
    const uint32_t *face = shape->reference->faces + 3 * f;
    const double *normal = shape->normals + 3 * f;
    double sum[3];
    for (int a = 0; a < 3; a++) {
        sum[a] = -3 * shape->areas[f] * normal[a]; /* the face itself is in the sum of each of its corners */
        for (int k = 0; k < 3; k++) sum[a] += shape->vert_sums[3 * (size_t)face[k] + (size_t)a];
    }
    double length = npg_vec3_length(sum);
    return length > 1e-9 * shape->areas[f] ? npg_vec3_dot(sum, normal) / length : 0;
}

static npg_status open_shape(npg_shape *shape)
{
    const npg_mesh *mesh = shape->reference;
    size_t v = mesh->vert_count, f = mesh->face_count;
    shape->areas = npg_arena_take(&shape->arena, f, sizeof *shape->areas);
    shape->cosines = npg_arena_take(&shape->arena, f, sizeof *shape->cosines);
    shape->normals = npg_arena_take(&shape->arena, f, 3 * sizeof *shape->normals);
    shape->vert_sums = npg_arena_take(&shape->arena, v, 3 * sizeof *shape->vert_sums);
    NPG_TRY(npg_arena_status(&shape->arena));
    NPG_TRY(npg_mesh_edges(&shape->edges, &shape->edge_count, mesh->faces, f));
    for (size_t i = 0; i < f; i++)
        shape->areas[i] = npg_face_normal(shape->normals + 3 * i, mesh->vert_pos, mesh->faces + 3 * i);
    sum_normals(shape);
    for (size_t i = 0; i < f; i++) shape->cosines[i] = cosine_of(shape, i);
    return NPG_OK;
}

npg_status npg_shape_open(npg_shape **out, const npg_mesh *reference)
{
    NPG_TRY(npg_object_open(out, NPG_FOR_MESH, sizeof **out));
    (*out)->reference = reference;
    npg_status status = open_shape(*out);
    if (status) npg_shape_close(out);
    return status;
}

void npg_shape_close(npg_shape **slot)
{
    if (!*slot) return;
    npg_release(&(*slot)->edges);
    npg_object_close(slot);
}

double npg_edge_change(const float *rest, const float *now, uint32_t (*edges)[2], size_t edge_count)
{
    double sum = 0;
    size_t count = 0;
    for (size_t e = 0; e < edge_count; e++) {
        double before = npg_edge_length(rest, edges[e]);
        if (!(before > 0)) continue;
        sum += fabs(npg_edge_length(now, edges[e]) / before - 1);
        count++;
    }
    return count ? sum / (double)count : 0;
}

void npg_shape_measure(const npg_shape *shape, npg_figures *figures, const float *vert_unit)
{
    const npg_mesh *mesh = shape->reference;
    double all = 0, flipped = 0, stretched = 0;
    for (size_t f = 0; f < mesh->face_count; f++) {
        double before = shape->areas[f];
        double area = npg_face_normal(shape->normals + 3 * f, vert_unit, mesh->faces + 3 * f);
        all += before;
        if (area > STRETCH * before || STRETCH * area < before) stretched += before;
    }
    sum_normals(shape);
    for (size_t f = 0; f < mesh->face_count; f++)
        if (shape->cosines[f] > -NPG_AGAINST && cosine_of(shape, f) < NPG_AGAINST) flipped += shape->areas[f];
    figures->flipped_share = all > 0 ? flipped / all : 0;
    figures->stretched_share = all > 0 ? stretched / all : 0;
    figures->edge_change = npg_edge_change(mesh->vert_pos, vert_unit, shape->edges, shape->edge_count);
}

/* ---- the figures' room ---- */

struct npg_measure {
    npg_arena arena; /* of the arrays from `visible` on */
    npg_measure_settings settings;
    npg_proxy *proxy;     /* W vertices of the reference: the surface that distances are to */
    npg_surface *surface; /* moves from frame to frame */
    npg_shape *shape;
    npg_misfit_finder *finder;
    float *points, *dists; /* N x 3 and max(N, W), of the frame at hand, in units; owned */
    npg_surface_hit *hits; /* N; owned */
    size_t points_capacity, dists_capacity, hits_capacity;
    npg_visible visible;  /* of the sensors' rays: W */
    float *vert_unit;     /* W x 3               */
    uint32_t *nearest;    /* W                   */
    double *vert_areas;   /* W                   */
    uint8_t *unsupported; /* W                   */
    float *normals;       /* W x 3, in the frame */
    uint8_t *is_in_sight; /* W                   */
    size_t marks[NPG_MARKS];
};

/* Vertices far from each other, and the first one from the middle: where limbs end. */
static void choose_marks(npg_measure *m, const npg_mesh *mesh)
{
    double middle[3] = {0}, *dist_sq = m->vert_areas; /* not in use yet */
    size_t v = mesh->vert_count;
    for (size_t i = 0; i < 3 * v; i++) middle[i % 3] += (double)mesh->vert_pos[i] / (double)v;
    for (size_t i = 0; i < v; i++) dist_sq[i] = INFINITY;
    for (size_t k = 0; k < NPG_MARKS; k++) {
        const float *last = k ? mesh->vert_pos + 3 * m->marks[k - 1] : NULL;
        m->marks[k] = 0;
        for (size_t i = 0; i < v; i++) {
            const float *p = mesh->vert_pos + 3 * i;
            const double d[3] = {(double)p[0] - (last ? (double)last[0] : middle[0]),
                                 (double)p[1] - (last ? (double)last[1] : middle[1]),
                                 (double)p[2] - (last ? (double)last[2] : middle[2])};
            double near_sq = npg_vec3_dot(d, d);
            dist_sq[i] = k > 1 ? fmin(dist_sq[i], near_sq) : near_sq;
            if (dist_sq[i] > dist_sq[m->marks[k]]) m->marks[k] = i;
        }
    }
}

static npg_status fill(npg_measure *m, const npg_mesh *reference, double unseen_share)
{
    NPG_TRY(npg_shape_open(&m->shape, reference));
    NPG_TRY(npg_proxy_open(&m->proxy, reference, NPG_PROXY_SURFACE));
    npg_mesh *mesh = m->proxy->mesh;
    size_t w = mesh->vert_count;
    NPG_TRY(npg_misfit_open(&m->finder, mesh, unseen_share));
    npg_visible_open(&m->visible, &m->arena, w);
    m->vert_unit = npg_arena_take(&m->arena, w, 3 * sizeof *m->vert_unit);
    m->nearest = npg_arena_take(&m->arena, w, sizeof *m->nearest);
    m->vert_areas = npg_arena_take(&m->arena, w, sizeof *m->vert_areas);
    m->unsupported = npg_arena_take(&m->arena, w, 1);
    m->normals = npg_arena_take(&m->arena, w, 3 * sizeof *m->normals);
    m->is_in_sight = npg_arena_take(&m->arena, w, 1);
    NPG_TRY(npg_arena_status(&m->arena));
    choose_marks(m, mesh);
    return npg_surface_open(&m->surface, mesh->vert_pos, w, mesh->faces, mesh->face_count);
}

npg_status npg_measure_open(npg_measure **measure, const npg_mesh *reference, double unseen_share,
                            const npg_measure_settings *settings)
{
    NPG_TRY(npg_object_open(measure, NPG_FOR_QUERY, sizeof **measure));
    (*measure)->settings = *settings;
    npg_status status = fill(*measure, reference, unseen_share);
    if (status) npg_measure_close(measure);
    return status;
}

void npg_measure_close(npg_measure **measure)
{
    npg_measure *m = *measure;
    if (!m) return;
    npg_surface_close(&m->surface);
    npg_proxy_close(&m->proxy);
    npg_shape_close(&m->shape);
    npg_misfit_close(&m->finder);
    npg_release(&m->points);
    npg_release(&m->dists);
    npg_release(&m->hits);
    npg_object_close(measure);
}

size_t npg_measure_memory(const npg_measure_settings *settings, size_t point_count, size_t vert_count)
{
    size_t limit = (size_t)settings->point_limit;
    if (limit && point_count > limit) point_count = limit;
    return point_count * (3 * sizeof(float) + sizeof(npg_surface_hit) + 5 * sizeof(float)) +
           point_count * 120 + /* misfits: were all points far, with their links */
           840 * vert_count;   /* bytes per vertex, rounded up */
}

/* ---- points -> surface ---- */

/* Every step-th point, so that no more than the limit are asked for. */
static npg_status sample_points(npg_measure *m, const npg_frame_box *box, const npg_frame *frame,
                                size_t *taken)
{
    size_t limit = m->settings.point_limit ? (size_t)m->settings.point_limit : SIZE_MAX;
    size_t step = frame->point_count > limit ? (frame->point_count + limit - 1) / limit : 1;
    size_t count = (frame->point_count + step - 1) / step;
    NPG_TRY(npg_grow(&m->points, &m->points_capacity, count, 3 * sizeof *m->points, NPG_FOR_QUERY));
    NPG_TRY(npg_grow(&m->hits, &m->hits_capacity, count, sizeof *m->hits, NPG_FOR_QUERY));
    NPG_TRY(npg_grow(&m->dists, &m->dists_capacity, count, sizeof *m->dists, NPG_FOR_QUERY));
    *taken = 0;
    for (size_t i = 0; i < frame->point_count; i += step) {
        const float *p = frame->pos_local + 3 * i;
        if (!npg_vec3_is_finitef(p)) continue;
        npg_box_local_to_unit(box, m->points + 3 * (*taken)++, p, 1);
    }
    return NPG_OK;
}

/* The value that a share of the sorted values does not pass. */
static double quantile(const float *sorted, size_t count, double share)
{
    double at = share * (double)(count - 1);
    size_t below = (size_t)at, above = below + 1 < count ? below + 1 : below;
    double rest = at - (double)below;
    return (double)sorted[below] * (1 - rest) + (double)sorted[above] * rest;
}

/* The distances of `count` points; the result in *mean_sq is in diagonals, squared. */
static npg_status measure_points(npg_measure *m, npg_figures *figures, size_t count, double per_unit,
                                 double *mean_sq)
{
    double sum = 0, sum_sq = 0;
    NPG_TRY(npg_surface_closest(m->surface, m->hits, m->points, count));
    for (size_t i = 0; i < count; i++) {
        double dist_sq = (double)m->hits[i].dist_sq;
        sum_sq += dist_sq;
        sum += sqrt(dist_sq);
        m->dists[i] = (float)sqrt(dist_sq);
    }
    qsort(m->dists, count, sizeof *m->dists, npg_order_float);
    figures->point_dist_median = quantile(m->dists, count, 0.5) * per_unit;
    figures->point_dist_p95 = quantile(m->dists, count, 0.95) * per_unit;
    figures->point_dist_mean = sum / (double)count * per_unit;
    *mean_sq = sum_sq / (double)count * per_unit * per_unit;
    return NPG_OK;
}

/* ---- surface -> points ---- */

/* A vertex is covered when a point lies within cover-distance of it, or within twice the mean spacing of the
 * points on the surface where they are sparser than that. */
static double cover_radius(const npg_measure *m, double area, size_t point_count, double per_unit)
{
    double spacing = sqrt(area / (double)point_count); /* the side of a point's share of the surface */
    return fmax(m->settings.cover_dist / 100 / per_unit, 2 * spacing);
}

/* Misfits as they are written down, so that a run which reads them back decides as this one. */
static void place_misfits(npg_figures *figures, const npg_frame_box *box)
{
    for (int i = 0; i < NPG_MISFITS; i++) {
        npg_misfit *misfit = &figures->misfits[i];
        float at[3] = {(float)misfit->at[0], (float)misfit->at[1], (float)misfit->at[2]};
        double world[3];
        npg_box_unit_to_world(box, world, at, 1);
        misfit->share = (double)(float)misfit->share;
        for (int a = 0; a < 3; a++) misfit->at[a] = (double)(float)world[a];
    }
}

/* Vertices that no point of the reference's supports, and none of this frame within `radius` (in units). */
static npg_status measure_unsupported(npg_measure *m, npg_figures *figures, const npg_frame_box *box,
                                      double radius, double whole)
{
    const npg_mesh *mesh = m->proxy->mesh;
    npg_patch patch;
    double sum = 0;
    if (!mesh->vert_unseen) return NPG_OK;
    for (size_t i = 0; i < mesh->vert_count; i++) {
        m->unsupported[i] = mesh->vert_unseen[i] && (double)m->dists[i] > radius * radius;
        if (m->unsupported[i]) sum += m->vert_areas[i];
    }
    figures->unsupported_share = whole > 0 ? sum / whole : 0;
    if (!(sum > 0)) return NPG_OK;
    NPG_TRY(npg_patch_largest(&patch, m->unsupported, m->vert_unit, m->vert_areas, mesh));
    npg_box_unit_to_world(box, figures->unsupported_at, patch.at, 1);
    return NPG_OK;
}

/* What the frame's sensors could see of the surface as it lies there; it is all where none is known. */
static npg_status find_in_sight(npg_measure *m, const npg_frame *frame, const npg_frame_box *box,
                                double spacing)
{
    const npg_mesh *mesh = m->proxy->mesh;
    float sensors[3 * NPG_FRAME_SENSORS_MOST];
    npg_box_local_to_unit(box, sensors, frame->sensor_local, frame->sensor_count);
    npg_mesh_vertex_normals(m->normals, m->vert_unit, mesh->vert_count, mesh->faces, mesh->face_count);
    return npg_visible_find(&m->visible, m->is_in_sight, m->surface, sensors, frame->sensor_count,
                            m->vert_unit, NULL, m->normals, mesh->vert_count, spacing);
}

/* Of the area where the images show that nothing is, before what they show or outside of its outline, whichever is more,
 * in places of the vertices. */
static double nowhere_share(const npg_measure *m, const npg_free_space *space, const float *places,
                            double whole)
{
    double before = 0, beside = 0;
    for (size_t i = 0; i < m->proxy->mesh->vert_count; i++) {
        npg_sight_kind kind = npg_free_space_look(space, places + 3 * i);
        before += kind == NPG_SEEN_EMPTY ? m->vert_areas[i] : 0;
        beside += kind == NPG_SEEN_BESIDE ? m->vert_areas[i] : 0;
    }
    return whole > 0 ? fmax(before, beside) / whole : 0;
}

/* What depth images say of the surface, and of the points.  The reference lies as the keyframe shows the body: what
 * the keyframe sees through there is a limb for the second time, wherever it hides in other frames. */
static npg_status measure_by_images(const npg_measure *m, npg_frame *frame, const npg_frame_box *box,
                                    size_t point_count, double whole)
{
    npg_free_space *space;
    NPG_TRY(npg_free_space_open(&space, frame, box));
    if (!space) return NPG_OK;
    double share = nowhere_share(m, space, m->vert_unit, whole);
    if (frame->is_key && m->settings.lies_as_key)
        share = fmax(share, nowhere_share(m, space, m->proxy->mesh->vert_pos, whole));
    frame->figures.nowhere_share = share;
    frame->figures.lost_share = npg_free_space_lost_share(space, m->points, m->hits, point_count);
    npg_free_space_close(&space);
    return NPG_OK;
}

/* After measure_points() of the same frame. */
static npg_status measure_vertices(npg_measure *m, npg_frame *frame, const npg_frame_box *box,
                                   size_t point_count, double per_unit, double *mean_sq)
{
    const npg_mesh *mesh = m->proxy->mesh;
    npg_figures *figures = &frame->figures;
    const float *vert_unit = m->vert_unit;
    size_t v = mesh->vert_count, count = 0;
    NPG_TRY(npg_grow(&m->dists, &m->dists_capacity, v, sizeof *m->dists, NPG_FOR_QUERY));
    NPG_TRY(npg_points_nearest(m->nearest, m->dists, m->points, point_count, vert_unit, v, 1));
    double area = npg_vertex_areas(m->vert_areas, vert_unit, v, mesh->faces, mesh->face_count);
    double radius = cover_radius(m, area, point_count, per_unit), covered = 0, seen = 0, sum = 0, sum_sq = 0;
    if (frame->sensor_count) NPG_TRY(find_in_sight(m, frame, box, sqrt(area / (double)point_count)));
    for (size_t i = 0; i < v; i++) {
        double dist_sq = (double)m->dists[i];
        if (frame->sensor_count && !m->is_in_sight[i]) continue;
        count++;
        sum_sq += dist_sq;
        sum += sqrt(dist_sq);
        seen += m->vert_areas[i];
        if (dist_sq <= radius * radius) covered += m->vert_areas[i];
    }
    if (!count) count = 1; /* nothing is in sight, and nothing covered */
    figures->coverage = seen > 0 ? covered / seen : 0;
    figures->vertex_dist_mean = sum / (double)count * per_unit;
    *mean_sq = sum_sq / (double)count * per_unit * per_unit;
    NPG_TRY(measure_unsupported(m, figures, box, radius, area));
    NPG_TRY(measure_by_images(m, frame, box, point_count, area));
    npg_misfit_frame found = {.points = m->points,
                              .hits = m->hits,
                              .point_count = point_count,
                              .point_dist_median = figures->point_dist_median / per_unit,
                              .vert_unit = vert_unit,
                              .vert_dist_sq = m->dists,
                              .vert_areas = m->vert_areas,
                              .area = area,
                              .is_in_sight = frame->sensor_count ? m->is_in_sight : NULL};
    NPG_TRY(npg_misfit_find(m->finder, figures->misfits, &found));
    place_misfits(figures, box);
    return NPG_OK;
}

/* ---- one frame ---- */

npg_status npg_measure_frame(npg_measure *measure, npg_frame *frame, const npg_frame_box *box)
{
    npg_measure *m = measure;
    npg_figures *figures = &frame->figures;
    double per_unit = 1 / (box->scale * box->diagonal), points_sq, vertices_sq;
    size_t point_count = 0;
    npg_shape_measure(m->shape, figures, frame->vert_unit);
    if (!frame->is_skipped) NPG_TRY(sample_points(m, box, frame, &point_count));
    if (!point_count) return NPG_OK;
    npg_proxy_gather(m->proxy, m->vert_unit, frame->vert_unit);
    for (size_t i = 0; i < 3 * NPG_MARKS; i++)
        figures->marks[i] = (float)((double)m->vert_unit[3 * m->marks[i / 3] + i % 3] * per_unit);
    NPG_TRY(npg_surface_move(m->surface, m->vert_unit));
    NPG_TRY(measure_points(m, figures, point_count, per_unit, &points_sq));
    NPG_TRY(measure_vertices(m, frame, box, point_count, per_unit, &vertices_sq));
    figures->chamfer = 0.5 * (points_sq + vertices_sq) * 1e5; /* in the unit of the paper's tables */
    return NPG_OK;
}
