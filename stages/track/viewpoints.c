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
    npg_viewpoints *found, all; /* all: those that are tried */
    npg_surface *surface;
    float *places, *normals; /* N x 3: points, then surface that has none    */
    uint64_t *views;         /* N: bit k where the k-th sees it              */
    uint8_t *is_seen;        /* N                                            */
    float sensors[3 * NPG_VIEWPOINTS_MOST];
    npg_visible visible;
    size_t point_count, count; /* N */
    double points_per_vert;    /* on surface that has some */
} search;

static void take_bare(search *s, const npg_mesh *mesh)
{
    s->count = s->point_count;
    for (size_t v = 0; v < mesh->vert_count && mesh->vert_unseen && mesh->vert_normals; v++) {
        if (!mesh->vert_unseen[v]) continue;
        memcpy(s->places + 3 * s->count, mesh->vert_pos + 3 * v, 3 * sizeof *s->places);
        memcpy(s->normals + 3 * s->count++, mesh->vert_normals + 3 * v, 3 * sizeof *s->normals);
    }
    s->points_per_vert = (double)s->point_count / (double)(mesh->vert_count + s->point_count - s->count);
}

static npg_status find_views(search *s, double offset)
{
    for (size_t k = 0; k < s->all.count; k++) {
        NPG_TRY(npg_visible_find(&s->visible, s->is_seen, s->surface, s->sensors + 3 * k, 1, s->places, NULL,
                                 s->normals, s->count, offset));
        for (size_t i = 0; i < s->count; i++) s->views[i] |= (uint64_t)s->is_seen[i] << k;
    }
    return NPG_OK;
}

/* Of the places first..end-1 those that one of `which` sees and none of the chosen. */
static double gain(const search *s, uint64_t chosen, uint64_t which, size_t first, size_t end)
{
    double count = 0;
    for (size_t i = first; i < end; i++) count += !(s->views[i] & chosen) && (s->views[i] & which);
    return count;
}

static void choose(search *s)
{
    double few = NPG_FEW * (double)s->point_count, bare = (double)(s->count - s->point_count);
    uint64_t chosen = 0;
    size_t hidden = 0, best = 0;
    for (size_t i = 0; i < s->point_count; i++) hidden += !s->views[i];
    s->found->sees_hidden = (double)hidden > few;
    while (!s->found->sees_hidden) {
        double most = -HUGE_VAL;
        for (size_t k = 0; k < s->all.count; k++) {
            uint64_t view = (uint64_t)1 << k;
            double gained = gain(s, chosen, view, 0, s->point_count);
            double net = gained - s->points_per_vert * gain(s, chosen, view, s->point_count, s->count);
            if (gained > few && net > most) most = net, best = k;
        }
        if (!(most > -HUGE_VAL)) break;
        chosen |= (uint64_t)1 << best;
        memcpy(s->found->directions + 3 * s->found->count++, s->all.directions + 3 * best,
               3 * sizeof *s->all.directions);
    }
    s->found->explain_bare = gain(s, 0, chosen, s->point_count, s->count) <= NPG_MOST * bare;
}

npg_status npg_viewpoints_find(npg_viewpoints *found, const npg_mesh *mesh, const float *points,
                               const float *normals, size_t count, double offset)
{
    search s = {.arena.purpose = NPG_FOR_MESH, .found = found, .all.count = NPG_VIEWPOINTS_MOST};
    size_t most = ASKED_MOST + mesh->vert_count;
    *found = (npg_viewpoints){0};
    s.places = npg_arena_take(&s.arena, most, 3 * sizeof *s.places);
    s.normals = npg_arena_take(&s.arena, most, 3 * sizeof *s.normals);
    s.views = npg_arena_take(&s.arena, most, sizeof *s.views);
    s.is_seen = npg_arena_take(&s.arena, most, 1);
    npg_visible_open(&s.visible, &s.arena, most);
    npg_status status = npg_arena_status(&s.arena);
    if (!status) {
        s.point_count = npg_points_spread(s.places, s.normals, ASKED_MOST, points, normals, count);
        take_bare(&s, mesh);
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
