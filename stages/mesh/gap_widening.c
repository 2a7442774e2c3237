/* Gap widening: shifts of points that face each other, and the way back. */
#include "mesh/mesh_internal.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "outlier/normals.h"

#define NEIGHBOURS    48   /* in which a facing point is looked for */
#define ACROSS        0.5f /* cosine of a normal and the way across the gap */
#define SMOOTH_ROUNDS 3
#define BACK_ROUNDS   2 /* that the surface is drawn to its points */
#define BACK_OVER     6 /* points around a vertex */

/* ---- contact ---- */

/* Whether two points with outward normals n and m face each other across a gap. */
static bool points_face(const float *p, const float *n, const float *q, const float *m)
{
    float d[3], along_n = 0, along_m = 0, cosine = 0, length = 0;
    for (int a = 0; a < 3; a++) {
        d[a] = q[a] - p[a];
        length += d[a] * d[a];
        along_n += d[a] * n[a];
        along_m += d[a] * m[a];
        cosine += n[a] * m[a];
    }
    length = sqrtf(length);
    return cosine < -NPG_SAME_SIDE && along_n > ACROSS * length && along_m < -ACROSS * length;
}

/* ---- gaps ---- */

static float push_of(size_t i, const uint32_t *near, const float *dist_sq, const float *points,
                     const float *normals, size_t n, double wide)
{
    for (size_t k = 0; k < NEIGHBOURS && near[k] < n; k++) {
        double gap = sqrt((double)dist_sq[k]);
        if (gap >= wide) break;
        if (near[k] == i) continue;
        size_t j = near[k];
        if (points_face(points + 3 * i, normals + 3 * i, points + 3 * j, normals + 3 * j))
            return (float)((wide - gap) / 2);
    }
    return 0;
}

/* A point takes the mean push of its neighbours on the same side, if that is more than its own. */
static void smooth(float *out, const float *push, const uint32_t *near, const float *normals, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        float sum = 0, weight = 0;
        for (size_t k = 0; k < NPG_NEIGHBOURS; k++) {
            size_t j = near[NEIGHBOURS * i + k];
            if (j >= n) break;
            if (npg_vec3_dotf(normals + 3 * i, normals + 3 * j) < NPG_SAME_SIDE) continue;
            sum += push[j];
            weight += 1;
        }
        out[i] = weight > 0 ? fmaxf(push[i], sum / weight) : push[i];
    }
}

static npg_status measure_pushes(float *push, const npg_gap_widening *widening)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    npg_neighbours near;
    const float *points = widening->points, *normals = widening->normals;
    size_t n = widening->count;
    float *smoothed = npg_arena_take(&scratch, n, sizeof *smoothed);
    npg_status status = npg_neighbours_take(&near, &scratch, points, n, points, n, NEIGHBOURS);
    for (size_t i = 0; i < n && !status; i++)
        push[i] = push_of(i, near.index + NEIGHBOURS * i, near.dist_sq + NEIGHBOURS * i, points, normals, n,
                          NPG_GAP * widening->spacing);
    for (int round = 0; round < SMOOTH_ROUNDS && !status; round++) {
        smooth(smoothed, push, near.index, normals, n);
        memcpy(push, smoothed, n * sizeof(float));
    }
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_gaps_widen(npg_gap_widening *widening, const float *points, const float *normals, size_t n,
                          double spacing)
{
    NPG_REQUIRE(n && spacing > 0);
    *widening = (npg_gap_widening){
        .points = points, .normals = normals, .count = n, .spacing = spacing, .arena.purpose = NPG_FOR_MESH};
    float *push = npg_arena_take(&widening->arena, n, sizeof *push);
    widening->shift = npg_arena_take(&widening->arena, n, 3 * sizeof *widening->shift);
    widening->shifted = npg_arena_take(&widening->arena, n, 3 * sizeof *widening->shifted);
    npg_status status = npg_arena_status(&widening->arena);
    if (!status) status = measure_pushes(push, widening);
    for (size_t i = 0; i < 3 * n && !status; i++) {
        widening->moved += i % 3 == 0 && push[i / 3] > 0;
        widening->shift[i] = -push[i / 3] * normals[i];
        widening->shifted[i] = points[i] + widening->shift[i];
    }
    if (status) npg_gaps_close(widening);
    return status;
}

void npg_gaps_close(npg_gap_widening *widening)
{
    npg_arena_release(&widening->arena);
}

/* ---- back ---- */

/* The points around a vertex, on its side of the gap, and how much each counts. */
typedef struct around {
    uint32_t point[BACK_OVER];
    float weight[BACK_OVER];
    int count;
} around;

typedef struct way_back {
    const npg_gap_widening *widening;
    npg_mesh *mesh;
    around *of;            /* V */
    npg_surface_hit *hits; /* N */
    float *gaps;           /* N x 3: from the surface to each point, along its normal */
} way_back;

