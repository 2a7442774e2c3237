/* Poisson: checks, child process, checks. */
#include "mesh/mesh_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "mesh/poisson_wire.h"
#include "outlier/normals.h"
#include "pipeline/child.h"
#include "pipeline/frame_box.h"

/* ---- before ---- */

static npg_status check_finite(const float *points, const float *normals, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const float *p = points + 3 * i, *d = normals + 3 * i;
        if (!isfinite(p[0] + p[1] + p[2])) return npg_error(NPG_BAD_INPUT, "point %zu is not finite", i);
        float length_sq = npg_vec3_dotf(d, d);
        if (!(fabsf(length_sq - 1) < 0.01f))
            return npg_error(NPG_BAD_INPUT, "the normal of point %zu has length %g instead of 1", i,
                             sqrt((double)length_sq));
    }
    return NPG_OK;
}

/* Normals of a closed surface, or of one seen from one side, span space;
 * those of a plane are all parallel. */
static npg_status check_spread(const float *normals, size_t n)
{
    double parallel = 0;
    const float *first = normals;
    for (size_t i = 0; i < n; i++) {
        double d = 0;
        for (int a = 0; a < 3; a++) {
            d += (double)normals[3 * i + (size_t)a] * (double)first[a];
        }
        parallel += fabs(d) > 0.9999;
    }
    if (parallel < 0.999 * (double)n) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "all normals are parallel: the points lie on one plane");
}

static npg_status check_extent(const float *points, size_t n)
{
    if (!(npg_points_diagonal(points, n) > 0))
        return npg_error(NPG_BAD_INPUT, "all %zu points are in one place", n);
    return NPG_OK;
}

/* How many normals point against those around them. */
static size_t count_against(const float *normals, const uint32_t *index, size_t n)
{
    size_t against = 0;
    for (size_t i = 0; i < n; i++) {
        double vote = 0;
        for (size_t k = 0; k <= NPG_AROUND; k++) {
            uint32_t j = index[(NPG_AROUND + 1) * i + k];
            if (j == UINT32_MAX || j == i) continue;
            double cosine = (double)npg_vec3_dotf(normals + 3 * i, normals + 3 * (size_t)j);
            vote += cosine * fabs(cosine);
        }
        against += vote < 0;
    }
    return against;
}

/* Share of points whose normal points against most of those of its near neighbours on the same sheet, 0..1. */
static npg_status disagreement_of(double *share, const float *points, const float *normals, size_t n)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    npg_neighbours near;
    npg_status status = npg_neighbours_take(&near, &scratch, points, n, points, n, NPG_AROUND + 1);
    if (!status) *share = (double)count_against(normals, near.index, n) / (double)n;
    npg_arena_release(&scratch);
    return status;
}

static npg_status check_points(const float *points, const float *normals, size_t point_count)
{
    double share;
    if (point_count < NPG_PATCH)
        return npg_error(NPG_BAD_INPUT, "%zu points are too few for a surface, it takes %d", point_count,
                         NPG_PATCH);
    NPG_TRY(check_finite(points, normals, point_count));
    NPG_TRY(check_extent(points, point_count));
    NPG_TRY(check_spread(normals, point_count));
    NPG_TRY(disagreement_of(&share, points, normals, point_count));
    if (share > 1 - NPG_MOST) /* alternating normals have 0.5, a good cloud below 0.01 */
        return npg_error(NPG_BAD_INPUT,
                         "the normals contradict each other: %.1f %% point against their neighbours",
                         100 * share);
    return NPG_OK;
}

/* ---- the child's answer ---- */

static npg_status unpack(npg_mesh **out, const npg_child_result *answer)
{
    npg_poisson_reply reply;
    size_t size = answer->output_size;
    if (size < sizeof reply + 8) return npg_error(NPG_FAILED, "Poisson: the answer has only %zu bytes", size);
    memcpy(&reply, answer->output, sizeof reply);
    bool fits = !memcmp(reply.magic, NPG_POISSON_ANSWER, 8) && reply.vert_count < size &&
                reply.face_count < size &&
                size == sizeof reply + 12 * (reply.vert_count + reply.face_count) + 8 &&
                !memcmp(answer->output + size - 8, NPG_POISSON_END, 8);
    if (!fits) return npg_error(NPG_FAILED, "Poisson: the answer of %zu bytes is not whole", size);
    if (!reply.face_count) return npg_error(NPG_FAILED, "Poisson: the mesh is empty");
    NPG_TRY(npg_mesh_open(out, reply.vert_count, reply.face_count));
    const uint8_t *at = answer->output + sizeof reply;
    memcpy((*out)->vert_pos, at, 12 * reply.vert_count);
    memcpy((*out)->faces, at + 12 * reply.vert_count, 12 * reply.face_count);
    return NPG_OK;
}

