/* Attach: points tied to a surface by weights in a face and an offset that turns with it. */
#include "geometry/geometry.h"

#include <math.h>
#include <string.h>

struct npg_attachment {
    npg_mesh *rest;      /* reference held               */
    npg_arena arena;     /* of the arrays                */
    size_t point_count;  /* N                            */
    npg_surface_hit *at; /* N: face, weights, distance²  */
    float *offset;       /* N x 3: p - c at rest         */
    float *normals;      /* N x 3 or NULL                */
    float *rest_normals; /* V x 3                        */
    float *now_normals;  /* V x 3: of the pose under way */
};

/* sum w_k rows[face_k] */
static void interpolate(double out[3], const float *rows, const uint32_t *face, const float weights[3])
{
    for (size_t a = 0; a < 3; a++) {
        out[a] = 0;
        for (size_t k = 0; k < 3; k++) out[a] += (double)weights[k] * (double)rows[3 * face[k] + a];
    }
}

/* ---- the frame of a place on the surface ---- */

typedef struct local_frame {
    double axes[3][3];    /* two tangents and the normal, orthonormal and right-handed     */
    double corners[3][2]; /* of the face around their middle, in the plane of the tangents */
} local_frame;

static void face_corners(local_frame *frame, const float *vert_pos, const uint32_t *face)
{
    const float third[3] = {1 / 3.0f, 1 / 3.0f, 1 / 3.0f};
    double middle[3];
    interpolate(middle, vert_pos, face, third);
    for (int k = 0; k < 3; k++) {
        double d[3];
        for (size_t a = 0; a < 3; a++) d[a] = (double)vert_pos[3 * face[k] + a] - middle[a];
        for (int i = 0; i < 2; i++) frame->corners[k][i] = npg_vec3_dot(d, frame->axes[i]);
    }
}

/* Which tangents they are does not matter: rotation_between() fits the angle between those of two frames. */
static void set_frame(local_frame *frame, const float *vert_pos, const float *vert_normals,
                      const uint32_t *face, const float weights[3])
{
    double *normal = frame->axes[2];
    interpolate(normal, vert_normals, face, weights);
    if (!npg_vec3_make_unit(normal))
        for (size_t a = 0; a < 3; a++) normal[a] = (double)vert_normals[3 * face[0] + a];
    npg_vec3_span_plane(frame->axes[0], frame->axes[1], normal);
    face_corners(frame, vert_pos, face);
}

/* The rotation (rows) from one frame into another.  In the plane of the tangents it is the angle that brings
 * the corners p closest to q: its tangent is sum p x q / sum p . q. */
static void rotation_between(double turn[3][3], const local_frame *from, const local_frame *to)
{
    double along = 0, across = 0, tangents[2][3];
    for (int k = 0; k < 3; k++) {
        const double *p = from->corners[k], *q = to->corners[k];
        along += p[0] * q[0] + p[1] * q[1];
        across += p[0] * q[1] - p[1] * q[0];
    }
    double length = hypot(along, across);
    double c = length > 0 ? along / length : 1, s = length > 0 ? across / length : 0;
    for (int a = 0; a < 3; a++) {
        tangents[0][a] = c * to->axes[0][a] + s * to->axes[1][a];
        tangents[1][a] = c * to->axes[1][a] - s * to->axes[0][a];
    }
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            turn[a][b] = tangents[0][a] * from->axes[0][b] + tangents[1][a] * from->axes[1][b] +
                         to->axes[2][a] * from->axes[2][b];
}

static double rotated(const double turn[3][3], int a, const float v[3])
{
    return turn[a][0] * (double)v[0] + turn[a][1] * (double)v[1] + turn[a][2] * (double)v[2];
}

/* ---- tying ---- */

/* Whether a face looks to the side of a normal. */
static bool looks_along(const npg_mesh *rest, uint32_t face_number, const float *normal)
{
    const uint32_t *face = rest->faces + 3 * face_number;
    double out[3], n[3] = {(double)normal[0], (double)normal[1], (double)normal[2]};
    npg_face_cross(out, rest->vert_pos, face);
    return npg_vec3_dot(out, n) >= 0;
}

/* Two rays from every such point, along its normal and against it; the nearer face
 * that looks its way wins. */
static npg_status tie_by_rays(npg_attachment *t, const npg_surface *surface, const float *points,
                              const uint32_t *wrong, size_t wrong_count, float reach)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    npg_ray *rays = npg_arena_take(&scratch, 2 * wrong_count, sizeof *rays);
    npg_ray_hit *hits = npg_arena_take(&scratch, 2 * wrong_count, sizeof *hits);
    npg_status status = npg_arena_status(&scratch);
    for (size_t i = 0; i < 2 * wrong_count && !status; i++) {
        rays[i] = (npg_ray){.t_max = reach};
        for (size_t a = 0; a < 3; a++) {
            rays[i].origin[a] = points[3 * wrong[i / 2] + a];
            rays[i].direction[a] = (i % 2 ? -1 : 1) * t->normals[3 * wrong[i / 2] + a];
        }
    }
    if (!status) status = npg_surface_rays(surface, hits, rays, 2 * wrong_count, 0);
    for (size_t i = 0; i < 2 * wrong_count && !status; i++) {
        const npg_ray_hit *hit = &hits[i];
        const float *normal = t->normals + 3 * wrong[i / 2];
        npg_surface_hit *at = &t->at[wrong[i / 2]];
        if (hit->face == UINT32_MAX || !looks_along(t->rest, hit->face, normal)) continue;
        if (looks_along(t->rest, at->face, normal) && hit->t * hit->t >= at->dist_sq) continue;
        *at = (npg_surface_hit){.face = hit->face, .dist_sq = hit->t * hit->t};
        memcpy(at->weights, hit->weights, sizeof at->weights);
    }
    npg_arena_release(&scratch);
    return status;
}

