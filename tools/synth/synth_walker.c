/* Synthetic walker: a skeleton of tapered capsules, its shape as a distance field, its gait and its skin. */
#include <math.h>
#include <string.h>

#include "tools/synth/synth.h"

/* A bone turns about its joint; sides come as pairs, left (x > 0) first.  Metres; sizes and angles of the
 * gait were set by eye. */
typedef struct bone {
    int parent;
    double joint[3], from[3], to[3], radius_from, radius_to;
} bone;

/* 0 pelvis, 1 chest, 2 head, 3/4 upper arms, 5/6 lower arms, 7/8 upper legs, 9/10 lower legs, 11/12 feet */
static const bone skeleton[NPG_BONES] = {
    {-1, {0, 0.96, 0}, {-0.05, 0.96, 0}, {0.05, 0.96, 0}, 0.125, 0.125},
    {0, {0, 1.05, 0}, {0, 1.12, 0}, {0, 1.34, 0}, 0.125, 0.15},
    {1, {0, 1.46, 0}, {0, 1.50, 0}, {0, 1.68, 0.02}, 0.055, 0.10},
    {1, {0.17, 1.40, 0}, {0.15, 1.40, 0}, {0.40, 1.17, 0}, 0.062, 0.048},
    {1, {-0.17, 1.40, 0}, {-0.15, 1.40, 0}, {-0.40, 1.17, 0}, 0.062, 0.048},
    {3, {0.40, 1.17, 0}, {0.40, 1.17, 0}, {0.60, 0.95, 0.03}, 0.048, 0.040},
    {4, {-0.40, 1.17, 0}, {-0.40, 1.17, 0}, {-0.60, 0.95, 0.03}, 0.048, 0.040},
    {0, {0.11, 0.92, 0}, {0.11, 0.90, 0}, {0.14, 0.50, 0.01}, 0.090, 0.062},
    {0, {-0.11, 0.92, 0}, {-0.11, 0.90, 0}, {-0.14, 0.50, 0.01}, 0.090, 0.062},
    {7, {0.14, 0.50, 0.01}, {0.14, 0.50, 0.01}, {0.155, 0.10, -0.02}, 0.062, 0.044},
    {8, {-0.14, 0.50, 0.01}, {-0.14, 0.50, 0.01}, {-0.155, 0.10, -0.02}, 0.062, 0.044},
    {9, {0.155, 0.10, -0.02}, {0.155, 0.06, -0.03}, {0.17, 0.05, 0.15}, 0.046, 0.038},
    {10, {-0.155, 0.10, -0.02}, {-0.155, 0.06, -0.03}, {-0.17, 0.05, 0.15}, 0.046, 0.038},
};

/* ---- shape ---- */

static void move(double out[3], const npg_bone_pose *pose, const double p[3])
{
    for (int k = 0; k < 3; k++) {
        const double *row = pose->rotation + 3 * k;
        out[k] = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + pose->shift[k];
    }
}

static double bone_distance(const bone *rest, const npg_bone_pose *pose, const double p[3])
{
    double along = 0, length_sq = 0, dist_sq = 0;
    bone moved = *rest, *b = &moved;
    if (pose) move(moved.from, pose, rest->from);
    if (pose) move(moved.to, pose, rest->to);
    for (int k = 0; k < 3; k++) {
        along += (p[k] - b->from[k]) * (b->to[k] - b->from[k]);
        length_sq += (b->to[k] - b->from[k]) * (b->to[k] - b->from[k]);
    }
    double t = fmin(fmax(along / length_sq, 0), 1);
    for (int k = 0; k < 3; k++) {
        double d = p[k] - b->from[k] - t * (b->to[k] - b->from[k]);
        dist_sq += d * d;
    }
    return sqrt(dist_sq) - (b->radius_from + t * (b->radius_to - b->radius_from));
}

/* The smooth minimum of the distances to all bones: -k log sum exp(-d / k). */
static double distance_to_bones(const double p[3], const void *user)
{
    const double softness = 0.018; /* metres: how round limbs join; set by eye */
    double sum = 0, distances[NPG_BONES], least = INFINITY;
    const npg_bone_pose *pose = user;
    for (int b = 0; b < NPG_BONES; b++)
        least = fmin(least, distances[b] = bone_distance(&skeleton[b], pose ? &pose[b] : NULL, p));
    for (int b = 0; b < NPG_BONES; b++) sum += exp((least - distances[b]) / softness);
    return least - softness * log(sum);
}

static int nearest_bone(const double p[3], const npg_bone_pose *pose)
{
    int nearest = 0;
    double least = INFINITY;
    for (int b = 0; b < NPG_BONES; b++) {
        double distance = bone_distance(&skeleton[b], pose ? &pose[b] : NULL, p);
        if (distance >= least) continue;
        least = distance;
        nearest = b;
    }
    return nearest;
}

/* ---- gait ---- */

