/* Metrics: how close a predicted mesh sequence is to a ground truth, by the measures
 * of the method's paper. */
#include "geometry/geometry.h"

#include <math.h>

#include "pipeline/frame_box.h"
#include "pipeline/random.h"

enum { SIDE_PREDICTED, SIDE_TRUTH }; /* keys of the random streams */

/* ---- samples ---- */

/* The first face whose cumulated area is above `area`. */
static size_t find_face(const double *cumulated, size_t face_count, double area)
{
    size_t low = 0, high = face_count - 1;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (cumulated[middle] > area)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

/* One sample of a face, uniform over it: the root makes up for its growing width
 * (Osada et al., Shape Distributions, 2002). */
static void sample_face(float pos[3], float normal_out[3], const npg_mesh *mesh, size_t f, npg_random *random)
{
    double r = sqrt(npg_random_real(random)), t = npg_random_real(random), normal[3];
    const uint32_t *face = mesh->faces + 3 * f;
    const float *a = mesh->vert_pos + 3 * (size_t)face[0], *b = mesh->vert_pos + 3 * (size_t)face[1],
                *c = mesh->vert_pos + 3 * (size_t)face[2];
    npg_face_normal(normal, mesh->vert_pos, face);
    for (int k = 0; k < 3; k++) {
        pos[k] = (float)((1 - r) * (double)a[k] + r * (1 - t) * (double)b[k] + r * t * (double)c[k]);
        normal_out[k] = (float)normal[k];
    }
}

npg_status npg_mesh_sample(float *pos, float *normals, const npg_mesh *mesh, size_t sample_count,
                           uint64_t seed, uint64_t frame, uint64_t purpose)
{
    double *cumulated, total = 0, normal[3];
    NPG_TRY(npg_alloc_array(&cumulated, NPG_FOR_QUERY, mesh->face_count, sizeof *cumulated));
    for (size_t f = 0; f < mesh->face_count; f++)
        cumulated[f] = total += npg_face_normal(normal, mesh->vert_pos, mesh->faces + 3 * f);
    npg_status status = NPG_OK;
    if (!(total > 0) || !isfinite(total))
        status = npg_error(NPG_BAD_INPUT, "the mesh has no area, or a vertex that is not finite");
    npg_random random = npg_random_stream(seed, frame, purpose);
    for (size_t s = 0; s < sample_count && !status; s++) {
        size_t f = find_face(cumulated, mesh->face_count, npg_random_real(&random) * total);
        sample_face(pos + 3 * s, normals + 3 * s, mesh, f, &random);
    }
    npg_release(&cumulated);
    return status;
}

/* One side of a comparison. */
typedef struct side {
    size_t count;
    const float *pos, *normals; /* normals may be NULL */
    npg_neighbours nearest;     /* of the other side   */
} side;

static npg_status open_side(side *s, npg_arena *arena, const npg_mesh *mesh,
                            const npg_metrics_settings *settings, uint64_t frame, uint64_t purpose)
{
    size_t n = mesh->face_count ? settings->sample_count : mesh->vert_count;
    if (!n) return npg_error(NPG_BAD_INPUT, "the ground truth has no points");
    *s = (side){.count = n, .pos = mesh->vert_pos, .normals = mesh->vert_normals};
    if (!mesh->face_count) return NPG_OK;
    float *pos = npg_arena_take(arena, n, 3 * sizeof *pos);
    float *normals = npg_arena_take(arena, n, 3 * sizeof *normals);
    s->pos = pos;
    s->normals = normals;
    NPG_TRY(npg_arena_status(arena));
    return npg_mesh_sample(pos, normals, mesh, n, settings->seed, frame, purpose);
}

static npg_status find_nearest(side *from, npg_arena *arena, const side *to)
{
    return npg_neighbours_take(&from->nearest, arena, to->pos, to->count, from->pos, from->count, 1);
}

/* ---- figures ---- */

static double mean_dist_sq(const side *s, double diagonal)
{
    double sum = 0;
    for (size_t i = 0; i < s->count; i++) sum += (double)s->nearest.dist_sq[i];
    return sum / (double)s->count / (diagonal * diagonal);
}

static double share_within(const side *s, double dist)
{
    size_t count = 0;
    for (size_t i = 0; i < s->count; i++) count += (double)s->nearest.dist_sq[i] <= dist * dist;
    return (double)count / (double)s->count;
}

static double normal_agreement(const side *from, const side *to)
{
    double sum = 0;
    for (size_t i = 0; i < from->count; i++) {
        const float *a = from->normals + 3 * i, *b = to->normals + 3 * (size_t)from->nearest.index[i];
        sum += fabs((double)a[0] * (double)b[0] + (double)a[1] * (double)b[1] + (double)a[2] * (double)b[2]);
    }
    return sum / (double)from->count;
}

static void measure(npg_eval_figures *out, const side *predicted, const side *truth,
                    const npg_metrics_settings *settings)
{
    double tau = settings->tau * settings->diagonal;
    out->cd_to_truth = 1e5 * mean_dist_sq(predicted, settings->diagonal);
    out->cd_from_truth = 1e5 * mean_dist_sq(truth, settings->diagonal);
    out->cd = 0.5 * (out->cd_to_truth + out->cd_from_truth);
    out->precision = share_within(predicted, tau);
    out->recall = share_within(truth, tau);
    double sum = out->precision + out->recall;
    out->f = sum > 0 ? 2 * out->precision * out->recall / sum : 0;
    out->nc = (double)NAN;
    if (truth->normals)
        out->nc = 0.5 * (normal_agreement(predicted, truth) + normal_agreement(truth, predicted));
}

npg_status npg_metrics_compare(npg_eval_figures *out, const npg_mesh *predicted, const npg_mesh *truth,
                               const npg_metrics_settings *settings, uint64_t frame)
{
    npg_arena scratch = {.purpose = NPG_FOR_QUERY};
    side a, b;
    NPG_REQUIRE(settings->diagonal > 0 && settings->sample_count > 0 && predicted->face_count > 0);
    npg_status status = open_side(&a, &scratch, predicted, settings, frame, SIDE_PREDICTED);
    if (!status) status = open_side(&b, &scratch, truth, settings, frame, SIDE_TRUTH);
    if (!status) status = find_nearest(&a, &scratch, &b);
    if (!status) status = find_nearest(&b, &scratch, &a);
    if (!status) measure(out, &a, &b, settings);
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_metrics_tie(uint32_t **truth_of, const npg_mesh *predicted, const npg_mesh *truth)
{
    float *dist_sq = NULL;
    size_t v = predicted->vert_count;
    npg_status status = npg_alloc_array(truth_of, NPG_FOR_QUERY, v, sizeof **truth_of);
    if (!status) status = npg_alloc_array(&dist_sq, NPG_FOR_QUERY, v, sizeof *dist_sq);
    if (!status)
        status = npg_points_nearest(*truth_of, dist_sq, truth->vert_pos, truth->vert_count,
                                    predicted->vert_pos, v, 1);
    npg_release(&dist_sq);
    if (status) npg_release(truth_of);
    return status;
}

double npg_metrics_drift(const npg_mesh *predicted, const npg_mesh *truth, const uint32_t *truth_of,
                         double diagonal)
{
    double sum = 0;
    for (size_t v = 0; v < predicted->vert_count; v++)
        sum += npg_vec3_distance(predicted->vert_pos + 3 * v, truth->vert_pos + 3 * (size_t)truth_of[v]);
    return sum / (double)predicted->vert_count / diagonal;
}

double npg_points_diagonal(const float *points, size_t point_count)
{
    npg_bounds bounds = npg_bounds_of(points, point_count);
    return npg_bounds_diagonal(&bounds);
}
