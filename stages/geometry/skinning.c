/* Skinning: rotations of the surface, and points through them; points that are tied to it. */
#include "geometry/geometry.h"

#include <string.h>

#include "pipeline/parallel.h"

#define SMOOTHINGS 2 /* of the rotations, over the corners of faces: noise of a face is not its motion */
#define PARTS_MAX  8

struct npg_skin {
    npg_arena arena;       /* of is_border to spread */
    npg_mesh *mesh;        /* counted reference; V, F */
    npg_surface *surface;  /* where it is now */
    uint8_t *is_border;    /* V */
    float *now, *normals;  /* V x 3: positions and normals there */
    float *turns, *spread; /* V x 9: rotation of the neighbourhood, rows */
    bool is_open;          /* there is a border */
    bool is_behind;        /* `surface` is not in the pose yet */
    npg_surface_hit *hits; /* of the points at work; owned */
    size_t hit_capacity;
};

npg_status npg_skin_open(npg_skin **out, npg_mesh *reference)
{
    size_t v = reference->vert_count;
    NPG_TRY(npg_object_open(out, NPG_FOR_MESH, sizeof **out));
    npg_skin *c = *out;
    c->mesh = npg_mesh_ref(reference);
    c->is_border = npg_arena_take(&c->arena, v, 1);
    c->now = npg_arena_take(&c->arena, v, 3 * sizeof *c->now);
    c->normals = npg_arena_take(&c->arena, v, 3 * sizeof *c->normals);
    c->turns = npg_arena_take(&c->arena, v, 9 * sizeof *c->turns);
    c->spread = npg_arena_take(&c->arena, v, 9 * sizeof *c->spread);
    npg_status status = npg_arena_status(&c->arena);
    if (!status) status = npg_mesh_border(c->is_border, &c->is_open, reference);
    if (!status)
        status =
            npg_surface_open(&c->surface, reference->vert_pos, v, reference->faces, reference->face_count);
    if (status) npg_skin_close(out);
    return status;
}

void npg_skin_close(npg_skin **slot)
{
    if (!slot || !*slot) return;
    npg_surface_close(&(*slot)->surface);
    npg_mesh_unref(&(*slot)->mesh);
    npg_release(&(*slot)->hits);
    npg_object_close(slot);
}

bool npg_skin_is_open(const npg_skin *skin)
{
    return skin->is_open;
}

/* ---- rotations ---- */

/* A face's frame as columns: along its first edge, along its normal, and across both. */
static void face_frame(float frame[9], const float *vert_pos, const uint32_t *face)
{
    const float *a = vert_pos + 3 * (size_t)face[0], *b = vert_pos + 3 * (size_t)face[1],
                *c = vert_pos + 3 * (size_t)face[2];
    double along[3], side[3], normal[3], across[3];
    npg_vec3_between(along, a, b);
    npg_vec3_between(side, a, c);
    npg_vec3_cross(normal, along, side);
    npg_vec3_make_unit(along);
    npg_vec3_make_unit(normal);
    npg_vec3_cross(across, along, normal);
    for (int i = 0; i < 3; i++) {
        frame[3 * i] = (float)along[i];
        frame[3 * i + 1] = (float)normal[i];
        frame[3 * i + 2] = (float)across[i];
    }
}

/* turns[corner] += now rest^T, times the face's area at rest. */
static void add_face(const npg_skin *c, const uint32_t *face)
{
    float rest[9], now[9], turn[9];
    float area = (float)npg_face_area(c->mesh->vert_pos, face);
    face_frame(rest, c->mesh->vert_pos, face);
    face_frame(now, c->now, face);
    for (int i = 0; i < 9; i++) {
        turn[i] = 0;
        for (int k = 0; k < 3; k++) turn[i] += now[i / 3 * 3 + k] * rest[i % 3 * 3 + k];
        turn[i] *= area;
    }
    for (int corner = 0; corner < 3; corner++)
        for (int i = 0; i < 9; i++) c->turns[9 * (size_t)face[corner] + (size_t)i] += turn[i];
}

static void smooth_turns(npg_skin *c)
{
    const npg_mesh *mesh = c->mesh;
    memset(c->spread, 0, mesh->vert_count * 9 * sizeof(float));
    for (size_t f = 0; f < mesh->face_count; f++) {
        const uint32_t *face = mesh->faces + 3 * f;
        for (size_t i = 0; i < 9; i++) {
            float sum = 0;
            for (int corner = 0; corner < 3; corner++) sum += c->turns[9 * (size_t)face[corner] + i];
            for (int corner = 0; corner < 3; corner++) c->spread[9 * (size_t)face[corner] + i] += sum;
        }
    }
    float *last = c->turns;
    c->turns = c->spread;
    c->spread = last;
}