static void choose_around(around *to, const float *vert_normal, const uint32_t *near, const float *dist_sq,
                          const npg_gap_widening *widening)
{
    float scale = 0;
    for (size_t k = 0; k < NPG_PATCH && near[k] < widening->count && to->count < BACK_OVER; k++) {
        if (npg_vec3_dotf(vert_normal, widening->normals + 3 * (size_t)near[k]) <= 0) continue; /* across */
        if (!to->count) scale = dist_sq[k] + 1e-12f;
        to->weight[to->count] = scale / (dist_sq[k] + scale);
        to->point[to->count++] = near[k];
    }
}

static npg_status find_around(way_back *w)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    npg_neighbours near;
    const npg_mesh *m = w->mesh;
    size_t v = m->vert_count;
    float *normals = npg_arena_take(&scratch, v, 3 * sizeof *normals);
    npg_status status = npg_neighbours_take(&near, &scratch, w->widening->shifted, w->widening->count,
                                            m->vert_pos, v, NPG_PATCH);
    if (!status) npg_mesh_vertex_normals(normals, m->vert_pos, v, m->faces, m->face_count);
    for (size_t i = 0; i < v && !status; i++)
        choose_around(&w->of[i], normals + 3 * i, near.index + NPG_PATCH * i, near.dist_sq + NPG_PATCH * i,
                      w->widening);
    npg_arena_release(&scratch);
    return status;
}

/* The weighted mean of the rows (x 3) that belong to the points around a vertex. */
static void mean_around(float mean[3], const around *of, const float *rows)
{
    float weight = 0;
    mean[0] = mean[1] = mean[2] = 0;
    for (int k = 0; k < of->count; k++) {
        weight += of->weight[k];
        for (size_t a = 0; a < 3; a++) mean[a] += of->weight[k] * rows[3 * (size_t)of->point[k] + a];
    }
    for (size_t a = 0; a < 3 && weight > 0; a++) mean[a] /= weight;
}

/* Vertices around which points were moved go where the rows of these say. */
static void move(const way_back *w, const float *rows, float sign)
{
    for (size_t i = 0; i < w->mesh->vert_count; i++) {
        float way[3], went[3];
        mean_around(went, &w->of[i], w->widening->shift);
        if (npg_vec3_dotf(went, went) <= 0) continue;
        mean_around(way, &w->of[i], rows);
        for (size_t a = 0; a < 3; a++) w->mesh->vert_pos[3 * i + a] += sign * way[a];
    }
}

/* What is farther from the surface than points are from each other is none of it. */
static npg_status measure_gaps(way_back *w)
{
    const npg_mesh *m = w->mesh;
    const npg_gap_widening *widening = w->widening;
    NPG_TRY(npg_mesh_closest(w->hits, m, widening->points, widening->count));
    for (size_t i = 0; i < widening->count; i++) {
        const npg_surface_hit *hit = &w->hits[i];
        const float *point = widening->points + 3 * i, *normal = widening->normals + 3 * i;
        float on[3], along = 0;
        npg_hit_blend(on, hit, m->faces, m->vert_pos, 3);
        for (size_t a = 0; a < 3; a++) along += (point[a] - on[a]) * normal[a];
        bool is_of_it = (double)hit->dist_sq < widening->spacing * widening->spacing;
        for (size_t a = 0; a < 3; a++) w->gaps[3 * i + a] = is_of_it ? along * normal[a] : 0;
    }
    return NPG_OK;
}

npg_status npg_gaps_bring_back(const npg_gap_widening *widening, npg_mesh *mesh)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    way_back w = {.widening = widening, .mesh = mesh};
    if (!widening->moved) return NPG_OK;
    w.of = npg_arena_take(&scratch, mesh->vert_count, sizeof *w.of);
    w.hits = npg_arena_take(&scratch, widening->count, sizeof *w.hits);
    w.gaps = npg_arena_take(&scratch, widening->count, 3 * sizeof *w.gaps);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = find_around(&w);
    if (!status) move(&w, widening->shift, -1);
    for (int round = 0; round < BACK_ROUNDS && !status; round++) {
        status = measure_gaps(&w);
        if (!status) move(&w, w.gaps, 1);
    }
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_poisson_apart(npg_mesh **mesh, size_t *moved, const float *points, const float *normals,
                             size_t n, double spacing, const npg_poisson_settings *settings)
{
    npg_gap_widening gaps;
    *mesh = NULL;
    *moved = 0;
    if (!settings->holds_apart) return npg_poisson(mesh, points, normals, n, settings);
    NPG_TRY(npg_gaps_widen(&gaps, points, normals, n, spacing));
    *moved = gaps.moved;
    npg_status status = npg_poisson(mesh, gaps.shifted, normals, n, settings);
    if (!status) status = npg_gaps_bring_back(&gaps, *mesh);
    if (status) npg_mesh_unref(mesh);
    npg_gaps_close(&gaps);
    return status;
}
