/* Expected: surface without points where all else that faces the same way has some.
 *
 * Whoever saw a capture saw what faces some directions: all, or those of a ring of cameras.  With S(d) the area that
 * has points near it and T(d) all area, of the faces within 37 degrees of d, T_p(d) of those of a patch p without points,
 *
 *     e(p) = sum_{f in p} A_f S(n_f) / sum_{f in p} A_f (T(n_f) - T_p(n_f))
 *
 * is how surely p would have points if it were there.  A web between two feathers faces as their sides do, which were
 * seen; the soles of feet face as little does that was seen. */
#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "mesh/mesh_internal.h"

#define DIRECTIONS 64  /* evenly over the sphere: n_f is rounded to the nearest */
#define ALIKE      0.8 /* cosine; by trial (tests/bed/decisions.md, "What would have been seen") */

typedef struct expectation {
    npg_arena arena;
    const npg_mesh *mesh;
    double (*normals)[3], *areas; /* F                                                     */
    uint32_t *nearest, *patch;    /* F: direction, where unseen; lowest vertex of its patch, NONE: seen   */
    uint8_t *keep;                /* F                                                     */
    uint32_t *order;              /* faces without points, patch by patch                   */
    size_t unseen;                /* of them                                                */
    double directions[DIRECTIONS][3];
    double all[DIRECTIONS], seen[DIRECTIONS];
} expectation;

enum { NONE = UINT32_MAX };

/* ---- directions ---- */

static void add_alike(double sums[DIRECTIONS], const expectation *e, size_t f, double area)
{
    for (int k = 0; k < DIRECTIONS; k++)
        if (npg_vec3_dot(e->normals[f], e->directions[k]) > ALIKE) sums[k] += area;
}

static uint32_t nearest_of(const expectation *e, size_t f)
{
    uint32_t best = 0;
    for (uint32_t k = 1; k < DIRECTIONS; k++)
        if (npg_vec3_dot(e->normals[f], e->directions[k]) > npg_vec3_dot(e->normals[f], e->directions[best]))
            best = k;
    return best;
}

/* ---- patches ---- */

/* Faces without points that share a vertex are one patch. */
static npg_status find_patches(expectation *e, const float *points, size_t point_count, double dist_max)
{
    const npg_mesh *mesh = e->mesh;
    float *dist = npg_arena_take(&e->arena, mesh->vert_count, sizeof *dist);
    uint32_t *parent = npg_arena_take(&e->arena, mesh->vert_count, sizeof *parent);
    NPG_TRY(npg_arena_status(&e->arena));
    NPG_TRY(npg_points_dist(dist, mesh->vert_pos, mesh->vert_count, points, point_count));
    for (uint32_t i = 0; i < mesh->vert_count; i++) parent[i] = i;
    for (size_t f = 0; f < mesh->face_count; f++) {
        const uint32_t *face = mesh->faces + 3 * f;
        bool is_seen = (double)(dist[face[0]] + dist[face[1]] + dist[face[2]]) / 3 <= dist_max;
        e->patch[f] = is_seen ? NONE : face[0];
        for (int k = 1; k < 3 && !is_seen; k++) npg_set_join(parent, face[0], face[k]);
    }
    for (uint32_t f = 0; f < mesh->face_count; f++) {
        if (e->patch[f] == NONE) continue;
        e->patch[f] = npg_set_root(parent, e->patch[f]);
        e->order[e->unseen++] = f;
    }
    return NPG_OK;
}

static void add_up(expectation *e)
{
    for (size_t k = 0; k < DIRECTIONS; k++) npg_direction_spread(e->directions[k], k, DIRECTIONS);
    for (size_t f = 0; f < e->mesh->face_count; f++) {
        e->areas[f] = npg_face_normal(e->normals[f], e->mesh->vert_pos, e->mesh->faces + 3 * f);
        e->keep[f] = 1;
        add_alike(e->all, e, f, e->areas[f]);
        if (e->patch[f] == NONE) add_alike(e->seen, e, f, e->areas[f]);
    }
}

static int by_patch(const void *a, const void *b, void *user)
{
    const uint32_t *patch = user, f = *(const uint32_t *)a, g = *(const uint32_t *)b;
    if (patch[f] != patch[g]) return patch[f] < patch[g] ? -1 : 1;
    return f < g ? -1 : f > g;
}

static void sort_patches(expectation *e)
{
    for (size_t i = 0; i < e->unseen; i++) e->nearest[e->order[i]] = nearest_of(e, e->order[i]);
    qsort_r(e->order, e->unseen, sizeof *e->order, by_patch, e->patch);
}

/* Whether the patch of `count` faces would have been seen; then it is taken out of the sums.  What faces alike must be
 * as large as the patch itself to say anything. */
static bool take_out(expectation *e, const uint32_t *faces, size_t count)
{
    double own[DIRECTIONS] = {0}, area = 0, seen = 0, all = 0;
    for (size_t i = 0; i < count; i++) add_alike(own, e, faces[i], e->areas[faces[i]]);
    for (size_t i = 0; i < count; i++) {
        uint32_t k = e->nearest[faces[i]];
        area += e->areas[faces[i]];
        seen += e->areas[faces[i]] * e->seen[k];
        all += e->areas[faces[i]] * (e->all[k] - own[k]);
    }
    if (all < area * area || seen < (1 - NPG_FEW) * all) return false;
    for (size_t i = 0; i < count; i++) e->keep[faces[i]] = 0;
    for (int k = 0; k < DIRECTIONS; k++) e->all[k] -= own[k];
    return true;
}

/* Once through all patches; true where one went, which says more of the others. */
static bool sweep(expectation *e)
{
    bool any = false;
    for (size_t first = 0, end; first < e->unseen; first = end) {
        uint32_t patch = e->patch[e->order[first]];
        for (end = first + 1; end < e->unseen && e->patch[e->order[end]] == patch;) end++;
        if (e->keep[e->order[first]]) any |= take_out(e, e->order + first, end - first);
    }
    return any;
}

/* ---- the whole ---- */

static npg_status open_expectation(expectation *e, const npg_mesh *mesh)
{
    size_t n = mesh->face_count;
    e->mesh = mesh;
    e->normals = npg_arena_take(&e->arena, n, sizeof *e->normals);
    e->areas = npg_arena_take(&e->arena, n, sizeof *e->areas);
    e->nearest = npg_arena_take(&e->arena, n, sizeof *e->nearest);
    e->patch = npg_arena_take(&e->arena, n, sizeof *e->patch);
    e->order = npg_arena_take(&e->arena, n, sizeof *e->order);
    e->keep = npg_arena_take(&e->arena, n, 1);
    return npg_arena_status(&e->arena);
}

npg_status npg_mesh_trim_expected(npg_mesh **mesh, double *share, const float *points, size_t point_count,
                                  double dist_max)
{
    expectation e = {.arena.purpose = NPG_FOR_MESH};
    npg_status status = open_expectation(&e, *mesh);
    *share = 0;
    if (!status) status = find_patches(&e, points, point_count, dist_max);
    if (!status && e.unseen) {
        add_up(&e);
        sort_patches(&e);
        bool any = false;
        while (sweep(&e)) any = true;
        if (any) status = npg_mesh_keep_share(mesh, share, e.keep);
    }
    npg_arena_release(&e.arena);
    return status;
}
