/* Component links: pieces join the first node's, nearest first. */
#include "track/track.h"

#include <math.h>
#include <stdlib.h>

#include "geometry/geometry.h"
#include "pipeline/memory.h"
#include "pipeline/order.h"
#include "track/track_internal.h"

#define NONE UINT32_MAX

typedef struct joining {
    const float *node_pos;
    size_t node_count;
    uint32_t *piece;   /* K: the same for all nodes of a piece */
    uint32_t *nearest; /* K: the nearest node that has joined */
    float *dist_sq;    /* K: to it; infinite: none, -1: has joined or is linked itself */
    uint32_t (*links)[2];
    size_t link_count, capacity;
} joining;

static npg_status open_joining(joining *j, npg_arena *scratch, const uint32_t (*edges)[2], size_t edge_count)
{
    j->piece = npg_arena_take(scratch, j->node_count, sizeof *j->piece);
    j->nearest = npg_arena_take(scratch, j->node_count, sizeof *j->nearest);
    j->dist_sq = npg_arena_take(scratch, j->node_count, sizeof *j->dist_sq);
    NPG_TRY(npg_arena_status(scratch));
    for (size_t k = 0; k < j->node_count; k++) {
        j->piece[k] = (uint32_t)k;
        j->dist_sq[k] = INFINITY;
    }
    for (size_t e = 0; e < edge_count; e++) npg_set_join(j->piece, edges[e][0], edges[e][1]);
    for (size_t k = 0; k < j->node_count; k++) j->piece[k] = npg_set_root(j->piece, (uint32_t)k);
    return NPG_OK;
}

/* The others learn how far it is to a node that has joined. */
static void offer(joining *j, uint32_t to)
{
    const float *b = j->node_pos + 3 * (size_t)to;
    for (size_t k = 0; k < j->node_count; k++) {
        const float *a = j->node_pos + 3 * k;
        float dist_sq =
            (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]);
        if (dist_sq >= j->dist_sq[k]) continue;
        j->dist_sq[k] = dist_sq;
        j->nearest[k] = to;
    }
}

static void join_piece(joining *j, uint32_t piece)
{
    for (size_t k = 0; k < j->node_count; k++)
        if (j->piece[k] == piece) j->dist_sq[k] = -1;
    for (size_t k = 0; k < j->node_count; k++)
        if (j->piece[k] == piece) offer(j, (uint32_t)k);
}

/* The nearest node outside, of one piece or (NONE) of any. */
static uint32_t nearest_outside(const joining *j, uint32_t piece)
{
    uint32_t best = NONE;
    for (size_t k = 0; k < j->node_count; k++)
        if (j->dist_sq[k] >= 0 && (piece == NONE || j->piece[k] == piece) &&
            (best == NONE || j->dist_sq[k] < j->dist_sq[best]))
            best = (uint32_t)k;
    return best;
}

/* By as many links as nodes carry a vertex: they say how it is turned, too. */
static npg_status link_piece(joining *j, uint32_t node)
{
    uint32_t piece = j->piece[node];
    for (int i = 0; i < NPG_GRAPH_BIND && node != NONE; i++) {
        uint32_t to = j->nearest[node];
        NPG_TRY(npg_grow(&j->links, &j->capacity, j->link_count + 1, sizeof *j->links, NPG_FOR_MESH));
        j->links[j->link_count][0] = node < to ? node : to;
        j->links[j->link_count++][1] = node < to ? to : node;
        j->dist_sq[node] = -1;
        node = nearest_outside(j, piece);
    }
    join_piece(j, piece);
    return NPG_OK;
}

npg_status npg_component_links_find(uint32_t (**links)[2], size_t *link_count, const float *node_pos,
                                    size_t node_count, const uint32_t (*edges)[2], size_t edge_count)
{
    joining j = {.node_pos = node_pos, .node_count = node_count};
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    npg_status status = open_joining(&j, &scratch, edges, edge_count);
    if (!status) join_piece(&j, j.piece[0]);
    for (uint32_t next; !status && (next = nearest_outside(&j, NONE)) != NONE;) status = link_piece(&j, next);
    npg_arena_release(&scratch);
    if (status) npg_release(&j.links);
    if (j.link_count) qsort(j.links, j.link_count, sizeof *j.links, npg_order_pair);
    *links = j.links;
    *link_count = status ? 0 : j.link_count;
    return status;
}
