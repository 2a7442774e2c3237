/* Match: correspondences by the closest surface point, and back. */
#include "optimize/fit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/order.h"

struct npg_matcher {
    npg_match_settings settings;
    const npg_skinning *skinning; /* loan */
    const npg_mesh *mesh;         /* its surface, W vertices */
    npg_surface *surface;         /* moves from frame to frame */
    float *vert_normals;          /* W x 3 */
    float *targets, *normals;     /* M x 3 */
    npg_surface_hit *hits;        /* M */
    float *rest;                  /* M x 3: where the hits are at rest */
    npg_skin_weights *weights;    /* M */
    float *sorted;                /* max(M, S): distances */
    uint32_t *near;               /* S */
    float *near_sq;               /* S */
    npg_arena arrays;             /* holds these */
    size_t target_count;
    double least_width;
};

void npg_matcher_close(npg_matcher **slot)
{
    if (!slot || !*slot) return;
    npg_surface_close(&(*slot)->surface);
    npg_arena_release(&(*slot)->arrays);
    npg_release(slot);
}

npg_status npg_matcher_open(npg_matcher **out, const npg_skinning *skinning,
                            const npg_match_settings *settings)
{
    npg_matcher *m;
    npg_arena *a;
    const npg_mesh *mesh = skinning->surface->mesh;
    size_t n = (size_t)settings->points, s = skinning->samples->mesh->vert_count, w = mesh->vert_count;
    *out = NULL;
    NPG_TRY(npg_alloc(&m, NPG_FOR_FIT, sizeof *m));
    m->settings = *settings;
    m->skinning = skinning;
    m->mesh = mesh;
    a = &m->arrays;
    a->purpose = NPG_FOR_FIT;
    m->vert_normals = npg_arena_take(a, w, 3 * sizeof(float));
    m->targets = npg_arena_take(a, n, 3 * sizeof(float));
    m->normals = npg_arena_take(a, n, 3 * sizeof(float));
    m->hits = npg_arena_take(a, n, sizeof *m->hits);
    m->rest = npg_arena_take(a, n, 3 * sizeof(float));
    m->weights = npg_arena_take(a, n, sizeof *m->weights);
    m->sorted = npg_arena_take(a, n > s ? n : s, sizeof(float));
    m->near = npg_arena_take(a, s, sizeof *m->near);
    m->near_sq = npg_arena_take(a, s, sizeof(float));
    npg_status status = npg_arena_status(a);
    if (!status) status = npg_surface_open(&m->surface, mesh->vert_pos, w, mesh->faces, mesh->face_count);
    if (status) npg_matcher_close(&m);
    *out = m;
    return status;
}

void npg_matcher_widen(npg_matcher *m, double width)
{
    m->least_width = width;
}

size_t npg_matcher_most(const npg_matcher *m)
{
    return (size_t)m->settings.points + 2 * m->skinning->samples->mesh->vert_count;
}

static double median_of(float *values, size_t count)
{
    qsort(values, count, sizeof *values, npg_order_float);
    return (double)values[count / 2];
}

/* The point of a face with these weights, in some positions. */
static void face_point(float out[3], const float *vert_pos, const uint32_t *face, const float weights[3])
{
    for (size_t i = 0; i < 3; i++)
        out[i] = weights[0] * vert_pos[3 * (size_t)face[0] + i] +
                 weights[1] * vert_pos[3 * (size_t)face[1] + i] +
                 weights[2] * vert_pos[3 * (size_t)face[2] + i];
}

static void pull_target(npg_matcher *m, npg_pull *pull, size_t i, const float *vert_unit,
                        const float *samples, float weight)
{
    const npg_surface_hit *hit = &m->hits[i];
    const uint32_t *face = m->mesh->faces + 3 * (size_t)hit->face;
    float at[3];
    face_point(at, vert_unit, face, hit->weights);
    *pull = (npg_pull){.weight = weight, .along = (float)m->settings.along};
    face_point(pull->normal, m->vert_normals, face, hit->weights);
    npg_vec3_make_unitf(pull->normal);
    for (int c = 0; c < 3; c++) {
        pull->vertex[c] = m->weights[i].sample[c];
        pull->share[c] = m->weights[i].share[c];
        for (size_t k = 0; k < 3; k++) at[k] -= pull->share[c] * samples[3 * (size_t)pull->vertex[c] + k];
    }
    for (size_t k = 0; k < 3; k++) pull->constant[k] = at[k] - m->targets[3 * i + k];
}

