/* Viewpoints: the fewest directions from which all points of a cloud are seen, chosen greedily. */
#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "pipeline/memory.h"
#include "track/track.h"

#define ASKED_MOST 4000 /* points */

void npg_viewpoints_place(float *sensors, const npg_viewpoints *viewpoints, const float *points, size_t count)
{
    double middle[3] = {0, 0, 0}, away = NPG_SENSOR_AWAY * npg_points_diagonal(points, count);
    for (size_t i = 0; i < 3 * count; i++) middle[i % 3] += (double)points[i] / (double)count;
    for (size_t i = 0; i < 3 * viewpoints->count; i++)
        sensors[i] = (float)(middle[i % 3] + away * viewpoints->directions[i]);
}

typedef struct search {
    npg_arena arena;
    npg_viewpoints *found, all; /* all: those that are tried                     */
    npg_surface *surface;
    float *points, *normals; /* N x 3                                         */
    uint64_t *views;         /* N: bit k where the k-th sees the point        */
    uint8_t *is_seen;        /* N                                             */
    float sensors[3 * NPG_VIEWPOINTS_MOST];
    npg_visible visible;
    size_t count; /* N */
} search;

static npg_status find_views(search *s, double offset)
{
    for (size_t k = 0; k < s->all.count; k++) {
        NPG_TRY(npg_visible_find(&s->visible, s->is_seen, s->surface, s->sensors + 3 * k, 1, s->points, NULL,
                                 s->normals, s->count, offset));
        for (size_t i = 0; i < s->count; i++) s->views[i] |= (uint64_t)s->is_seen[i] << k;
    }
    return NPG_OK;
}

/* Points that the k-th sees and none of the chosen. */
static size_t gain(const search *s, uint64_t chosen, size_t k)
{
    size_t count = 0;
    for (size_t i = 0; i < s->count; i++) count += !(s->views[i] & chosen) && (s->views[i] >> k & 1);
    return count;
}

static void choose(search *s)
{
    double few = NPG_FEW * (double)s->count;
    uint64_t chosen = 0;
    size_t hidden = 0;
    for (size_t i = 0; i < s->count; i++) hidden += !s->views[i];
    s->found->sees_hidden = (double)hidden > few;
    while (!s->found->sees_hidden) {
        size_t best = 0, most = 0;
        for (size_t k = 0; k < s->all.count; k++) {
            size_t gained = gain(s, chosen, k);
            if (gained > most) most = gained, best = k;
        }
        if (!((double)most > few)) return;
        chosen |= (uint64_t)1 << best;
        memcpy(s->found->directions + 3 * s->found->count++, s->all.directions + 3 * best,
               3 * sizeof *s->all.directions);
    }
}

npg_status npg_viewpoints_find(npg_viewpoints *found, const npg_mesh *mesh, const float *points,
                               const float *normals, size_t count, double offset)
{
    search s = {.arena.purpose = NPG_FOR_MESH, .found = found, .all.count = NPG_VIEWPOINTS_MOST};
    *found = (npg_viewpoints){0};
    s.points = npg_arena_take(&s.arena, ASKED_MOST, 3 * sizeof *s.points);
    s.normals = npg_arena_take(&s.arena, ASKED_MOST, 3 * sizeof *s.normals);
    s.views = npg_arena_take(&s.arena, ASKED_MOST, sizeof *s.views);
    s.is_seen = npg_arena_take(&s.arena, ASKED_MOST, 1);
    npg_visible_open(&s.visible, &s.arena, ASKED_MOST);
    npg_status status = npg_arena_status(&s.arena);
    if (!status) {
        s.count = npg_points_spread(s.points, s.normals, ASKED_MOST, points, normals, count);
        for (size_t k = 0; k < s.all.count; k++)
            npg_direction_spread(s.all.directions + 3 * k, k, s.all.count);
        npg_viewpoints_place(s.sensors, &s.all, points, count);
        status =
            npg_surface_open(&s.surface, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count);
    }
    if (!status) status = find_views(&s, offset);
    if (!status) choose(&s);
    npg_surface_close(&s.surface);
    npg_arena_release(&s.arena);
    return status;
}