static npg_status tie_to_right_sides(npg_attachment *t, const npg_surface *surface, const float *points)
{
    uint32_t *wrong;
    size_t wrong_count = 0;
    NPG_TRY(npg_alloc_array(&wrong, NPG_FOR_MESH, t->point_count, sizeof *wrong));
    for (size_t i = 0; i < t->point_count; i++)
        if (!looks_along(t->rest, t->at[i].face, t->normals + 3 * i)) wrong[wrong_count++] = (uint32_t)i;
    float reach = (float)(NPG_ATTACH_REACH * npg_points_diagonal(t->rest->vert_pos, t->rest->vert_count));
    npg_status status = wrong_count ? tie_by_rays(t, surface, points, wrong, wrong_count, reach) : NPG_OK;
    npg_release(&wrong);
    return status;
}

static npg_status tie_points(npg_attachment *t, const float *points)
{
    const npg_mesh *rest = t->rest;
    npg_surface *surface = NULL;
    NPG_TRY(npg_surface_open(&surface, rest->vert_pos, rest->vert_count, rest->faces, rest->face_count));
    npg_status status = npg_surface_closest(surface, t->at, points, t->point_count);
    for (size_t i = 0; i < t->point_count && !status; i++)
        if (t->at[i].face == UINT32_MAX) status = npg_error(NPG_BAD_INPUT, "point %zu is not finite", i);
    if (!status && t->normals) status = tie_to_right_sides(t, surface, points);
    npg_surface_close(&surface);
    for (size_t i = 0; i < t->point_count && !status; i++) {
        double closest[3];
        interpolate(closest, rest->vert_pos, rest->faces + 3 * t->at[i].face, t->at[i].weights);
        for (size_t a = 0; a < 3; a++) t->offset[3 * i + a] = (float)((double)points[3 * i + a] - closest[a]);
    }
    return status;
}

npg_status npg_attach_open(npg_attachment **out, npg_mesh *rest, const float *points, const float *normals,
                           size_t point_count)
{
    npg_attachment *t;
    NPG_REQUIRE(out);
    *out = NULL;
    NPG_REQUIRE(rest && rest->face_count && (points || !point_count) && point_count < UINT32_MAX);
    NPG_TRY(npg_alloc(&t, NPG_FOR_MESH, sizeof *t));
    t->rest = npg_mesh_ref(rest);
    t->point_count = point_count;
    t->arena.purpose = NPG_FOR_MESH;
    t->at = npg_arena_take(&t->arena, point_count, sizeof *t->at);
    t->offset = npg_arena_take(&t->arena, point_count, 3 * sizeof *t->offset);
    t->rest_normals = npg_arena_take(&t->arena, rest->vert_count, 3 * sizeof *t->rest_normals);
    t->now_normals = npg_arena_take(&t->arena, rest->vert_count, 3 * sizeof *t->now_normals);
    if (normals) t->normals = npg_arena_copy(&t->arena, normals, point_count, 3 * sizeof *t->normals);
    npg_status status = npg_arena_status(&t->arena);
    if (!status)
        npg_mesh_vertex_normals(t->rest_normals, rest->vert_pos, rest->vert_count, rest->faces,
                                rest->face_count);
    if (!status && point_count) status = tie_points(t, points);
    if (status) npg_attach_close(&t);
    *out = t;
    return status;
}

void npg_attach_close(npg_attachment **slot)
{
    if (!*slot) return;
    npg_mesh_unref(&(*slot)->rest);
    npg_arena_release(&(*slot)->arena);
    npg_release(slot);
}

/* ---- use ---- */

void npg_attach_far(const npg_attachment *t, double dist, size_t *far_count, size_t *worst,
                    double *worst_dist)
{
    *far_count = *worst = 0;
    *worst_dist = 0;
    for (size_t i = 0; i < t->point_count; i++) {
        double d = sqrt((double)t->at[i].dist_sq);
        *far_count += d > dist;
        if (d <= *worst_dist) continue;
        *worst = i;
        *worst_dist = d;
    }
}

npg_status npg_attach_move(npg_attachment *t, const float *vert_pos, double *pos, float *normals)
{
    const npg_mesh *rest = t->rest;
    NPG_REQUIRE(vert_pos && (pos || !t->point_count) && (!normals || t->normals));
    npg_mesh_vertex_normals(t->now_normals, vert_pos, rest->vert_count, rest->faces, rest->face_count);
    for (size_t i = 0; i < t->point_count; i++) {
        const uint32_t *face = rest->faces + 3 * t->at[i].face;
        const float *weights = t->at[i].weights;
        local_frame before, now;
        double turn[3][3];
        set_frame(&before, rest->vert_pos, t->rest_normals, face, weights);
        set_frame(&now, vert_pos, t->now_normals, face, weights);
        rotation_between(turn, &before, &now);
        interpolate(pos + 3 * i, vert_pos, face, weights);
        for (int a = 0; a < 3; a++) {
            pos[3 * i + (size_t)a] += rotated(turn, a, t->offset + 3 * i);
            if (normals) normals[3 * i + (size_t)a] = (float)rotated(turn, a, t->normals + 3 * i);
        }
    }
    return NPG_OK;
}