/* Points -> surface. */
static void match_targets(npg_matcher *m, npg_pull *pulls, size_t *count, const float *vert_unit,
                          const float *samples, bool with_normals)
{
    for (size_t i = 0; i < m->target_count; i++) m->sorted[i] = sqrtf(m->hits[i].dist_sq);
    double width = fmax(3 * median_of(m->sorted, m->target_count) + 1e-4, m->least_width);
    double share = m->settings.total / (double)m->target_count;
    for (size_t i = 0; i < m->target_count; i++) {
        float weight = (float)share * (float)npg_geman_mcclure((double)m->hits[i].dist_sq, width);
        pull_target(m, &pulls[*count], i, vert_unit, samples, weight);
        if (with_normals && npg_vec3_dotf(pulls[*count].normal, m->normals + 3 * i) < (float)NPG_AGAINST)
            continue;
        ++*count;
    }
}

/* Surface -> points: samples whose nearest point is near enough to be theirs. */
static npg_status match_samples(npg_matcher *m, npg_pull *pulls, size_t *count, const float *samples,
                                const float *points, const float *normals, size_t point_count)
{
    size_t s_count = m->skinning->samples->mesh->vert_count;
    npg_kdtree *tree;
    NPG_TRY(npg_kdtree_open(&tree, points, point_count));
    npg_status status = npg_kdtree_nearest(tree, m->near, m->near_sq, samples, s_count, 1, 1);
    npg_kdtree_close(&tree);
    NPG_TRY(status);
    for (size_t s = 0; s < s_count; s++) m->sorted[s] = sqrtf(m->near_sq[s]);
    double width = fmax(3 * median_of(m->sorted, s_count) + 1e-4, m->least_width);
    double share = m->settings.reverse * m->settings.total / (double)s_count;
    for (size_t s = 0; s < s_count; s++) {
        const float *to = points + 3 * (size_t)m->near[s];
        npg_pull pull = {.vertex = {(int32_t)s, (int32_t)s, (int32_t)s}, .share = {1, 0, 0}};
        memcpy(pull.normal, m->vert_normals + 3 * (size_t)m->skinning->samples->vertex[s],
               sizeof pull.normal);
        if (normals && npg_vec3_dotf(pull.normal, normals + 3 * (size_t)m->near[s]) < (float)NPG_AGAINST)
            continue;
        pull.weight = (float)share * (float)npg_geman_mcclure((double)m->near_sq[s], width);
        pull.along = (float)m->settings.along;
        for (size_t k = 0; k < 3; k++) pull.constant[k] = -to[k];
        pulls[(*count)++] = pull;
    }
    return NPG_OK;
}

npg_status npg_match_points(npg_matcher *m, npg_pull *pulls, size_t *count, const float *vert_unit,
                            const float *samples, const float *points, const float *normals,
                            size_t point_count)
{
    const npg_mesh *mesh = m->mesh;
    if (!point_count) return NPG_OK;
    m->target_count =
        npg_points_spread(m->targets, m->normals, (size_t)m->settings.points, points, normals, point_count);
    npg_mesh_vertex_normals(m->vert_normals, vert_unit, mesh->vert_count, mesh->faces, mesh->face_count);
    NPG_TRY(npg_surface_move(m->surface, vert_unit));
    NPG_TRY(npg_surface_closest_near(m->surface, m->hits, m->targets, m->target_count, NULL, NULL, 1));
    for (size_t i = 0; i < m->target_count; i++)
        face_point(m->rest + 3 * i, mesh->vert_pos, mesh->faces + 3 * (size_t)m->hits[i].face,
                   m->hits[i].weights);
    NPG_TRY(npg_skin_bind(m->weights, m->skinning->samples->mesh, m->skinning->rest, m->rest, m->target_count,
                          1));
    match_targets(m, pulls, count, vert_unit, samples, normals != NULL);
    if (m->settings.reverse <= 0) return NPG_OK;
    return match_samples(m, pulls, count, samples, points, normals, point_count);
}

void npg_match_tie(const npg_matcher *m, npg_pull *pulls, size_t *count, const float *solved)
{
    size_t s_count = m->skinning->samples->mesh->vert_count;
    for (size_t s = 0; s < s_count && m->settings.tie > 0; s++) {
        npg_pull pull = {.vertex = {(int32_t)s, (int32_t)s, (int32_t)s}, .share = {1, 0, 0}, .along = 1};
        pull.weight = (float)(m->settings.tie * m->settings.total / (double)s_count);
        for (size_t k = 0; k < 3; k++) pull.constant[k] = -solved[3 * s + k];
        pulls[(*count)++] = pull;
    }
}
