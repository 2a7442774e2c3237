/* Synthetic bodies: a closed surface and its exact motion; some change their topology once. */
#include "tools/synth/synth.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"

#define PI 3.14159265358979323846

struct npg_body {
    int kind;
    bool is_changed;
    npg_mesh *rest;
    float *weights; /* V x NPG_BONES, rows sum to 1; walking figures only */
    bool is_welded; /* the surface at rest lies in the pose `weld`        */
    npg_bone_pose weld[NPG_BONES];
    size_t bar_verts; /* the ball's come after them */
};

/* ---- skin of the walker ---- */

/* Every vertex begins with its nearest bone; then the weights spread over the surface (never through the air
 * between two limbs) as heat would, over about `reach` metres. */
static npg_status open_weights(npg_body *body, double cell)
{
    const double reach = 0.07; /* metres over which elbows and knees bend; set by eye */
    const npg_mesh *rest = body->rest;
    size_t edge_count, size = rest->vert_count * NPG_BONES;
    uint32_t(*edges)[2];
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    int rounds =
        (int)ceil(reach * reach / (cell * cell)); /* a round carries heat one cell, n rounds sqrt(n) */
    NPG_TRY(npg_alloc_array(&body->weights, NPG_FOR_MESH, size, sizeof(float)));
    NPG_TRY(npg_mesh_edges(&edges, &edge_count, rest->faces, rest->face_count));
    float *next = npg_arena_take(&scratch, size, sizeof *next);
    float *degree = npg_arena_take(&scratch, rest->vert_count, sizeof *degree);
    npg_status status = npg_arena_status(&scratch);
    for (size_t v = 0; v < rest->vert_count && !status; v++) {
        const float *p = rest->vert_pos + 3 * v;
        int bone = npg_walker_nearest_bone((double[3]){(double)p[0], (double)p[1], (double)p[2]},
                                           body->is_welded ? body->weld : NULL);
        body->weights[v * NPG_BONES + (size_t)bone] = 1;
    }
    for (size_t e = 0; e < edge_count && !status; e++) {
        degree[edges[e][0]] += 1;
        degree[edges[e][1]] += 1;
    }
    for (int round = 0; round < rounds && !status; round++) {
        memset(next, 0, size * sizeof *next);
        for (size_t e = 0; e < edge_count; e++)
            for (int end = 0; end < 2; end++) {
                size_t to = edges[e][end] * (size_t)NPG_BONES, from = edges[e][!end] * (size_t)NPG_BONES;
                for (int b = 0; b < NPG_BONES; b++) next[to + (size_t)b] += body->weights[from + (size_t)b];
            }
        for (size_t i = 0; i < size; i++)
            body->weights[i] = 0.5f * body->weights[i] + 0.5f * next[i] / degree[i / NPG_BONES];
    }
    npg_arena_release(&scratch);
    npg_release(&edges);
    return status;
}

/* The hand leaves the hip within so many frames. */
#define FRAMES_TO_LEAVE 5

static double share_at_hip(const npg_body *body, double since)
{
    if (body->kind != NPG_BODY_HANDS) return -1;
    return body->is_changed ? fmax(1 - (since + 1) / FRAMES_TO_LEAVE, 0) : 1;
}

static void pose_walker(const npg_body *body, float *vert_pos, const npg_moment *moment)
{
    npg_bone_pose bones[NPG_BONES];
    npg_walker_pose(bones, moment->phase, moment->travel, share_at_hip(body, moment->since));
    for (int b = 0; b < NPG_BONES && body->is_welded; b++) {
        const npg_bone_pose motion = bones[b];
        npg_bone_between(&bones[b], &body->weld[b], &motion);
    }
    for (size_t v = 0; v < body->rest->vert_count; v++) {
        const float *p = body->rest->vert_pos + 3 * v, *weights = body->weights + v * NPG_BONES;
        double moved[3] = {0}, sum = 0;
        for (int b = 0; b < NPG_BONES; b++) {
            double weight = (double)weights[b];
            sum += weight;
            for (int k = 0; k < 3 && weight > 0; k++) {
                const double *row = bones[b].rotation + 3 * k;
                moved[k] += weight * (row[0] * (double)p[0] + row[1] * (double)p[1] + row[2] * (double)p[2] +
                                      bones[b].shift[k]);
            }
        }
        for (int k = 0; k < 3; k++) vert_pos[3 * v + k] = (float)(moved[k] / sum);
    }
}

/* ---- bar: 2 m along y, rounded edges; bends in an arc and twists ---- */

static const double bar_half[3] = {0.18, 1.0, 0.12}, bar_radius = 0.05;

static double bar_distance(const double p[3], const void *user)
{
    double outside_sq = 0, inside = -INFINITY;
    (void)user;
    for (int k = 0; k < 3; k++) {
        double d = fabs(p[k]) - bar_half[k] + bar_radius;
        outside_sq += d > 0 ? d * d : 0;
        inside = fmax(inside, d);
    }
    return sqrt(outside_sq) + fmin(inside, 0) - bar_radius;
}

