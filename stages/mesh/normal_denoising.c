/* Normal-guided denoising: targets from the points once, then steps of the vertices. */
#include "mesh/mesh_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"

/* By trial (tests/bed/decisions.md, "Noise in the reference"). */
#define WIDTH      0.6  /* of their weight's bell, in mean edges */
#define WEIGHT_MIN 1e-3 /* of all points that a face asks: below, it has none near it */
#define STEPS      3    /* of the vertices                                              */

typedef struct work {
    npg_mesh *mesh; /* loan                                       */
    npg_arena arena;
    float *centres;         /* F x 3                                      */
    npg_neighbours near;    /* F x NPG_PATCH                                   */
    double *targets;        /* F x 3                                      */
    double *sums, *moved;   /* V x 3 each; moved: since the start         */
    double *smooth;         /* V x 3                                      */
    uint32_t *faces_around; /* V: how many                                */
} work;

/* Centres of all faces and the mean length of their edges. */
static double place_centres(work *w)
{
    const npg_mesh *mesh = w->mesh;
    double edges = 0;
    for (size_t f = 0; f < mesh->face_count; f++) {
        const uint32_t *face = mesh->faces + 3 * f;
        for (size_t c = 0; c < 3; c++) {
            const float *from = mesh->vert_pos + 3 * (size_t)face[c];
            edges += npg_vec3_distance(from, mesh->vert_pos + 3 * (size_t)face[(c + 1) % 3]);
            for (size_t a = 0; a < 3; a++) w->centres[3 * f + a] += from[a] / 3;
            w->faces_around[face[c]]++;
        }
    }
    return edges / (double)(3 * mesh->face_count);
}

/* The target of a face; its own normal where no point near it faces its way. */
static void set_target(work *w, size_t f, const float *normals, double width)
{
    double own[3], sum[3] = {0}, weights = 0, *target = w->targets + 3 * f;
    npg_face_normal(own, w->mesh->vert_pos, w->mesh->faces + 3 * f);
    for (size_t i = NPG_PATCH * f; i < NPG_PATCH * (f + 1) && w->near.index[i] != UINT32_MAX; i++) {
        const float *n = normals + 3 * (size_t)w->near.index[i];
        double facing = own[0] * (double)n[0] + own[1] * (double)n[1] + own[2] * (double)n[2];
        if (!(facing > 0)) continue;
        double weight = facing * facing * exp(-(double)w->near.dist_sq[i] / (2 * width * width));
        for (int a = 0; a < 3; a++) sum[a] += weight * (double)n[a];
        weights += weight;
    }
    bool has_points = weights > WEIGHT_MIN && npg_vec3_make_unit(sum);
    memcpy(target, has_points ? sum : own, 3 * sizeof *target);
}

static npg_status set_targets(work *w, const float *points, const float *normals, size_t point_count)
{
    size_t face_count = w->mesh->face_count;
    double width = WIDTH * place_centres(w);
    NPG_TRY(npg_neighbours_take(&w->near, &w->arena, points, point_count, w->centres, face_count, NPG_PATCH));
    for (size_t f = 0; f < face_count; f++) set_target(w, f, normals, width);
    return NPG_OK;
}

/* What a face asks of its vertices, onto their sums: to lie in the plane through its centre across its
 * target. */
static void ask(work *w, size_t f)
{
    const uint32_t *face = w->mesh->faces + 3 * f;
    const double *target = w->targets + 3 * f;
    const float *corners[3];
    double centre[3] = {0};
    for (size_t c = 0; c < 3; c++) {
        corners[c] = w->mesh->vert_pos + 3 * (size_t)face[c];
        for (int a = 0; a < 3; a++) centre[a] += (double)corners[c][a] / 3;
    }
    for (size_t c = 0; c < 3; c++) {
        double off = 0, *sum = w->sums + 3 * (size_t)face[c];
        for (int a = 0; a < 3; a++) off += target[a] * (centre[a] - (double)corners[c][a]);
        for (int a = 0; a < 3; a++) sum[a] += off * target[a];
    }
}

static void step(work *w)
{
    npg_mesh *mesh = w->mesh;
    memset(w->sums, 0, mesh->vert_count * 3 * sizeof *w->sums);
    for (size_t f = 0; f < mesh->face_count; f++) ask(w, f);
    for (size_t i = 0; i < 3 * mesh->vert_count; i++) {
        if (!w->faces_around[i / 3]) continue;
        double by = w->sums[i] / w->faces_around[i / 3];
        w->moved[i] += by;
        mesh->vert_pos[i] += (float)by;
    }
}

/* One ring: half of each vertex' own value stays, half is its neighbours' mean. */
static void average(work *w)
{
    const npg_mesh *mesh = w->mesh;
    memset(w->sums, 0, mesh->vert_count * 3 * sizeof *w->sums);
    for (size_t f = 0; f < mesh->face_count; f++)
        for (size_t c = 0; c < 3; c++) {
            const uint32_t *face = mesh->faces + 3 * f;
            const double *one = w->smooth + 3 * (size_t)face[(c + 1) % 3];
            const double *other = w->smooth + 3 * (size_t)face[(c + 2) % 3];
            for (size_t a = 0; a < 3; a++) w->sums[3 * (size_t)face[c] + a] += one[a] + other[a];
        }
    for (size_t i = 0; i < 3 * mesh->vert_count; i++)
        if (w->faces_around[i / 3])
            w->smooth[i] = 0.5 * (w->smooth[i] + w->sums[i] / (2 * (double)w->faces_around[i / 3]));
}

static void take_back(work *w)
{
    size_t count = 3 * w->mesh->vert_count;
    memcpy(w->smooth, w->moved, count * sizeof *w->smooth);
    for (int ring = 0; ring < 2 * STEPS; ring++) average(w);
    for (size_t i = 0; i < count; i++) w->mesh->vert_pos[i] -= (float)w->smooth[i];
}

npg_status npg_mesh_denoise(npg_mesh *mesh, const float *points, const float *normals, size_t point_count)
{
    size_t v = mesh->vert_count, f = mesh->face_count;
    work w = {.mesh = mesh, .arena.purpose = NPG_FOR_MESH};
    if (!f) return NPG_OK;
    w.centres = npg_arena_take(&w.arena, f, 3 * sizeof *w.centres);
    w.targets = npg_arena_take(&w.arena, f, 3 * sizeof *w.targets);
    w.sums = npg_arena_take(&w.arena, v, 3 * sizeof *w.sums);
    w.moved = npg_arena_take(&w.arena, v, 3 * sizeof *w.moved);
    w.smooth = npg_arena_take(&w.arena, v, 3 * sizeof *w.smooth);
    w.faces_around = npg_arena_take(&w.arena, v, sizeof *w.faces_around);
    npg_status status = npg_arena_status(&w.arena);
    if (!status) status = set_targets(&w, points, normals, point_count);
    for (int i = 0; i < STEPS && !status; i++) step(&w);
    if (!status) take_back(&w);
    npg_arena_release(&w.arena);
    return status;
}
