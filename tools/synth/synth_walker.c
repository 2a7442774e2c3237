/* Synthetic walker: a skeleton of tapered capsules, its shape as a distance field, and its gait. */
#include <math.h>
#include <string.h>

#include "tools/synth/synth.h"

#define PI 3.14159265358979323846

/* A bone turns about its joint; sides come as pairs, left (x > 0) first.  Metres; sizes and angles of the
 * gait were set by eye. */
typedef struct bone {
    int parent;
    double joint[3], from[3], to[3], radius_from, radius_to;
} bone;

/* 0 pelvis, 1 chest, 2 head, 3/4 upper arms, 5/6 lower arms, 7/8 upper legs, 9/10 lower legs, 11/12 feet */
static const bone bones[NPG_BONES] = {
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
double npg_walker_distance(const double p[3], const void *user)
{
    const double softness = 0.018; /* metres: how round limbs join; set by eye */
    double sum = 0, distances[NPG_BONES], least = INFINITY;
    const npg_bone_pose *pose = user;
    for (int b = 0; b < NPG_BONES; b++)
        least = fmin(least, distances[b] = bone_distance(&bones[b], pose ? &pose[b] : NULL, p));
    for (int b = 0; b < NPG_BONES; b++) sum += exp((least - distances[b]) / softness);
    return least - softness * log(sum);
}

int npg_walker_nearest_bone(const double p[3], const npg_bone_pose *pose)
{
    int nearest = 0;
    double least = INFINITY;
    for (int b = 0; b < NPG_BONES; b++) {
        double distance = bone_distance(&bones[b], pose ? &pose[b] : NULL, p);
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

/* Angles (about x, y, z; radians) of a bone at a phase in cycles; forward is +z, a limb swings forward with a
 * negative angle about x. */
static void bone_angles(double angles[3], int b, double phase)
{
    bool right = b >= 3 && b % 2 == 0;
    double side = right ? -1 : 1, cycle = 2 * PI * phase + (right ? PI : 0), swing = sin(cycle);
    angles[0] = angles[1] = angles[2] = 0;
    switch (b) {
    case 0: angles[1] = 0.12 * sin(2 * PI * phase); break;
    case 1: angles[1] = -0.24 * sin(2 * PI * phase); break;
    case 2: angles[0] = 0.05 * cos(4 * PI * phase); break;
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

/* The same of the body HANDS.  What bears the arm is stiff, so that the hand can stay where it is on the hip:
 * with the upper arm as at rest, the lower arm turned in by this angle ends inside the pelvis. */
static void hands_angles(double angles[3], int b, double phase, double at_hip)
{
    const double turned_in = 1.55;
    bone_angles(angles, b, phase);
    if (b != 1 && (b < 3 || b > 6)) return;
    angles[0] = angles[1] = angles[2] = 0;
    if (b == 3) angles[0] = 0.35 * sin(2 * PI * phase);
    if (b == 4) angles[0] = 0.5 * (1 - at_hip) * sin(2 * PI * phase);
    if (b == 6) angles[2] = turned_in * at_hip;
}

void npg_bone_between(npg_bone_pose *at, const npg_bone_pose *rest, const npg_bone_pose *motion)
{
    double back[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) back[3 * i + j] = rest->rotation[3 * j + i];
    multiply(at->rotation, motion->rotation, back);
    for (int k = 0; k < 3; k++) {
        const double *row = at->rotation + 3 * k;
        at->shift[k] =
            motion->shift[k] - (row[0] * rest->shift[0] + row[1] * rest->shift[1] + row[2] * rest->shift[2]);
    }
}

void npg_walker_pose(npg_bone_pose out[NPG_BONES], double phase, double travel, double at_hip)
{
    for (int b = 0; b < NPG_BONES; b++) {
        const bone *it = &bones[b];
        double angles[3], turn[9], local[9], moved_joint[3];
        if (at_hip >= 0)
            hands_angles(angles, b, phase, at_hip);
        else
            bone_angles(angles, b, phase);
        turn_about(local, 0, angles[0]);
        for (int axis = 1; axis < 3; axis++) {
            turn_about(turn, axis, angles[axis]);
            multiply(local, turn, local);
        }
        const npg_bone_pose *parent = it->parent < 0 ? NULL : &out[it->parent];
        for (int k = 0; k < 3; k++) {
            moved_joint[k] = it->joint[k];
            if (!parent) continue;
            const double *row = parent->rotation + 3 * k;
            moved_joint[k] =
                row[0] * it->joint[0] + row[1] * it->joint[1] + row[2] * it->joint[2] + parent->shift[k];
        }
        if (parent)
            multiply(out[b].rotation, parent->rotation, local);
        else {
            memcpy(out[b].rotation, local, sizeof local);
            moved_joint[1] += 0.02 * cos(4 * PI * phase);
            moved_joint[2] += travel * phase;
        }
        for (int k = 0; k < 3; k++) {
            const double *row = out[b].rotation + 3 * k;
            out[b].shift[k] =
                moved_joint[k] - row[0] * it->joint[0] - row[1] * it->joint[1] - row[2] * it->joint[2];
        }
    }
}
