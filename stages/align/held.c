/* Held: edges in the frame of their first end. */
#include "align/held.h"

#include <math.h>
#include <string.h>

#include "align/ties.h"
#include "pipeline/order.h"

/* What is hidden for long drifts by what each frame adds, so a small part of each edge stays at rest; more of
 * it where several sensors leave little hidden, between parts that are seen.  By trial,
 * samples/guide/why_these_defaults.md, one sensor and a body that turns. */
#define HELD_ONE     0.95 /* before one sensor */
#define HELD_SEVERAL 0.9
/* A tie counts little where both ends are seen: a piece that has points goes where they are, and one that the
 * alignment has lost does not fly off. */
#define TIE_SEEN 0.01

/* Edges and ties, in their order. */
static npg_status open_pairs(npg_held *held, const npg_graph *graph)
{
    uint32_t(*ties)[2];
    size_t tie_count, e = 0, tie = 0;
    const uint32_t(*edges)[2] = (const uint32_t(*)[2])graph->edges;
    NPG_TRY(npg_ties_find(&ties, &tie_count, graph->node_pos, graph->node_count, edges, graph->edge_count));
    held->pair_count = graph->edge_count + tie_count;
    npg_status status = npg_alloc_array(&held->pairs, NPG_FOR_FIT, held->pair_count + 1, sizeof *held->pairs);
    if (!status) status = npg_alloc(&held->is_tie, NPG_FOR_FIT, held->pair_count + 1);
    for (size_t i = 0; i < held->pair_count && !status; i++) {
        held->is_tie[i] =
            e == graph->edge_count || (tie < tie_count && npg_order_pair(ties[tie], edges[e]) < 0);
        memcpy(held->pairs[i], held->is_tie[i] ? ties[tie++] : edges[e++], sizeof held->pairs[i]);
    }
    npg_release(&ties);
    return status;
}

npg_status npg_held_open(npg_held *held, const npg_graph *graph)
{
    NPG_TRY(open_pairs(held, graph));
    NPG_TRY(npg_alloc_array(&held->edges, NPG_FOR_FIT, 2 * held->pair_count + 1, sizeof *held->edges));
    NPG_TRY(npg_alloc_array(&held->seen, NPG_FOR_FIT, graph->node_count, sizeof *held->seen));
    NPG_TRY(npg_alloc_array(&held->bound, NPG_FOR_FIT, graph->node_count, sizeof *held->bound));
    for (size_t k = 0; k < graph->node_count; k++) held->seen[k] = 1;
    return NPG_OK;
}

void npg_held_close(npg_held *held)
{
    npg_release(&held->pairs);
    npg_release(&held->is_tie);
    npg_release(&held->edges);
    npg_release(&held->seen);
    npg_release(&held->bound);
}

/* R_j^T (x_k - x_j). */
static void edge_in_pose(double edge[3], const npg_graph *graph, const double *pose, uint32_t j, uint32_t k)
{
    const double *pj = pose + j * NPG_POSE_SIZE, *pk = pose + k * NPG_POSE_SIZE;
    double d[3];
    for (size_t i = 0; i < 3; i++) {
        d[i] = (double)graph->node_pos[3 * (size_t)k + i] - (double)graph->node_pos[3 * (size_t)j + i];
        d[i] += pk[9 + i] - pj[9 + i];
    }
    for (int i = 0; i < 3; i++) edge[i] = pj[i] * d[0] + pj[3 + i] * d[1] + pj[6 + i] * d[2];
}

void npg_held_take(npg_held *held, const npg_graph *graph, const npg_hold *hold, size_t sensor_count)
{
    held->share = sensor_count == 1 ? HELD_ONE : HELD_SEVERAL;
    for (size_t e = 0; e < 2 * held->pair_count; e++) {
        uint32_t j = held->pairs[e / 2][e % 2], k = held->pairs[e / 2][1 - e % 2];
        double edge[3], far_edge[3] = {0}, far_weight = 0;
        edge_in_pose(edge, graph, hold->pose, j, k);
        if (hold->far_pose) {
            edge_in_pose(far_edge, graph, hold->far_pose, j, k);
            far_weight = (double)fmaxf(hold->since[j], hold->since[k]);
        }
        for (int i = 0; i < 3; i++)
            held->edges[e][i] = (float)((edge[i] + far_weight * far_edge[i]) / (1 + far_weight));
    }
}

void npg_held_see(npg_held *held, const npg_graph *graph, const uint32_t *verts, const uint8_t *is_seen,
                  size_t count)
{
    memset(held->seen, 0, graph->node_count * sizeof *held->seen);
    memset(held->bound, 0, graph->node_count * sizeof *held->bound);
    for (size_t i = 0; i < count; i++)
        for (size_t b = 0; b < NPG_GRAPH_BIND; b++) {
            size_t at = verts[i] * (size_t)NPG_GRAPH_BIND + b;
            uint32_t node = graph->vert_node[at];
            if (node == UINT32_MAX) break;
            held->bound[node] += graph->vert_weight[at];
            held->seen[node] += is_seen[i] ? graph->vert_weight[at] : 0;
        }
    for (size_t k = 0; k < graph->node_count; k++)
        held->seen[k] = held->bound[k] > 0 ? held->seen[k] / held->bound[k] : 1;
}

double npg_held_edge(double edge[3], const npg_held *held, const npg_graph *graph, size_t e)
{
    uint32_t j = held->pairs[e / 2][e % 2], k = held->pairs[e / 2][1 - e % 2];
    double hidden = 1 - 0.5 * (double)(held->seen[j] + held->seen[k]);
    for (size_t i = 0; i < 3; i++) {
        double rest = (double)graph->node_pos[3 * (size_t)k + i] - (double)graph->node_pos[3 * (size_t)j + i];
        edge[i] = rest + held->share * hidden * ((double)held->edges[e][i] - rest);
    }
    return held->is_tie[e / 2] ? fmax(TIE_SEEN, hidden) : 1;
}

void npg_held_count(const npg_held *held, float *since, const float *before, size_t node_count)
{
    for (size_t k = 0; k < node_count; k++) since[k] = held->seen[k] > 0.5F ? 0 : before[k] + 1;
}