static npg_status ask(npg_mesh **out, const float *rows, size_t point_count,
                      const npg_poisson_settings *settings)
{
    npg_poisson_request request = {.point_count = point_count,
                                   .memory_limit = settings->memory_limit,
                                   .cpu_limit_s =
                                       (uint64_t)(NPG_POISSON_THREADS * settings->time_limit_s) + 1,
                                   .depth = (uint32_t)settings->depth,
                                   .point_weight = (float)settings->point_weight};
    memcpy(request.magic, NPG_POISSON_ASK, 8);
    npg_child_job job = {.program = settings->program ? settings->program : "neupig-poisson",
                         .input = {&request, rows},
                         .input_size = {sizeof request, point_count * 6 * sizeof(float)},
                         .output_max = (size_t)4 << 30,
                         .time_limit_s = settings->time_limit_s,
                         .should_stop = settings->should_stop,
                         .user = settings->user};
    npg_child_result answer;
    NPG_TRY(npg_child_run(&answer, &job));
    npg_status status = unpack(out, &answer);
    npg_release(&answer.output);
    return status;
}

/* ---- after ---- */

static npg_status check_numbers(const npg_mesh *mesh)
{
    for (size_t i = 0; i < 3 * mesh->vert_count; i++)
        if (!isfinite(mesh->vert_pos[i]))
            return npg_error(NPG_FAILED, "Poisson: vertex %zu is not finite", i / 3);
    for (size_t i = 0; i < 3 * mesh->face_count; i++)
        if (mesh->faces[i] >= mesh->vert_count)
            return npg_error(NPG_FAILED, "Poisson: face %zu uses vertex %u of %zu", i / 3, mesh->faces[i],
                             mesh->vert_count);
    return NPG_OK;
}

static npg_status check_box(const npg_mesh *mesh, const float *points, size_t point_count)
{
    double growth =
        npg_points_diagonal(mesh->vert_pos, mesh->vert_count) / npg_points_diagonal(points, point_count);
    if (growth > NPG_WITHIN || growth < 0.5)
        return npg_error(NPG_FAILED, "Poisson: the mesh's box has %.2f times the diagonal of the points' box",
                         growth);
    return NPG_OK;
}

/* Area share of the largest component: garbage comes in many pieces. */
static npg_status check_pieces(const npg_mesh *mesh)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    double total = 0, largest = 0;
    size_t count = 0, v = mesh->vert_count;
    uint32_t *component_of = npg_arena_take(&scratch, v, sizeof *component_of);
    double *area = npg_arena_take(&scratch, v, sizeof *area); /* there are no more pieces than vertices */
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_mesh_components(component_of, &count, v, mesh->faces, mesh->face_count);
    for (size_t f = 0; f < mesh->face_count && !status; f++) {
        double face_area = npg_face_area(mesh->vert_pos, mesh->faces + 3 * f);
        total += face_area;
        area[component_of[mesh->faces[3 * f]]] += face_area;
    }
    for (size_t i = 0; i < count && !status; i++) largest = fmax(largest, area[i]);
    npg_arena_release(&scratch);
    if (status) return status;
    if (!(total > 0)) return npg_error(NPG_FAILED, "Poisson: the mesh has no area");
    if (largest < NPG_MAJORITY * total)
        return npg_error(NPG_FAILED,
                         "Poisson: the mesh is in %zu pieces, the largest has %.0f %% of the area", count,
                         100 * largest / total);
    return NPG_OK;
}

/* A closed surface has no border; PCL leaves a few open edges where the solution meets the box. */
static npg_status check_closed(const npg_mesh *mesh)
{
    npg_manifold m;
    NPG_TRY(npg_mesh_manifold(&m, mesh));
    if (m.border_edges + m.crowded_edges > m.edge_count / 20)
        return npg_error(NPG_FAILED, "Poisson: %zu of %zu edges are open and %zu have more than two faces",
                         m.border_edges, m.edge_count, m.crowded_edges);
    if (!m.border_edges && !(npg_mesh_volume(mesh) > 0))
        return npg_error(NPG_FAILED, "Poisson: the mesh is inside out (the normals point inward?)");
    return NPG_OK;
}

static npg_status check_mesh(const npg_mesh *mesh, const float *points, size_t point_count)
{
    NPG_TRY(check_numbers(mesh));
    NPG_TRY(check_box(mesh, points, point_count));
    NPG_TRY(check_pieces(mesh));
    return check_closed(mesh);
}

npg_status npg_poisson(npg_mesh **out, const float *points, const float *normals, size_t point_count,
                       const npg_poisson_settings *settings)
{
    float *rows;
    npg_mesh *mesh = NULL;
    *out = NULL;
    NPG_TRY(check_points(points, normals, point_count));
    NPG_TRY(npg_alloc_array(&rows, NPG_FOR_MESH, point_count, 6 * sizeof *rows));
    for (size_t i = 0; i < point_count; i++) {
        memcpy(rows + 6 * i, points + 3 * i, 3 * sizeof *rows);
        memcpy(rows + 6 * i + 3, normals + 3 * i, 3 * sizeof *rows);
    }
    npg_status status = ask(&mesh, rows, point_count, settings);
    npg_release(&rows);
    if (!status) status = check_mesh(mesh, points, point_count);
    if (status) npg_mesh_unref(&mesh);
    *out = mesh;
    return status;
}
