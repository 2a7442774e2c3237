/* Pose: products of the nodes' rotations, and steps of a fit. */
#include "track/track.h"

#include <math.h>
#include <string.h>

void npg_pose_straighten(double m[9])
{
    double *first = m, *second = m + 3, *third = m + 6;
    npg_vec3_make_unit(first);
    double along = npg_vec3_dot(first, second);
    for (int i = 0; i < 3; i++) second[i] -= along * first[i];
    npg_vec3_make_unit(second);
    npg_vec3_cross(third, first, second);
}

void npg_pose_extrapolate(double *next, const double *now, const double *before, size_t node_count)
{
    for (size_t k = 0; k < node_count;
         k++, next += NPG_POSE_SIZE, now += NPG_POSE_SIZE, before += NPG_POSE_SIZE) {
        double change[9];
        for (int i = 0; i < 9; i++) { /* now before^T */
            change[i] = 0;
            for (int c = 0; c < 3; c++) change[i] += now[i / 3 * 3 + c] * before[i % 3 * 3 + c];
        }
        for (int i = 0; i < 9; i++) {
            next[i] = 0;
            for (int c = 0; c < 3; c++) next[i] += change[i / 3 * 3 + c] * now[3 * c + i % 3];
        }
        /* products of products would triple their rounding errors with every frame */
        npg_pose_straighten(next);
        for (int i = 9; i < 12; i++) next[i] = 2 * now[i] - before[i];
    }
}

static void move_node(double moved[NPG_POSE_SIZE], const float node[3], const double pose[NPG_POSE_SIZE],
                      const npg_rigid *motion)
{
    for (int row = 0; row < 3; row++) {
        const double *r = motion->rotation[row];
        double x = motion->translation[row];
        for (int c = 0; c < 3; c++) {
            x += r[c] * ((double)node[c] + pose[9 + c]);
            moved[3 * row + c] = r[0] * pose[c] + r[1] * pose[3 + c] + r[2] * pose[6 + c];
        }
        moved[9 + row] = x - (double)node[row];
    }
}

void npg_pose_move(double *moved, const npg_graph *graph, const double *pose, const npg_rigid *motion)
{
    for (size_t k = 0; k < graph->node_count; k++)
        move_node(moved + k * NPG_POSE_SIZE, graph->node_pos + 3 * k, pose + k * NPG_POSE_SIZE, motion);
}

void npg_pose_places(float *places, const npg_graph *graph, const double *pose)
{
    for (size_t i = 0; i < 3 * graph->node_count; i++)
        places[i] = (float)((double)graph->node_pos[i] + pose[i / 3 * NPG_POSE_SIZE + 9 + i % 3]);
}

npg_status npg_pose_between(npg_rigid *motion, const npg_graph *graph, const double *from, const double *to)
{
    size_t count = 3 * graph->node_count;
    float *places;
    NPG_TRY(npg_alloc_array(&places, NPG_FOR_FIT, 2 * count, sizeof *places));
    npg_pose_places(places, graph, from);
    npg_pose_places(places + count, graph, to);
    npg_rigid_fit(motion->rotation, motion->translation, places, places + count, graph->node_count);
    npg_release(&places);
    return NPG_OK;
}

npg_status npg_pose_bend(double *bend, const npg_graph *graph, const double *pose)
{
    npg_rigid motion;
    float *places;
    double sum = 0;
    NPG_TRY(npg_alloc_array(&places, NPG_FOR_FIT, 3 * graph->node_count, sizeof *places));
    npg_pose_places(places, graph, pose);
    npg_rigid_fit(motion.rotation, motion.translation, graph->node_pos, places, graph->node_count);
    for (size_t i = 0; i < 3 * graph->node_count; i++) {
        double left = npg_rigid_at(&motion, graph->node_pos + i / 3 * 3, (int)(i % 3)) - (double)places[i];
        sum += left * left;
    }
    npg_release(&places);
    *bend = graph->node_count ? sqrt(sum / (double)graph->node_count) : 0;
    return NPG_OK;
}

