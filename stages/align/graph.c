/* Graph: choosing nodes and weights along the surface. */
#include "align/graph.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/mesh_tools.h"
#include "pipeline/order.h"
#include "pipeline/parallel.h"

#define REACH 2.5 /* radii within which a node carries a vertex */

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

static void close_walk(walk *w)
{
    void *all[] = {&w->length, &w->dist, &w->heap, &w->where, &w->seen};
    npg_mesh_neighbours_close(&w->around);
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) npg_release(all[i]);
}

static npg_status open_walk(walk *w, const npg_mesh *mesh)
{
    size_t n = w->vert_count = mesh->vert_count;
    npg_status status = npg_mesh_neighbours_open(&w->around, mesh);
    if (!status)
        status = npg_alloc_array(&w->length, NPG_FOR_MESH, (size_t)w->around.start[n] + 1, sizeof(float));
    if (!status) status = npg_alloc_array(&w->dist, NPG_FOR_MESH, n, sizeof(float));
    if (!status) status = npg_alloc_array(&w->heap, NPG_FOR_MESH, n, sizeof(uint32_t));
    if (!status) status = npg_alloc_array(&w->where, NPG_FOR_MESH, n, sizeof(uint32_t));
    if (!status) status = npg_alloc_array(&w->seen, NPG_FOR_MESH, n, sizeof(uint32_t));
    if (!status) measure_edges(w, mesh);
    for (size_t v = 0; v < n && !status; v++) w->dist[v] = INFINITY;
    return status;
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
static npg_status choose_nodes(npg_graph *graph, float *beyond, walk *w, const npg_mesh *mesh)
{
    size_t capacity = 0;
    uint8_t *covered;
    NPG_TRY(npg_alloc_array(&covered, NPG_FOR_MESH, mesh->vert_count, 1));
    npg_status status = NPG_OK;
    for (size_t v = 0; v < mesh->vert_count && !status; v++) {
        if (covered[v]) continue;
        status =
            npg_grow(&graph->node_pos, &capacity, graph->node_count + 1, 3 * sizeof(float), NPG_FOR_MESH);
        if (status) break;
        memcpy(graph->node_pos + 3 * graph->node_count, mesh->vert_pos + 3 * v, 3 * sizeof(float));
        walk_from(w, (uint32_t)v, (float)(REACH * graph->radius));
        for (size_t i = 0; i < w->seen_count; i++) {
            uint32_t u = w->seen[i];
            if (w->dist[u] <= (float)graph->radius) covered[u] = 1;
            offer_node(graph, beyond, u, (uint32_t)graph->node_count, w->dist[u]);
        }
        graph->node_count++;
    }
    npg_release(&covered);
    return status;
}

static npg_status connect_nodes(npg_graph *graph)
{
    size_t count = 0, kept = 0, most = graph->vert_count * NPG_GRAPH_BIND * (NPG_GRAPH_BIND - 1) / 2;
    NPG_TRY(npg_alloc_array(&graph->edges, NPG_FOR_MESH, most + 1, sizeof *graph->edges));
    for (size_t v = 0; v < graph->vert_count; v++) {
        const uint32_t *n = graph->vert_node + v * NPG_GRAPH_BIND;
        for (int i = 0; i < NPG_GRAPH_BIND; i++)
            for (int j = i + 1; j < NPG_GRAPH_BIND; j++) {
                if (n[i] == UINT32_MAX || n[j] == UINT32_MAX) continue;
                graph->edges[count][0] = n[i] < n[j] ? n[i] : n[j];
                graph->edges[count++][1] = n[i] < n[j] ? n[j] : n[i];
            }
    }
    qsort(graph->edges, count, sizeof *graph->edges, npg_order_pair);
    for (size_t e = 0; e < count; e++)
        if (!kept || npg_order_pair(graph->edges[e], graph->edges[kept - 1])) {
            uint32_t a = graph->edges[e][0], b = graph->edges[e][1];
            graph->edges[kept][0] = a;
            graph->edges[kept++][1] = b;
        }
    graph->edge_count = kept;
    return NPG_OK;
}

npg_status npg_graph_open(npg_graph **out, const npg_mesh *mesh, size_t node_target)
{
    npg_graph *graph;
    float *beyond = NULL;
    walk w = {0};
    *out = NULL;
    NPG_REQUIRE(mesh && mesh->vert_count && node_target);
    NPG_TRY(npg_alloc(&graph, NPG_FOR_MESH, sizeof *graph));
    graph->vert_count = mesh->vert_count;
    /* 0.7: set by trial, so that the greedy choice of nodes a radius apart ends near node_target of them. */
    graph->radius = sqrt(npg_mesh_area(mesh) / (0.7 * (double)node_target));
    size_t bound = mesh->vert_count * NPG_GRAPH_BIND;
    npg_status status = npg_alloc_array(&graph->vert_node, NPG_FOR_MESH, bound, sizeof(uint32_t));
    if (!status) status = npg_alloc_array(&graph->vert_weight, NPG_FOR_MESH, bound, sizeof(float));
    for (size_t i = 0; !status && i < bound; i++) graph->vert_node[i] = UINT32_MAX;
    if (!status) status = open_walk(&w, mesh);
    if (!status) status = npg_alloc_array(&beyond, NPG_FOR_MESH, mesh->vert_count, sizeof *beyond);
    for (size_t v = 0; !status && v < mesh->vert_count; v++) beyond[v] = (float)(REACH * graph->radius);
    if (!status) status = choose_nodes(graph, beyond, &w, mesh);
    if (!status) status = connect_nodes(graph);
    if (!status) turn_to_weights(graph, beyond);
    npg_release(&beyond);
    close_walk(&w);
    if (status) npg_graph_close(&graph);
    *out = graph;
    return status;
}

static npg_status take_nodes(npg_graph *part, const npg_graph *whole)
{
    NPG_TRY(npg_alloc_array(&part->node_pos, NPG_FOR_MESH, whole->node_count, 3 * sizeof(float)));
    NPG_TRY(npg_alloc_array(&part->edges, NPG_FOR_MESH, whole->edge_count + 1, sizeof *part->edges));
    memcpy(part->node_pos, whole->node_pos, whole->node_count * 3 * sizeof(float));
    memcpy(part->edges, whole->edges, whole->edge_count * sizeof *part->edges);
    part->node_count = whole->node_count;
    part->edge_count = whole->edge_count;
    part->radius = whole->radius;
    return NPG_OK;
}

static npg_status take_bindings(npg_graph *part, const npg_graph *whole, const uint32_t *verts, size_t count)
{
    const size_t size = NPG_GRAPH_BIND;
    NPG_TRY(npg_alloc_array(&part->vert_node, NPG_FOR_MESH, count, size * sizeof *part->vert_node));
    NPG_TRY(npg_alloc_array(&part->vert_weight, NPG_FOR_MESH, count, size * sizeof *part->vert_weight));
    for (size_t i = 0; i < size * count; i++) {
        size_t from = verts[i / size] * size + i % size;
        part->vert_node[i] = whole->vert_node[from];
        part->vert_weight[i] = whole->vert_weight[from];
    }
    part->vert_count = count;
    return NPG_OK;
}

npg_status npg_graph_take(npg_graph **out, const npg_graph *whole, const uint32_t *verts, size_t count)
{
    npg_graph *part;
    *out = NULL;
    NPG_TRY(npg_alloc(&part, NPG_FOR_MESH, sizeof *part));
    npg_status status = take_nodes(part, whole);
    if (!status) status = take_bindings(part, whole, verts, count);
    if (status) npg_graph_close(&part);
    *out = part;
    return status;
}

void npg_graph_close(npg_graph **slot)
{
    if (!slot || !*slot) return;
    npg_release(&(*slot)->node_pos);
    npg_release(&(*slot)->vert_node);
    npg_release(&(*slot)->vert_weight);
    npg_release(&(*slot)->edges);
    npg_release(slot);
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
