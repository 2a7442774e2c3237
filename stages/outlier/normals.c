/* Normals: principal components, the side of a sensor, and that of the winding number. */
#include "outlier/normals.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "kernels/jacobi.h"
#include "pipeline/frame_box.h"
#include "pipeline/memory.h"

#define JACOBI_ROUNDS 12 /* sweeps, more than a 3 x 3 matrix needs */

/* ---- smallest eigenvector of a symmetric 3 x 3 matrix ---- */

static void smallest_axis(float axis[3], double m[3][3])
{
    double v[3][3];
    npg_jacobi(m[0], v[0], 3, JACOBI_ROUNDS);
    int least = m[0][0] <= m[1][1] ? 0 : 1;
    if (m[2][2] < m[least][least]) least = 2;
    double length = sqrt(v[0][least] * v[0][least] + v[1][least] * v[1][least] + v[2][least] * v[2][least]);
    for (int a = 0; a < 3; a++) axis[a] = (float)(v[a][least] / length);
}

/* ---- estimate ---- */

void npg_normal_of(float normal[3], const float *points, size_t count)
{
    double mean[3] = {0}, m[3][3] = {{0}};
    for (size_t i = 0; i < 3 * count; i++) mean[i % 3] += (double)points[i] / (double)count;
    for (size_t i = 0; i < count; i++) {
        double d[3];
        for (size_t a = 0; a < 3; a++) d[a] = (double)points[3 * i + a] - mean[a];
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) m[a][b] += d[a] * d[b];
    }
    smallest_axis(normal, m);
}

typedef struct estimate {
    float *normals;
    size_t neighbours;
    const float *points;
} estimate;

/* An npg_kdtree_visit. */
static void estimate_point(void *user, uint32_t point, const uint32_t *index, const float *dist_sq)
{
    const estimate *e = user;
    float around[3 * NPG_KDTREE_NEIGHBOURS];
    size_t found = 0;
    (void)dist_sq;
    for (; found < e->neighbours && index[found] != UINT32_MAX; found++)
        memcpy(around + 3 * found, e->points + 3 * (size_t)index[found], 3 * sizeof *around);
    npg_normal_of(e->normals + 3 * (size_t)point, around, found);
}

npg_status npg_normals_estimate(float *normals, const float *points, size_t n, int neighbours)
{
    npg_kdtree *tree = NULL;
    estimate e = {.normals = normals, .neighbours = (size_t)neighbours, .points = points};
    NPG_REQUIRE(neighbours >= 3 && neighbours <= NPG_KDTREE_NEIGHBOURS);
    NPG_TRY(npg_kdtree_open(&tree, points, n));
    npg_status status = npg_kdtree_each(tree, (size_t)neighbours, NULL, estimate_point, &e, 0);
    npg_kdtree_close(&tree);
    return status;
}

/* ---- sensor ---- */

void npg_normals_face_sensor(float *normals, size_t *flipped, const float *points, size_t n,
                             const float sensor[3])
{
    *flipped = 0;
    for (size_t i = 0; i < n; i++) {
        double toward = 0;
        for (size_t a = 0; a < 3; a++)
            toward += (double)normals[3 * i + a] * ((double)sensor[a] - (double)points[3 * i + a]);
        if (toward >= 0) continue;
        for (size_t a = 0; a < 3; a++) normals[3 * i + a] = -normals[3 * i + a];
        ++*flipped;
    }
}

/* ---- winding number ---- */

/* away[i] = whether normal i faces against the field: that of the points alone, or one that begins with `given`. */
static npg_status find_away(uint8_t *away, npg_arena *arena, const float *normals, const float *points,
                            const float *given, size_t n)
{
    float *field = npg_arena_take(arena, n, 3 * sizeof *field);
    NPG_TRY(npg_arena_status(arena));
    memcpy(field, normals, n * 3 * sizeof *field);
    NPG_TRY(npg_winding_normals(field, points, given, n));
    for (size_t i = 0; i < n; i++) away[i] = npg_vec3_dotf(normals + 3 * i, field + 3 * i) < 0;
    return NPG_OK;
}