void npg_skin_pose(npg_skin *c, const float *vert_unit)
{
    const npg_mesh *mesh = c->mesh;
    memcpy(c->now, vert_unit, mesh->vert_count * 3 * sizeof(float));
    c->is_behind = true;
    npg_mesh_vertex_normals(c->normals, c->now, mesh->vert_count, mesh->faces, mesh->face_count);
    memset(c->turns, 0, mesh->vert_count * 9 * sizeof(float));
    for (size_t f = 0; f < mesh->face_count; f++) add_face(c, mesh->faces + 3 * f);
    for (int i = 0; i < SMOOTHINGS; i++) smooth_turns(c);
}

/* ---- points ---- */

/* Nearly the rotation nearest to a sum of similar ones: its rows made orthonormal (Gram and Schmidt). */
static void straighten(float m[9])
{
    npg_vec3_make_unitf(m);
    float along = npg_vec3_dotf(m, m + 3);
    for (int i = 0; i < 3; i++) m[3 + i] -= along * m[i];
    npg_vec3_make_unitf(m + 3);
    m[6] = m[1] * m[5] - m[2] * m[4];
    m[7] = m[2] * m[3] - m[0] * m[5];
    m[8] = m[0] * m[4] - m[1] * m[3];
}

static void turn_back(float out[3], const float turn[9], const float v[3])
{
    for (int i = 0; i < 3; i++) out[i] = turn[i] * v[0] + turn[3 + i] * v[1] + turn[6 + i] * v[2];
}

static void to_rest(npg_skinned *out, const npg_skin *c, const npg_surface_hit *hit, const float *point,
                    const float *normal)
{
    float now[3], facing_now[3], turn[9], away[3];
    npg_hit_blend(now, hit, c->mesh->faces, c->now, 3);
    npg_hit_blend(facing_now, hit, c->mesh->faces, c->normals, 3);
    npg_hit_blend(turn, hit, c->mesh->faces, c->turns, 9);
    npg_hit_blend(out->foot, hit, c->mesh->faces, c->mesh->vert_pos, 3);
    npg_hit_blend(out->facing, hit, c->mesh->faces, c->mesh->vert_normals, 3);
    npg_vec3_make_unitf(facing_now);
    npg_vec3_make_unitf(out->facing);
    straighten(turn);
    for (int i = 0; i < 3; i++) away[i] = point[i] - now[i];
    turn_back(out->point, turn, away);
    for (int i = 0; i < 3; i++) out->point[i] += out->foot[i];
    out->dist = npg_vec3_lengthf(away);
    out->offset = npg_vec3_dotf(away, facing_now);
    out->is_beyond = npg_hit_on_border(hit, c->mesh->faces + 3 * (size_t)hit->face, c->is_border);
    out->agreement = normal ? npg_vec3_dotf(normal, facing_now) : 1;
    if (normal)
        turn_back(out->normal, turn, normal);
    else
        memcpy(out->normal, out->facing, sizeof out->normal);
}

typedef struct batch {
    npg_skin *c;
    npg_skinned *out;
    const float *points, *normals;
    size_t count, parts;
} batch;

static npg_status part_to_rest(void *user, size_t part)
{
    const batch *w = user;
    for (size_t i = part * w->count / w->parts; i < (part + 1) * w->count / w->parts; i++)
        to_rest(&w->out[i], w->c, &w->c->hits[i], w->points + 3 * i, w->normals ? w->normals + 3 * i : NULL);
    return NPG_OK;
}

npg_status npg_skin_to_rest(npg_skin *c, npg_skinned *out, const float *points, const float *normals,
                            size_t count)
{
    NPG_REQUIRE(c->mesh->vert_normals);
    NPG_TRY(npg_grow(&c->hits, &c->hit_capacity, count, sizeof *c->hits, NPG_FOR_MESH));
    if (c->is_behind) NPG_TRY(npg_surface_move(c->surface, c->now));
    c->is_behind = false;
    NPG_TRY(npg_surface_closest(c->surface, c->hits, points, count));
    batch w = {c, out, points, normals, count, npg_parallel_parts(count, 1000, PARTS_MAX)};
    return npg_parallel(part_to_rest, &w, w.parts);
}

/* out += turn v. */
static void add_turned(float out[3], const float turn[9], const float v[3])
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) out[i] += turn[3 * i + k] * v[k];
}

/* from_rest, and the rotation there. */
static void carry(const npg_skin *c, float now[3], float turn[9], const npg_surface_hit *hit,
                  const float place[3])
{
    float rest[3], away[3];
    npg_hit_blend(rest, hit, c->mesh->faces, c->mesh->vert_pos, 3);
    npg_hit_blend(now, hit, c->mesh->faces, c->now, 3);
    npg_hit_blend(turn, hit, c->mesh->faces, c->turns, 9);
    straighten(turn);
    for (int k = 0; k < 3; k++) away[k] = place[k] - rest[k];
    add_turned(now, turn, away);
}

void npg_skin_from_rest(const npg_skin *c, float now[3], const npg_surface_hit *hit, const float place[3])
{
    float turn[9];
    carry(c, now, turn, hit, place);
}

/* Positions, normals, rotations twice, Embree's tree (about 100 bytes a face, two faces a vertex); hits. */
size_t npg_skin_memory(size_t vert_count, size_t points)
{
    return vert_count * (24 * sizeof(float) + 200) + points * (sizeof(npg_surface_hit) + sizeof(npg_skinned));
}

