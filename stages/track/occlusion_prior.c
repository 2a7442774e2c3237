/* Occlusion prior: edges in the frame of their first end. */
#include "track/track.h"

#include <math.h>
#include <string.h>

#include "pipeline/order.h"
#include "track/track_internal.h"

/* What is hidden for long drifts by what each frame adds, so a small part of each edge stays at rest.  By trial,
 * tests/bed/decisions.md, one sensor and a body that turns. */
#define PRIOR 0.95
/* A link counts little where both ends are seen: a piece that has points goes where they are, and one that the
 * alignment has lost does not fly off. */
#define LINK_SEEN 0.01

/* Edges and links, in their order. */
static void fill_pairs(npg_occlusion_prior *prior, const npg_graph *graph, const uint32_t (*links)[2],
                       size_t link_count)
{
    const uint32_t(*edges)[2] = (const uint32_t(*)[2])graph->edges;
    size_t e = 0, link = 0;
    for (size_t i = 0; i < prior->pair_count; i++) {
        prior->is_link[i] =
            e == graph->edge_count || (link < link_count && npg_order_pair(links[link], edges[e]) < 0);
        memcpy(prior->pairs[i], prior->is_link[i] ? links[link++] : edges[e++], sizeof prior->pairs[i]);
    }
}

npg_status npg_prior_open(npg_occlusion_prior *prior, npg_arena *arena, const npg_graph *graph)
{
    uint32_t(*links)[2];
    size_t link_count, nodes = graph->node_count;
    NPG_TRY(npg_component_links_find(&links, &link_count, graph->node_pos, nodes,
                                     (const uint32_t(*)[2])graph->edges, graph->edge_count));
    prior->pair_count = graph->edge_count + link_count;
    prior->pairs = npg_arena_take(arena, prior->pair_count, sizeof *prior->pairs);
    prior->is_link = npg_arena_take(arena, prior->pair_count, 1);
    prior->edges = npg_arena_take(arena, 2 * prior->pair_count, sizeof *prior->edges);
    prior->seen = npg_arena_take(arena, nodes, sizeof *prior->seen);
    prior->bound = npg_arena_take(arena, nodes, sizeof *prior->bound);
    npg_status status = npg_arena_status(arena);
    if (!status) fill_pairs(prior, graph, (const uint32_t(*)[2])links, link_count);
    for (size_t k = 0; k < nodes && !status; k++) prior->seen[k] = 1;
    npg_release(&links);
    return status;
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

void npg_prior_take(npg_occlusion_prior *prior, const npg_graph *graph, const npg_prior_poses *poses)
{
    for (size_t e = 0; e < 2 * prior->pair_count; e++) {
        uint32_t j = prior->pairs[e / 2][e % 2], k = prior->pairs[e / 2][1 - e % 2];
        double edge[3], far_edge[3] = {0}, far_weight = 0;
        edge_in_pose(edge, graph, poses->pose, j, k);
        if (poses->far_pose) {
            edge_in_pose(far_edge, graph, poses->far_pose, j, k);
            far_weight = (double)fmaxf(poses->since[j], poses->since[k]);
        }
        for (int i = 0; i < 3; i++)
            prior->edges[e][i] = (float)((edge[i] + far_weight * far_edge[i]) / (1 + far_weight));
    }
}

void npg_prior_see(npg_occlusion_prior *prior, const npg_graph *graph, const uint32_t *verts,
                   const uint8_t *is_seen, size_t count)
{
    memset(prior->seen, 0, graph->node_count * sizeof *prior->seen);
    memset(prior->bound, 0, graph->node_count * sizeof *prior->bound);
    for (size_t i = 0; i < count; i++)
        for (size_t b = 0; b < NPG_GRAPH_BIND; b++) {
            size_t at = verts[i] * (size_t)NPG_GRAPH_BIND + b;
            uint32_t node = graph->vert_node[at];
            if (node == UINT32_MAX) break;
            prior->bound[node] += graph->vert_weight[at];
            prior->seen[node] += is_seen[i] ? graph->vert_weight[at] : 0;
        }
    for (size_t k = 0; k < graph->node_count; k++)
        prior->seen[k] = prior->bound[k] > 0 ? prior->seen[k] / prior->bound[k] : 1;
}

double npg_prior_edge(double edge[3], const npg_occlusion_prior *prior, const npg_graph *graph, size_t e)
{
    uint32_t j = prior->pairs[e / 2][e % 2], k = prior->pairs[e / 2][1 - e % 2];
    double hidden = 1 - 0.5 * (double)(prior->seen[j] + prior->seen[k]);
    for (size_t i = 0; i < 3; i++) {
        double rest = (double)graph->node_pos[3 * (size_t)k + i] - (double)graph->node_pos[3 * (size_t)j + i];
        edge[i] = rest + PRIOR * hidden * ((double)prior->edges[e][i] - rest);
    }
    return prior->is_link[e / 2] ? fmax(LINK_SEEN, hidden) : 1;
}

void npg_prior_count(const npg_occlusion_prior *prior, float *since, const float *before, size_t node_count)
{
    for (size_t k = 0; k < node_count; k++) since[k] = prior->seen[k] > 0.5F ? 0 : before[k] + 1;
}