/* Whether two neighbours' sides say the same: they look the same way, or they are the two sides of a sheet or of a gap,
 * one more behind or before the other than beside it. */
static bool sides_agree(const float *p, const float *n, const float *q, const float *m)
{
    float d[3], along_n, along_m, least;
    if (npg_vec3_dotf(n, m) > 0) return true;
    for (int a = 0; a < 3; a++) d[a] = q[a] - p[a];
    along_n = npg_vec3_dotf(d, n);
    along_m = npg_vec3_dotf(d, m);
    least = npg_vec3_dotf(d, d) / 2;
    return along_n * along_n > least && along_m * along_m > least;
}

/* Neighbours whose sides agree are one patch. */
static npg_status find_patches(uint32_t *parent, npg_arena *arena, const float *points, const float *given,
                               size_t n)
{
    npg_neighbours near;
    NPG_TRY(npg_neighbours_take(&near, arena, points, n, points, n, NPG_AROUND));
    for (uint32_t i = 0; i < n; i++) parent[i] = i;
    for (uint32_t i = 0; i < n; i++)
        for (size_t k = 0; k < NPG_AROUND; k++) {
            uint32_t j = near.index[NPG_AROUND * i + k];
            if (j == UINT32_MAX) break;
            const float *p = points + 3 * (size_t)i, *q = points + 3 * (size_t)j;
            if (sides_agree(p, given + 3 * (size_t)i, q, given + 3 * (size_t)j)) npg_set_join(parent, i, j);
        }
    return NPG_OK;
}

/* Few that face away are turned one by one.  Of more a patch turns as a whole, if at all: the field is as coarse as the
 * points, but sides that agree along a sheet thinner than their spacing were known to who gave them. */
static npg_status let_patches_vote(uint8_t *away, npg_arena *arena, const float *points, const float *given,
                                   size_t n)
{
    uint32_t *parent = npg_arena_take(arena, n, sizeof *parent);
    int32_t *votes = npg_arena_take(arena, n, sizeof *votes); /* of roots */
    size_t count = 0;
    NPG_TRY(npg_arena_status(arena));
    for (size_t i = 0; i < n; i++) count += away[i];
    if ((double)count <= NPG_FEW * (double)n) return NPG_OK;
    NPG_TRY(find_patches(parent, arena, points, given, n));
    for (uint32_t i = 0; i < n; i++) votes[npg_set_root(parent, i)] += away[i] ? 1 : -1;
    for (uint32_t i = 0; i < n; i++) away[i] = votes[npg_set_root(parent, i)] > 0;
    return NPG_OK;
}

static void turn(float *normals, size_t *turned, const uint8_t *away, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        if (!away[i]) continue;
        for (size_t a = 0; a < 3; a++) normals[3 * i + a] = -normals[3 * i + a];
        ++*turned;
    }
}

/* Of large clouds the field has sides, but directions only as coarse as the points it is made of. */
npg_status npg_normals_make(float *normals, const float *points, size_t n)
{
    npg_arena arena = {.purpose = NPG_FOR_FRAMES};
    size_t turned = 0;
    NPG_TRY(npg_normals_estimate(normals, points, n, NPG_NEIGHBOURS));
    if (npg_winding_is_whole(n)) return npg_winding_normals(normals, points, NULL, n);
    uint8_t *away = npg_arena_take(&arena, n, 1);
    npg_status status = npg_arena_status(&arena);
    if (!status) status = find_away(away, &arena, normals, points, NULL, n);
    if (!status) turn(normals, &turned, away, n);
    npg_arena_release(&arena);
    return status;
}

npg_status npg_normals_mend(float *normals, size_t *flipped, const float *points, size_t n)
{
    npg_arena arena = {.purpose = NPG_FOR_FRAMES};
    uint8_t *away = npg_arena_take(&arena, n, 1);
    npg_status status = npg_arena_status(&arena);
    *flipped = 0;
    if (!status) status = find_away(away, &arena, normals, points, normals, n);
    if (!status) status = let_patches_vote(away, &arena, points, normals, n);
    if (!status) turn(normals, flipped, away, n);
    npg_arena_release(&arena);
    return status;
}