/* ---- tied points ---- */

struct npg_attachment {
    npg_arena arena; /* of the arrays */
    npg_skin *skin;
    size_t point_count;      /* N                            */
    npg_surface_hit *at;     /* N: face, weights, distance²  */
    float *points, *normals; /* N x 3, at rest; normals or NULL */
};

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
static npg_status tie_by_rays(npg_attachment *t, const uint32_t *wrong, size_t wrong_count, float reach)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    npg_ray *rays = npg_arena_take(&scratch, 2 * wrong_count, sizeof *rays);
    npg_ray_hit *hits = npg_arena_take(&scratch, 2 * wrong_count, sizeof *hits);
    npg_status status = npg_arena_status(&scratch);
    for (size_t i = 0; i < 2 * wrong_count && !status; i++) {
        rays[i] = (npg_ray){.t_max = reach};
        for (size_t a = 0; a < 3; a++) {
            rays[i].origin[a] = t->points[3 * wrong[i / 2] + a];
            rays[i].direction[a] = (i % 2 ? -1 : 1) * t->normals[3 * wrong[i / 2] + a];
        }
    }
    if (!status) status = npg_surface_rays(t->skin->surface, hits, rays, 2 * wrong_count, 0);
    for (size_t i = 0; i < 2 * wrong_count && !status; i++) {
        const npg_ray_hit *hit = &hits[i];
        const float *normal = t->normals + 3 * wrong[i / 2];
        npg_surface_hit *at = &t->at[wrong[i / 2]];
        if (hit->face == UINT32_MAX || !looks_along(t->skin->mesh, hit->face, normal)) continue;
        if (looks_along(t->skin->mesh, at->face, normal) && hit->t * hit->t >= at->dist_sq) continue;
        *at = (npg_surface_hit){.face = hit->face, .dist_sq = hit->t * hit->t};
        memcpy(at->weights, hit->weights, sizeof at->weights);
    }
    npg_arena_release(&scratch);
    return status;
}

static npg_status tie_to_right_sides(npg_attachment *t)
{
    uint32_t *wrong;
    size_t wrong_count = 0;
    NPG_TRY(npg_alloc_array(&wrong, NPG_FOR_MESH, t->point_count, sizeof *wrong));
    for (size_t i = 0; i < t->point_count; i++)
        if (!looks_along(t->skin->mesh, t->at[i].face, t->normals + 3 * i))
            wrong[wrong_count++] = (uint32_t)i;
    float reach =
        (float)(NPG_ATTACH_REACH * npg_points_diagonal(t->skin->mesh->vert_pos, t->skin->mesh->vert_count));
    npg_status status = wrong_count ? tie_by_rays(t, wrong, wrong_count, reach) : NPG_OK;
    npg_release(&wrong);
    return status;
}

static npg_status tie_points(npg_attachment *t)
{
    NPG_TRY(npg_surface_closest(t->skin->surface, t->at, t->points, t->point_count));
    for (size_t i = 0; i < t->point_count; i++)
        if (t->at[i].face == UINT32_MAX) return npg_error(NPG_BAD_INPUT, "point %zu is not finite", i);
    return t->normals ? tie_to_right_sides(t) : NPG_OK;
}

npg_status npg_attach_open(npg_attachment **out, npg_mesh *rest, const float *points, const float *normals,
                           size_t point_count)
{
    NPG_REQUIRE(out);
    *out = NULL;
    NPG_REQUIRE(rest && rest->face_count && (points || !point_count) && point_count < UINT32_MAX);
    NPG_TRY(npg_object_open(out, NPG_FOR_MESH, sizeof **out));
    npg_attachment *t = *out;
    t->point_count = point_count;
    t->at = npg_arena_take(&t->arena, point_count, sizeof *t->at);
    t->points = npg_arena_copy(&t->arena, points, point_count, 3 * sizeof *t->points);
    if (normals) t->normals = npg_arena_copy(&t->arena, normals, point_count, 3 * sizeof *t->normals);
    npg_status status = npg_arena_status(&t->arena);
    if (!status) status = npg_skin_open(&t->skin, rest);
    if (!status) status = tie_points(t);
    if (status) npg_attach_close(out);
    return status;
}

void npg_attach_close(npg_attachment **slot)
{
    if (*slot) npg_skin_close(&(*slot)->skin);
    npg_object_close(slot);
}

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
    NPG_REQUIRE(vert_pos && (pos || !t->point_count) && (!normals || t->normals));
    npg_skin_pose(t->skin, vert_pos);
    for (size_t i = 0; i < t->point_count; i++) {
        float now[3], turn[9], normal[3] = {0, 0, 0};
        carry(t->skin, now, turn, &t->at[i], t->points + 3 * i);
        for (size_t a = 0; a < 3; a++) pos[3 * i + a] = (double)now[a];
        if (!normals) continue;
        add_turned(normal, turn, t->normals + 3 * i);
        memcpy(normals + 3 * i, normal, sizeof normal);
    }
    return NPG_OK;
}
