/* Graph: choosing nodes and weights along the surface. */
#include "track/track.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/limits.h"
#include "pipeline/order.h"
#include "pipeline/parallel.h"

/* ---- distances along edges ---- */

typedef struct walk {
    size_t vert_count;
    npg_mesh_neighbours around; /* owned                                             */
    float *length;              /* 2 E, of half-edges                                */
    float *dist;                /* V, infinity                                       */
    uint32_t *heap, *where;     /* binary heap of vertices, and each one's place + 1 */
    size_t heap_size;
    uint32_t *seen; /* vertices reached by the last walk, nearest first */
    size_t seen_count;
} walk;

static float edge_length(const npg_mesh *mesh, uint32_t a, uint32_t b)
{
    const float *p = mesh->vert_pos + 3 * (size_t)a, *q = mesh->vert_pos + 3 * (size_t)b;
    return sqrtf((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
                 (p[2] - q[2]) * (p[2] - q[2]));
}

/* Of the half-edges, in the order of the neighbours. */
static void measure_edges(walk *w, const npg_mesh *mesh)
{
    for (size_t v = 0; v < w->vert_count; v++)
        for (uint32_t k = w->around.start[v]; k < w->around.start[v + 1]; k++)
            w->length[k] = edge_length(mesh, (uint32_t)v, w->around.of[k]);
}

static npg_status open_walk(walk *w, npg_arena *scratch, const npg_mesh *mesh)
{
    size_t n = w->vert_count = mesh->vert_count;
    NPG_TRY(npg_mesh_neighbours_open(&w->around, mesh));
    w->length = npg_arena_take(scratch, w->around.start[n], sizeof(float));
    w->dist = npg_arena_take(scratch, n, sizeof(float));
    w->heap = npg_arena_take(scratch, n, sizeof(uint32_t));
    w->where = npg_arena_take(scratch, n, sizeof(uint32_t));
    w->seen = npg_arena_take(scratch, n, sizeof(uint32_t));
    NPG_TRY(npg_arena_status(scratch));
    measure_edges(w, mesh);
    for (size_t v = 0; v < n; v++) w->dist[v] = INFINITY;
    return NPG_OK;
}

static bool heap_less(const walk *w, uint32_t a, uint32_t b)
{
    return w->dist[a] < w->dist[b] || (w->dist[a] == w->dist[b] && a < b);
}

static void heap_place(walk *w, size_t at, uint32_t vertex)
{
    w->heap[at] = vertex;
    w->where[vertex] = (uint32_t)at + 1;
}

static void heap_up(walk *w, uint32_t vertex)
{
    size_t at = w->where[vertex] ? w->where[vertex] - 1 : w->heap_size++;
    for (; at > 0 && heap_less(w, vertex, w->heap[(at - 1) / 2]); at = (at - 1) / 2)
        heap_place(w, at, w->heap[(at - 1) / 2]);
    heap_place(w, at, vertex);
}

static uint32_t heap_pop(walk *w)
{
    uint32_t top = w->heap[0], last = w->heap[--w->heap_size];
    size_t at = 0;
    for (;;) {
        size_t child = 2 * at + 1;
        if (child >= w->heap_size) break;
        if (child + 1 < w->heap_size && heap_less(w, w->heap[child + 1], w->heap[child])) child++;
        if (!heap_less(w, w->heap[child], last)) break;
        heap_place(w, at, w->heap[child]);
        at = child;
    }
    if (w->heap_size) heap_place(w, at, last);
    w->where[top] = 0;
    return top;
}

/* Dijkstra from a vertex up to a distance; fills seen and dist. */
static void walk_from(walk *w, uint32_t from, float reach)
{
    for (size_t i = 0; i < w->seen_count; i++) w->dist[w->seen[i]] = INFINITY;
    w->seen_count = 0;
    w->dist[from] = 0;
    heap_up(w, from);
    while (w->heap_size) {
        uint32_t at = heap_pop(w);
        w->seen[w->seen_count++] = at;
        for (uint32_t k = w->around.start[at]; k < w->around.start[at + 1]; k++) {
            uint32_t to = w->around.of[k];
            float dist = w->dist[at] + w->length[k];
            if (dist > reach || dist >= w->dist[to]) continue;
            w->dist[to] = dist;
            heap_up(w, to);
        }
    }
}

/* ---- nodes and weights ---- */

/* Keep the nearest nodes of a vertex, nearest first; vert_weight holds distances meanwhile, `beyond` that of
 * the nearest node which is not kept. */
static void offer_node(npg_graph *graph, float *beyond, uint32_t vertex, uint32_t node, float dist)
{
    uint32_t *nodes = graph->vert_node + (size_t)vertex * NPG_GRAPH_BIND;
    float *dists = graph->vert_weight + (size_t)vertex * NPG_GRAPH_BIND;
    int at = NPG_GRAPH_BIND;
    while (at > 0 && (nodes[at - 1] == UINT32_MAX || dist < dists[at - 1])) at--;
    bool is_full = nodes[NPG_GRAPH_BIND - 1] != UINT32_MAX;
    if (is_full) beyond[vertex] = fminf(beyond[vertex], fmaxf(dist, dists[NPG_GRAPH_BIND - 1]));
    if (at == NPG_GRAPH_BIND) return;
    for (int i = NPG_GRAPH_BIND - 1; i > at; i--) {
        nodes[i] = nodes[i - 1];
        dists[i] = dists[i - 1];
    }
    nodes[at] = node;
    dists[at] = dist;
}

/* w = (1 - d / d_5)^2, d_5 the distance of the nearest node that does not carry the vertex: weights go to 0,
 * with their slope, before a node drops out, so that the surface gets no kinks there. */
static void turn_to_weights(npg_graph *graph, const float *beyond)
{
    for (size_t v = 0; v < graph->vert_count; v++) {
        float *w = graph->vert_weight + v * NPG_GRAPH_BIND, sum = 0;
        for (int i = 0; i < NPG_GRAPH_BIND; i++) {
            float share = 1 - w[i] / (beyond[v] *
                                      1.001f); /* a hair beyond: a vertex as far from all nodes keeps some */
            bool is_bound = graph->vert_node[v * NPG_GRAPH_BIND + (size_t)i] != UINT32_MAX;
            w[i] = is_bound ? share * share : 0;
            sum += w[i];
        }
        for (int i = 0; i < NPG_GRAPH_BIND; i++) w[i] /= sum;
    }
}

/* Vertices in order become nodes unless an earlier node is within a radius;
 * every node then offers itself around. */
static npg_status choose_nodes(npg_graph *graph, npg_arena *scratch, float *beyond, walk *w,
                               const npg_mesh *mesh)
{
    uint8_t *covered = npg_arena_take(scratch, mesh->vert_count, 1);
    float *places = npg_arena_take(scratch, mesh->vert_count, 3 * sizeof *places);
    NPG_TRY(npg_arena_status(scratch));
    for (size_t v = 0; v < mesh->vert_count; v++) {
        if (covered[v]) continue;
        memcpy(places + 3 * graph->node_count, mesh->vert_pos + 3 * v, 3 * sizeof(float));
        walk_from(w, (uint32_t)v, (float)(NPG_WITHIN * graph->radius));
        for (size_t i = 0; i < w->seen_count; i++) {
            uint32_t u = w->seen[i];
            if (w->dist[u] <= (float)graph->radius) covered[u] = 1;
            offer_node(graph, beyond, u, (uint32_t)graph->node_count, w->dist[u]);
        }
        graph->node_count++;
    }
    graph->node_pos = npg_arena_copy(&graph->arena, places, graph->node_count, 3 * sizeof *places);
    return npg_arena_status(&graph->arena);
}

static npg_status connect_nodes(npg_graph *graph, npg_arena *scratch)
{
    size_t count = 0, kept = 0, most = graph->vert_count * NPG_GRAPH_BIND * (NPG_GRAPH_BIND - 1) / 2;
    uint32_t(*edges)[2] = npg_arena_take(scratch, most, sizeof *edges);
    NPG_TRY(npg_arena_status(scratch));
    for (size_t v = 0; v < graph->vert_count; v++) {
        const uint32_t *n = graph->vert_node + v * NPG_GRAPH_BIND;
        for (int i = 0; i < NPG_GRAPH_BIND; i++)
            for (int j = i + 1; j < NPG_GRAPH_BIND; j++) {
                if (n[i] == UINT32_MAX || n[j] == UINT32_MAX) continue;
                edges[count][0] = n[i] < n[j] ? n[i] : n[j];
                edges[count++][1] = n[i] < n[j] ? n[j] : n[i];
            }
    }
    if (count) qsort(edges, count, sizeof *edges, npg_order_pair);
    for (size_t e = 0; e < count; e++)
        if (!kept || npg_order_pair(edges[e], edges[kept - 1]))
            memmove(edges[kept++], edges[e], sizeof *edges);
    graph->edge_count = kept;
    graph->edges = npg_arena_copy(&graph->arena, edges, kept, sizeof *edges);
    return npg_arena_status(&graph->arena);
}

/* A graph for so many vertices, which nothing carries yet. */
static npg_status open_graph(npg_graph **graph, size_t vert_count)
{
    NPG_TRY(npg_object_open(graph, NPG_FOR_MESH, sizeof **graph));
    npg_graph *g = *graph;
    g->vert_count = vert_count;
    g->vert_node = npg_arena_take(&g->arena, vert_count, NPG_GRAPH_BIND * sizeof *g->vert_node);
    g->vert_weight = npg_arena_take(&g->arena, vert_count, NPG_GRAPH_BIND * sizeof *g->vert_weight);
    return npg_arena_status(&g->arena);
}

npg_status npg_graph_open(npg_graph **out, const npg_mesh *mesh, size_t node_target)
{
    npg_graph *graph;
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    walk w = {0};
    *out = NULL;
    NPG_REQUIRE(mesh && mesh->vert_count && node_target);
    npg_status status = open_graph(&graph, mesh->vert_count);
    /* 0.7: set by trial, so that the greedy choice of nodes a radius apart ends near node_target of them. */
    if (!status) graph->radius = sqrt(npg_mesh_area(mesh) / (0.7 * (double)node_target));
    for (size_t i = 0; !status && i < mesh->vert_count * NPG_GRAPH_BIND; i++)
        graph->vert_node[i] = UINT32_MAX;
    float *beyond = npg_arena_take(&scratch, mesh->vert_count, sizeof *beyond);
    if (!status) status = open_walk(&w, &scratch, mesh);
    for (size_t v = 0; !status && v < mesh->vert_count; v++) beyond[v] = (float)(NPG_WITHIN * graph->radius);
    if (!status) status = choose_nodes(graph, &scratch, beyond, &w, mesh);
    if (!status) status = connect_nodes(graph, &scratch);
    if (!status) turn_to_weights(graph, beyond);
    npg_mesh_neighbours_close(&w.around);
    npg_arena_release(&scratch);
    if (status) npg_graph_close(&graph);
    *out = graph;
    return status;
}

npg_status npg_graph_take(npg_graph **out, const npg_graph *whole, const uint32_t *verts, size_t count)
{
    npg_graph *part;
    npg_status status = open_graph(&part, count);
    if (!status) {
        part->node_pos = npg_arena_copy(&part->arena, whole->node_pos, whole->node_count, 3 * sizeof(float));
        part->edges = npg_arena_copy(&part->arena, whole->edges, whole->edge_count, sizeof *part->edges);
        status = npg_arena_status(&part->arena);
    }
    for (size_t i = 0; i < NPG_GRAPH_BIND * count && !status; i++) {
        size_t from = verts[i / NPG_GRAPH_BIND] * (size_t)NPG_GRAPH_BIND + i % NPG_GRAPH_BIND;
        part->vert_node[i] = whole->vert_node[from];
        part->vert_weight[i] = whole->vert_weight[from];
    }
    if (!status) {
        part->node_count = whole->node_count;
        part->edge_count = whole->edge_count;
        part->radius = whole->radius;
    }
    if (status) npg_graph_close(&part);
    *out = part;
    return status;
}

void npg_graph_close(npg_graph **slot)
{
    npg_object_close(slot);
}

/* ---- poses ---- */

void npg_pose_rest(double *pose, size_t node_count)
{
    memset(pose, 0, node_count * NPG_POSE_SIZE * sizeof *pose);
    for (size_t k = 0; k < node_count; k++)
        for (size_t i = 0; i < 3; i++) pose[k * NPG_POSE_SIZE + 4 * i] = 1;
}

void npg_pose_point(double out[3], const npg_graph *graph, const double *pose, const float rest[3],
                    const uint32_t nodes[NPG_GRAPH_BIND], const float weights[NPG_GRAPH_BIND])
{
    out[0] = out[1] = out[2] = 0;
    for (int b = 0; b < NPG_GRAPH_BIND && nodes[b] != UINT32_MAX; b++) {
        const double *p = pose + nodes[b] * NPG_POSE_SIZE;
        const float *g = graph->node_pos + 3 * (size_t)nodes[b];
        double d[3], w = (double)weights[b];
        for (int i = 0; i < 3; i++) d[i] = (double)rest[i] - (double)g[i];
        for (int i = 0; i < 3; i++)
            out[i] +=
                w * (p[3 * i] * d[0] + p[3 * i + 1] * d[1] + p[3 * i + 2] * d[2] + (double)g[i] + p[9 + i]);
    }
}

void npg_pose_rows(float *rows, const npg_graph *graph, const double *pose)
{
    for (size_t k = 0; k < graph->node_count; k++) {
        const double *p = pose + k * NPG_POSE_SIZE;
        const float *g = graph->node_pos + 3 * k;
        float *row = rows + k * NPG_POSE_ROW;
        for (int i = 0; i < 3; i++) {
            double at = (double)g[i] + p[9 + i];
            for (int c = 0; c < 3; c++) {
                row[4 * c + i] = (float)p[3 * i + c];
                at -= p[3 * i + c] * (double)g[c];
            }
            row[12 + i] = (float)at;
        }
        for (int c = 0; c < 4; c++) row[4 * c + 3] = 0;
    }
}

/* The maps are mixed before they are applied. */
NPG_WIDE void npg_pose_vertices(float *restrict vert_pos, const npg_graph *graph, const float *restrict rows,
                                const float *restrict rest)
{
    for (size_t v = 0; v < graph->vert_count; v++) {
        const uint32_t *nodes = graph->vert_node + v * NPG_GRAPH_BIND;
        const float *weights = graph->vert_weight + v * NPG_GRAPH_BIND, *x = rest + 3 * v;
        float map[NPG_POSE_ROW] = {0};
        for (int b = 0; b < NPG_GRAPH_BIND && nodes[b] != UINT32_MAX; b++) {
            const float *row = rows + (size_t)nodes[b] * NPG_POSE_ROW, weight = weights[b];
            for (int i = 0; i < NPG_POSE_ROW; i++) map[i] += weight * row[i];
        }
        for (int i = 0; i < 3; i++)
            vert_pos[3 * v + (size_t)i] = map[i] * x[0] + map[4 + i] * x[1] + map[8 + i] * x[2] + map[12 + i];
    }
}
