/* Expected: surface without points that a sensor would have seen.
 *
 * Nobody said where sensors stood; the points of the keyframe tell.  Of directions d_k all around, C is a choice from
 * which they can be seen past the surface: again and again the one that sees the most of those which no other does,
 *
 *     k = argmax_k |{i : i not seen from C, i seen from d_k}|,
 *
 * while these are more than NPG_FEW of them.  A patch without points most of whose area is looked at from C would have
 * some if it were there: a web between two feathers is looked at by who saw the feathers, and nobody who saw a horse
 * from its sides looked at its belly.  Where more than NPG_FEW of the points are seen from nowhere, they are no sensor's,
 * and are all over the surface: then every patch would have some.  Not in the paper. */
#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "mesh/mesh_internal.h"
#include "track/track.h"

#define DIRECTIONS 64   /* evenly over the sphere, a bit for each                                   */
#define DISTANCE   2    /* of a sensor from the points' middle, in diagonals                        */
#define FACING     0.5  /* cosine from which on it is looked at, however near d_k is to the sensor  */
#define ASKED_MOST 4000 /* points of the keyframe                                                   */

typedef struct expectation {
    npg_arena arena;
    const npg_mesh *mesh;
    const npg_point_set *set;
    npg_surface *surface; /* owned                                             */
    npg_visible visible;
    float sensors[DIRECTIONS][3];
    uint64_t chosen;              /* C                                                 */
    bool sees_hidden;             /* points are all over the surface                   */
    uint32_t *patch;              /* F: one vertex of the patch; NONE: it has points   */
    uint8_t *is_looked_at, *keep; /* F                                        */
} expectation;

enum { NONE = UINT32_MAX };

/* ---- from where the keyframe was seen ---- */

static void place_sensors(expectation *e)
{
    const npg_point_set *set = e->set;
    double middle[3] = {0, 0, 0}, direction[3];
    for (size_t i = 0; i < 3 * set->key_count; i++)
        middle[i % 3] += (double)set->key_points[i] / (double)set->key_count;
    for (size_t k = 0; k < DIRECTIONS; k++) {
        npg_direction_spread(direction, k, DIRECTIONS);
        for (size_t a = 0; a < 3; a++)
            e->sensors[k][a] = (float)(middle[a] + DISTANCE * set->diagonal * direction[a]);
    }
}

/* views[i] (N): bit k where d_k sees the point. */
static npg_status find_views(expectation *e, uint64_t *views, const float *points, const float *normals,
                             size_t n)
{
    uint8_t *is_seen = npg_arena_take(&e->arena, n, 1);
    NPG_TRY(npg_arena_status(&e->arena));
    for (size_t k = 0; k < DIRECTIONS; k++) {
        NPG_TRY(npg_visible_find(&e->visible, is_seen, e->surface, e->sensors[k], 1, points, NULL, normals, n,
                                 e->set->seen_dist));
        for (size_t i = 0; i < n; i++) views[i] |= (uint64_t)is_seen[i] << k;
    }
    return NPG_OK;
}

static void choose(expectation *e, const uint64_t *views, size_t n)
{
    double few = NPG_FEW * (double)n;
    size_t best, counts[DIRECTIONS], hidden = 0;
    for (size_t i = 0; i < n; i++) hidden += !views[i];
    e->sees_hidden = (double)hidden > few;
    do {
        best = 0;
        for (size_t k = 0; k < DIRECTIONS; k++) {
            counts[k] = 0;
            for (size_t i = 0; i < n; i++) counts[k] += !(views[i] & e->chosen) && (views[i] >> k & 1);
            if (counts[k] > counts[best]) best = k;
        }
        if ((double)counts[best] > few) e->chosen |= (uint64_t)1 << best;
    } while ((double)counts[best] > few);
}

static npg_status find_sensors(expectation *e)
{
    const npg_point_set *set = e->set;
    float *points = npg_arena_take(&e->arena, ASKED_MOST, 3 * sizeof *points);
    float *normals = npg_arena_take(&e->arena, ASKED_MOST, 3 * sizeof *normals);
    uint64_t *views = npg_arena_take(&e->arena, ASKED_MOST, sizeof *views);
    NPG_TRY(npg_arena_status(&e->arena));
    size_t n =
        npg_points_spread(points, normals, ASKED_MOST, set->key_points, set->key_normals, set->key_count);
    place_sensors(e);
    NPG_TRY(find_views(e, views, points, normals, n));
    choose(e, views, n);
    return NPG_OK;
}

/* ---- what they would have seen ---- */