/* Node k carries the vertices of[first[k]] .. of[first[k + 1] - 1]; first (K + 1), next (K): zero before. */
static void list_by_node(size_t *first, size_t *next, uint32_t *of, const npg_graph *graph)
{
    size_t count = graph->vert_count * NPG_GRAPH_BIND;
    for (size_t i = 0; i < count; i++)
        if (graph->vert_node[i] != UINT32_MAX) first[graph->vert_node[i] + 1]++;
    for (size_t k = 0; k < graph->node_count; k++) first[k + 1] += next[k] = first[k];
    for (size_t i = 0; i < count; i++)
        if (graph->vert_node[i] != UINT32_MAX)
            of[next[graph->vert_node[i]]++] = (uint32_t)(i / NPG_GRAPH_BIND);
}

npg_status npg_pose_of(double *pose, const npg_graph *graph, const float *rest, const float *placed)
{
    npg_arena scratch = {.purpose = NPG_FOR_FIT};
    const double rest_pose[NPG_POSE_SIZE] = {[0] = 1, [4] = 1, [8] = 1};
    size_t count = graph->vert_count * NPG_GRAPH_BIND;
    size_t *first = npg_arena_take(&scratch, graph->node_count + 1, sizeof *first);
    size_t *next = npg_arena_take(&scratch, graph->node_count, sizeof *next);
    uint32_t *of = npg_arena_take(&scratch, count, sizeof *of);
    float *from = npg_arena_take(&scratch, count, 3 * sizeof *from);
    float *to = npg_arena_take(&scratch, count, 3 * sizeof *to);
    npg_status status = npg_arena_status(&scratch);
    if (!status) list_by_node(first, next, of, graph);
    npg_pose_rest(pose, graph->node_count);
    for (size_t k = 0; k < graph->node_count && !status; k++) {
        npg_rigid motion;
        size_t verts = first[k + 1] - first[k];
        if (!verts) continue;
        npg_rows_gather(from, rest, of + first[k], verts);
        npg_rows_gather(to, placed, of + first[k], verts);
        npg_rigid_fit(motion.rotation, motion.translation, from, to, verts);
        move_node(pose + k * NPG_POSE_SIZE, graph->node_pos + 3 * k, rest_pose, &motion);
    }
    npg_arena_release(&scratch);
    return status;
}

/* ---- a step ---- */

#define TURN_MAX 0.6  /* of a node in one step, radians */
#define MOVE_MAX 0.15 /* units                          */

/* rotation = exp(omega) rotation (Rodrigues). */
static void turn(double rotation[9], const double omega[3])
{
    double angle = npg_vec3_length(omega), m[9], out[9];
    double s = angle > 1e-9 ? sin(angle) / angle : 1,
           c = angle > 1e-9 ? (1 - cos(angle)) / (angle * angle) : 0.5;
    const double x[9] = {0, -omega[2], omega[1], omega[2], 0, -omega[0], -omega[1], omega[0], 0};
    for (int i = 0; i < 9; i++) {
        double square = 0;
        for (int k = 0; k < 3; k++) square += x[i / 3 * 3 + k] * x[3 * k + i % 3];
        m[i] = (i % 4 == 0) + s * x[i] + c * square;
    }
    for (int i = 0; i < 9; i++) {
        out[i] = 0;
        for (int k = 0; k < 3; k++) out[i] += m[i / 3 * 3 + k] * rotation[3 * k + i % 3];
    }
    memcpy(rotation, out, sizeof out);
}

/* The share of a step that turns and moves no node by more than the largest allowed: a linearised turn means
 * nothing beyond. */
static double share_of_step(const double *steps, size_t node_count)
{
    double largest = 0;
    for (size_t k = 0; k < node_count; k++)
        for (size_t half = 0; half < 2; half++) {
            const double *d = steps + 6 * k + 3 * half;
            largest = fmax(largest, npg_vec3_length(d) / (half ? MOVE_MAX : TURN_MAX));
        }
    return largest > 1 ? 1 / largest : 1;
}

double npg_pose_step(double *pose, double *steps, size_t node_count)
{
    double largest = 0, share = share_of_step(steps, node_count);
    for (size_t k = 0; k < node_count; k++) {
        double *d = steps + 6 * k, moved = 0;
        for (int i = 0; i < 6; i++) d[i] *= share;
        turn(pose + k * NPG_POSE_SIZE, d);
        for (int i = 0; i < 3; i++) {
            pose[k * NPG_POSE_SIZE + 9 + (size_t)i] += d[3 + i];
            moved += d[3 + i] * d[3 + i];
        }
        largest = fmax(largest, moved);
    }
    return sqrt(largest);
}
