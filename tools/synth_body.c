/* Synthetic bodies: a closed surface of fixed topology and its exact motion. */
#include "synth_body.h"

#include <math.h>
#include <string.h>

#include "mesh_tools.h"

#define PI 3.14159265358979323846

struct npg_body {
    int kind;
    npg_mesh *rest;
    float *weights; /* V x NPG_BONES, rows sum to 1; walker only */
};

/* ---- skin of the walker ---- */

/* Every vertex begins with its nearest bone; then the weights spread over the surface (never through the air
 * between two limbs) as heat would, over about `reach` metres. */
static npg_status open_weights(npg_body *body, double cell)
{
    const double reach = 0.07;
    const npg_mesh *rest = body->rest;
    size_t edge_count, size = rest->vert_count * NPG_BONES;
    uint32_t(*edges)[2];
    float *next = NULL, *degree = NULL;
    int rounds = (int)ceil(reach * reach / (cell * cell));
    NPG_TRY(npg_alloc_array(&body->weights, NPG_FOR_MESH, size, sizeof(float)));
    NPG_TRY(npg_mesh_edges(&edges, &edge_count, rest->faces, rest->face_count));
    npg_status status = npg_alloc_array(&next, NPG_FOR_MESH, size, sizeof *next);
    if (!status) status = npg_alloc_array(&degree, NPG_FOR_MESH, rest->vert_count, sizeof *degree);
    for (size_t v = 0; v < rest->vert_count && !status; v++) {
        const float *p = rest->vert_pos + 3 * v;
        int bone = npg_walker_nearest_bone((double[3]){(double)p[0], (double)p[1], (double)p[2]});
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
    npg_release(&degree);
    npg_release(&next);
    npg_release(&edges);
    return status;
}

static void pose_walker(const npg_body *body, float *vert_pos, double phase, double travel)
{
    npg_rigid bones[NPG_BONES];
    npg_walker_pose(bones, phase, travel);
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
    for (size_t v = 0; v < body->rest->vert_count; v++) {
        const float *p = body->rest->vert_pos + 3 * v;
        double y = (double)p[1], turn = twist * y, angle = curvature * y;
        double x = cos(turn) * (double)p[0] + sin(turn) * (double)p[2];
        double z = -sin(turn) * (double)p[0] + cos(turn) * (double)p[2];
        /* The middle line is an arc of that curvature through the origin; (1 - cos a) / k without dividing by
         * 0. */
        double half = 0.5 * angle, ratio = fabs(half) < 1e-9 ? 1 : sin(half) / half;
        double line_x = y * ratio * sin(half), line_y = y * ratio * cos(half);
        vert_pos[3 * v] = (float)(line_x + x * cos(angle));
        vert_pos[3 * v + 1] = (float)(line_y - x * sin(angle));
        vert_pos[3 * v + 2] = (float)z;
    }
}

/* ---- any body ---- */

npg_status npg_body_open(npg_body **out, int kind, double cell)
{
    static const double walker_lo[3] = {-0.75, -0.1, -0.35}, walker_hi[3] = {0.75, 1.9, 0.35};
    static const double bar_lo[3] = {-0.3, -1.1, -0.25}, bar_hi[3] = {0.3, 1.1, 0.25};
    npg_body *body;
    NPG_TRY(npg_alloc(&body, NPG_FOR_MESH, sizeof *body));
    body->kind = kind;
    npg_status status;
    if (kind == NPG_BODY_WALKER) {
        status = npg_body_mesh(&body->rest, npg_walker_distance, NULL, walker_lo, walker_hi, cell);
        if (!status) status = open_weights(body, cell);
    } else {
        status = npg_body_mesh(&body->rest, bar_distance, NULL, bar_lo, bar_hi, cell);
    }
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

void npg_body_pose(const npg_body *body, float *vert_pos, double phase, double travel)
{
    if (body->kind == NPG_BODY_WALKER)
        pose_walker(body, vert_pos, phase, travel);
    else
        pose_bar(body, vert_pos, phase);
}