static npg_status look(expectation *e)
{
    const npg_mesh *mesh = e->mesh;
    size_t n = mesh->face_count;
    float *middles = npg_arena_take(&e->arena, n, 3 * sizeof *middles);
    float *normals = npg_arena_take(&e->arena, n, 3 * sizeof *normals);
    uint8_t *is_seen = npg_arena_take(&e->arena, n, 1);
    NPG_TRY(npg_arena_status(&e->arena));
    for (size_t f = 0; f < n; f++) {
        double normal[3];
        npg_face_normal(normal, mesh->vert_pos, mesh->faces + 3 * f);
        npg_face_middle(middles + 3 * f, mesh->vert_pos, mesh->faces + 3 * f);
        for (size_t a = 0; a < 3; a++) normals[3 * f + a] = (float)normal[a];
    }
    for (size_t k = 0; k < DIRECTIONS; k++) {
        if (!(e->chosen >> k & 1)) continue;
        NPG_TRY(npg_visible_find(&e->visible, is_seen, e->surface, e->sensors[k], 1, middles, NULL, normals,
                                 n, e->set->seen_dist));
        for (size_t f = 0; f < n; f++) {
            const double normal[3] = {(double)normals[3 * f], (double)normals[3 * f + 1],
                                      (double)normals[3 * f + 2]};
            e->is_looked_at[f] |=
                is_seen[f] && npg_faces_sensor(e->sensors[k], 1, middles + 3 * f, normal, FACING);
        }
    }
    return NPG_OK;
}

/* Faces without points that share a vertex are one patch. */
static npg_status find_patches(expectation *e, bool *any)
{
    const npg_mesh *mesh = e->mesh;
    float *dist = npg_arena_take(&e->arena, mesh->vert_count, sizeof *dist);
    uint32_t *parent = npg_arena_take(&e->arena, mesh->vert_count, sizeof *parent);
    NPG_TRY(npg_arena_status(&e->arena));
    NPG_TRY(npg_points_dist(dist, mesh->vert_pos, mesh->vert_count, e->set->points, e->set->count));
    for (uint32_t i = 0; i < mesh->vert_count; i++) parent[i] = i;
    for (size_t f = 0; f < mesh->face_count; f++) {
        const uint32_t *face = mesh->faces + 3 * f;
        bool has_points = (double)(dist[face[0]] + dist[face[1]] + dist[face[2]]) / 3 <= e->set->seen_dist;
        e->patch[f] = has_points ? NONE : face[0];
        for (int k = 1; k < 3 && !has_points; k++) npg_set_join(parent, face[0], face[k]);
        *any |= !has_points;
    }
    for (size_t f = 0; f < mesh->face_count; f++)
        if (e->patch[f] != NONE) e->patch[f] = npg_set_root(parent, e->patch[f]);
    return NPG_OK;
}

static npg_status choose_kept(expectation *e, bool *any)
{
    const npg_mesh *mesh = e->mesh;
    double(*areas)[2] =
        npg_arena_take(&e->arena, mesh->vert_count, sizeof *areas); /* of a patch: not, and looked at */
    NPG_TRY(npg_arena_status(&e->arena));
    for (size_t f = 0; f < mesh->face_count; f++)
        if (e->patch[f] != NONE)
            areas[e->patch[f]][e->sees_hidden || e->is_looked_at[f]] +=
                npg_face_area(mesh->vert_pos, mesh->faces + 3 * f);
    *any = false;
    for (size_t f = 0; f < mesh->face_count; f++) {
        e->keep[f] = e->patch[f] == NONE || areas[e->patch[f]][0] >= areas[e->patch[f]][1];
        *any |= !e->keep[f];
    }
    return NPG_OK;
}

/* ---- the whole ---- */

static npg_status open_expectation(expectation *e, const npg_mesh *mesh, const npg_point_set *set)
{
    size_t n = mesh->face_count;
    e->mesh = mesh;
    e->set = set;
    e->patch = npg_arena_take(&e->arena, n, sizeof *e->patch);
    e->is_looked_at = npg_arena_take(&e->arena, n, 1);
    e->keep = npg_arena_take(&e->arena, n, 1);
    npg_visible_open(&e->visible, &e->arena, n > ASKED_MOST ? n : ASKED_MOST);
    NPG_TRY(npg_arena_status(&e->arena));
    return npg_surface_open(&e->surface, mesh->vert_pos, mesh->vert_count, mesh->faces, n);
}

npg_status npg_mesh_trim_expected(npg_mesh **mesh, double *share, const npg_point_set *set)
{
    expectation e = {.arena.purpose = NPG_FOR_MESH};
    bool any = false;
    npg_status status = open_expectation(&e, *mesh, set);
    *share = 0;
    if (!status) status = find_patches(&e, &any);
    if (any && !status) status = find_sensors(&e);
    if (any && !status) status = look(&e);
    if (any && !status) status = choose_kept(&e, &any);
    if (any && !status) status = npg_mesh_keep_share(mesh, share, e.keep);
    npg_surface_close(&e.surface);
    npg_arena_release(&e.arena);
    return status;
}