static void multiply(double out[9], const double a[9], const double b[9])
{
    double product[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            product[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
    memcpy(out, product, sizeof product);
}

static void turn_about(double out[9], int axis, double angle)
{
    int i = (axis + 1) % 3, j = (axis + 2) % 3;
    memset(out, 0, 9 * sizeof *out);
    out[4 * axis] = 1;
    out[3 * i + i] = out[3 * j + j] = cos(angle);
    out[3 * i + j] = -sin(angle);
    out[3 * j + i] = sin(angle);
}

/* Forward is +z, a limb swings forward with a negative angle about x. */
void npg_walker_gait(double angles[3], int b, const npg_moment *moment)
{
    double phase = moment->phase;
    bool right = b >= 3 && b % 2 == 0;
    double side = right ? -1 : 1, cycle = 2 * M_PI * phase + (right ? M_PI : 0), swing = sin(cycle);
    angles[0] = angles[1] = angles[2] = 0;
    switch (b) {
    case 0: angles[1] = 0.12 * sin(2 * M_PI * phase); break;
    case 1: angles[1] = -0.24 * sin(2 * M_PI * phase); break;
    case 2: angles[0] = 0.05 * cos(4 * M_PI * phase); break;
    case 3:
    case 4:
        angles[0] = 0.55 * swing;
        angles[2] = -side * 0.45;
        break;
    case 5:
    case 6: angles[0] = -0.45 + 0.35 * swing; break;
    case 7:
    case 8: angles[0] = -0.50 * swing - 0.05; break;
    case 9:
    case 10: angles[0] = 0.45 - 0.40 * sin(cycle - 0.9); break;
    default: angles[0] = 0.15 * cos(cycle); break;
    }
}

void npg_walker_bones(npg_bone_pose out[NPG_BONES], npg_gait_fn *gait, const npg_moment *moment)
{
    for (int b = 0; b < NPG_BONES; b++) {
        const bone *it = &skeleton[b];
        double angles[3], turn[9], local[9], moved_joint[3];
        gait(angles, b, moment);
        turn_about(local, 0, angles[0]);
        for (int axis = 1; axis < 3; axis++) {
            turn_about(turn, axis, angles[axis]);
            multiply(local, turn, local);
        }
        if (it->parent >= 0) {
            move(moved_joint, &out[it->parent], it->joint);
            multiply(out[b].rotation, out[it->parent].rotation, local);
        } else {
            memcpy(out[b].rotation, local, sizeof local);
            moved_joint[0] = it->joint[0];
            moved_joint[1] = it->joint[1] + 0.02 * cos(4 * M_PI * moment->phase);
            moved_joint[2] = it->joint[2] + moment->travel * moment->phase;
        }
        for (int k = 0; k < 3; k++) {
            const double *row = out[b].rotation + 3 * k;
            out[b].shift[k] =
                moved_joint[k] - row[0] * it->joint[0] - row[1] * it->joint[1] - row[2] * it->joint[2];
        }
    }
}

/* ---- skin ---- */

/* Every vertex begins with its nearest bone; then the weights spread over the surface (never through the air
 * between two limbs) as heat would, over about `reach` metres. */
static npg_status open_weights(npg_body *body, double cell, const npg_bone_pose *pose)
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
        int b = nearest_bone((double[3]){(double)p[0], (double)p[1], (double)p[2]}, pose);
        body->weights[v * NPG_BONES + (size_t)b] = 1;
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

npg_status npg_walker_open(npg_body *body, double cell, const npg_bone_pose *pose)
{
    static const double lo[3] = {-0.75, -0.1, -0.35}, hi[3] = {0.75, 1.9, 0.35};
    NPG_TRY(npg_body_mesh(&body->rest, distance_to_bones, pose, lo, hi, cell));
    return open_weights(body, cell, pose);
}

void npg_walker_bend(const npg_body *body, float *vert_pos, const npg_bone_pose bones[NPG_BONES])
{
    for (size_t v = 0; v < body->rest->vert_count; v++) {
        const float *p = body->rest->vert_pos + 3 * v, *weights = body->weights + v * NPG_BONES;
        const double at[3] = {(double)p[0], (double)p[1], (double)p[2]};
        double moved[3] = {0}, sum = 0;
        for (int b = 0; b < NPG_BONES; b++) {
            double weight = (double)weights[b], with_bone[3];
            sum += weight;
            move(with_bone, &bones[b], at);
            for (int k = 0; k < 3; k++) moved[k] += weight * with_bone[k];
        }
        for (int k = 0; k < 3; k++) vert_pos[3 * v + k] = (float)(moved[k] / sum);
    }
}

static npg_status open_walker(npg_body *body, double cell, bool is_changed)
{
    (void)is_changed;
    return npg_walker_open(body, cell, NULL);
}

static void pose_walker(const npg_body *body, float *vert_pos, const npg_moment *moment)
{
    npg_bone_pose bones[NPG_BONES];
    npg_walker_bones(bones, npg_walker_gait, moment);
    npg_walker_bend(body, vert_pos, bones);
}

const npg_figure npg_walker = {open_walker, pose_walker, INT64_MAX};

/* ---- figures ---- */

npg_status npg_moving_open(npg_moving *f, double cell, bool is_changed)
{
    npg_moving_close(f);
    NPG_TRY(f->kind->open(&f->body, cell, is_changed));
    NPG_TRY(npg_mesh_copy(&f->mesh, f->body.rest));
    if (f->mesh->vert_normals) return NPG_OK;
    return npg_alloc_array(&f->mesh->vert_normals, NPG_FOR_MESH, f->mesh->vert_count, 3 * sizeof(float));
}

void npg_moving_pose(npg_moving *f, const npg_moment *moment)
{
    npg_mesh *m = f->mesh;
    f->kind->pose(&f->body, m->vert_pos, moment);
    npg_mesh_vertex_normals(m->vert_normals, m->vert_pos, m->vert_count, m->faces, m->face_count);
}

void npg_moving_close(npg_moving *f)
{
    npg_mesh_unref(&f->mesh);
    npg_mesh_unref(&f->body.rest);
    npg_release(&f->body.weights);
}