static void pose_bar(const npg_body *body, float *vert_pos, double phase)
{
    double curvature = 1.1 * sin(2 * PI * phase), twist = 0.35 * sin(4 * PI * phase);
    for (size_t v = 0; v < body->bar_verts; v++) {
        const float *p = body->rest->vert_pos + 3 * v;
        double y = (double)p[1], turn = twist * y, angle = curvature * y;
        double x = cos(turn) * (double)p[0] + sin(turn) * (double)p[2];
        double z = -sin(turn) * (double)p[0] + cos(turn) * (double)p[2];
        /* The middle line is an arc of that curvature through the origin;
         * (1 - cos a) / k without dividing by 0. */
        double half = 0.5 * angle, ratio = fabs(half) < 1e-9 ? 1 : sin(half) / half;
        double line_x = y * ratio * sin(half), line_y = y * ratio * cos(half);
        vert_pos[3 * v] = (float)(line_x + x * cos(angle));
        vert_pos[3 * v + 1] = (float)(line_y - x * sin(angle));
        vert_pos[3 * v + 2] = (float)z;
    }
}

/* ---- the ball that comes to the bar, or leaves it ---- */

static const double ball_radius = 0.22;

static double ball_distance(const double p[3], const void *user)
{
    (void)user;
    return npg_vec3_length(p) - ball_radius;
}

/* It rolls along in front of the bar, out of reach of its bending. */
static void pose_ball(const npg_body *body, float *vert_pos, double since)
{
    const double shift[3] = {0.1, -0.5 + 0.03 * since, 0.55};
    for (size_t v = body->bar_verts; v < body->rest->vert_count; v++)
        for (size_t k = 0; k < 3; k++)
            vert_pos[3 * v + k] = (float)((double)body->rest->vert_pos[3 * v + k] + shift[k]);
}

static npg_status join(npg_mesh **joined, const npg_mesh *a, const npg_mesh *b)
{
    NPG_TRY(npg_mesh_open(joined, a->vert_count + b->vert_count, a->face_count + b->face_count));
    npg_mesh *mesh = *joined;
    memcpy(mesh->vert_pos, a->vert_pos, a->vert_count * 3 * sizeof(float));
    memcpy(mesh->vert_pos + 3 * a->vert_count, b->vert_pos, b->vert_count * 3 * sizeof(float));
    memcpy(mesh->faces, a->faces, a->face_count * 3 * sizeof *mesh->faces);
    for (size_t i = 0; i < 3 * b->face_count; i++)
        mesh->faces[3 * a->face_count + i] = b->faces[i] + (uint32_t)a->vert_count;
    return NPG_OK;
}

static npg_status open_bar(npg_body *body, double cell)
{
    static const double lo[3] = {-0.3, -1.1, -0.25}, hi[3] = {0.3, 1.1, 0.25};
    static const double ball_lo[3] = {-0.3, -0.3, -0.3}, ball_hi[3] = {0.3, 0.3, 0.3};
    npg_mesh *ball = NULL, *bar = NULL;
    NPG_TRY(npg_body_mesh(&body->rest, bar_distance, NULL, lo, hi, cell));
    body->bar_verts = body->rest->vert_count;
    bool has_ball = body->kind == (body->is_changed ? NPG_BODY_TWO : NPG_BODY_GONE);
    if (!has_ball) return NPG_OK;
    NPG_TRY(npg_body_mesh(&ball, ball_distance, NULL, ball_lo, ball_hi, cell));
    bar = body->rest;
    body->rest = NULL;
    npg_status status = join(&body->rest, bar, ball);
    npg_mesh_unref(&bar);
    npg_mesh_unref(&ball);
    return status;
}

/* ---- any body ---- */

bool npg_body_changes(int kind)
{
    return kind == NPG_BODY_HANDS || kind == NPG_BODY_TWO || kind == NPG_BODY_GONE;
}

static bool is_walking(const npg_body *body)
{
    return body->kind == NPG_BODY_WALKER || body->kind == NPG_BODY_HANDS;
}

static npg_status open_walker(npg_body *body, double cell)
{
    static const double lo[3] = {-0.75, -0.1, -0.35}, hi[3] = {0.75, 1.9, 0.35};
    body->is_welded = body->kind == NPG_BODY_HANDS && !body->is_changed;
    npg_walker_pose(body->weld, 0, 0, 1);
    NPG_TRY(
        npg_body_mesh(&body->rest, npg_walker_distance, body->is_welded ? body->weld : NULL, lo, hi, cell));
    return open_weights(body, cell);
}

npg_status npg_body_open(npg_body **out, int kind, bool is_changed, double cell)
{
    npg_body *body;
    NPG_TRY(npg_alloc(&body, NPG_FOR_MESH, sizeof *body));
    body->kind = kind;
    body->is_changed = is_changed;
    npg_status status = is_walking(body) ? open_walker(body, cell) : open_bar(body, cell);
    if (status) npg_body_close(&body);
    *out = body;
    return status;
}

void npg_body_close(npg_body **slot)
{
    if (!slot || !*slot) return;
    npg_mesh_unref(&(*slot)->rest);
    npg_release(&(*slot)->weights);
    npg_release(slot);
}

const npg_mesh *npg_body_rest(const npg_body *body)
{
    return body->rest;
}

void npg_body_pose(const npg_body *body, float *vert_pos, const npg_moment *moment)
{
    if (is_walking(body)) {
        pose_walker(body, vert_pos, moment);
    } else {
        pose_bar(body, vert_pos, moment->phase);
        pose_ball(body, vert_pos, moment->since);
    }
}
