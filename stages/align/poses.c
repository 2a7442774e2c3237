/* Pose map: the way of a pose from the nodes of one reference to those of another. */
#include "align/align_internal.h"

#include <math.h>
#include <string.h>

#include "align/tracking.h"
#include "geometry/geometry.h"

static npg_status alloc_map(npg_pose_map *map, size_t count, size_t old_count)
{
    map->count = count;
    map->old_count = old_count;
    NPG_TRY(npg_alloc_array(&map->node, NPG_FOR_FIT, count, sizeof *map->node));
    NPG_TRY(npg_alloc_array(&map->weight, NPG_FOR_FIT, count, sizeof *map->weight));
    return npg_alloc_array(&map->old_pos, NPG_FOR_FIT, old_count, 3 * sizeof(float));
}

void npg_pose_map_close(npg_pose_map *map)
{
    npg_release(&map->node);
    npg_release(&map->weight);
    npg_release(&map->old_pos);
    *map = (npg_pose_map){0};
}

/* The corner of the face that is nearest to the place. */
static size_t nearest_corner(const npg_surface_hit *hit, const npg_mesh *mesh)
{
    size_t best = 0;
    for (size_t c = 1; c < 3; c++)
        if (hit->weights[c] > hit->weights[best]) best = c;
    return mesh->faces[3 * (size_t)hit->face + best];
}

static npg_status hang(npg_pose_map *map, const npg_graph *old, const npg_mesh *mesh, const npg_graph *graph)
{
    npg_surface_hit *hits;
    NPG_TRY(npg_alloc_array(&hits, NPG_FOR_FIT, map->count, sizeof *hits));
    npg_status status = npg_mesh_closest(hits, mesh, graph->node_pos, map->count);
    for (size_t k = 0; k < map->count && !status; k++) {
        size_t v = nearest_corner(&hits[k], mesh);
        memcpy(map->node[k], old->vert_node + v * NPG_GRAPH_BIND, sizeof map->node[k]);
        memcpy(map->weight[k], old->vert_weight + v * NPG_GRAPH_BIND, sizeof map->weight[k]);
    }
    npg_release(&hits);
    return status;
}

npg_status npg_pose_map_open(npg_pose_map *map, const npg_tracker *from, const npg_tracker *to)
{
    const npg_graph *old = npg_tracker_graph(from), *graph = npg_tracker_graph(to);
    *map = (npg_pose_map){0};
    npg_status status = alloc_map(map, graph->node_count, old->node_count);
    if (!status) memcpy(map->old_pos, old->node_pos, old->node_count * 3 * sizeof(float));
    if (!status) status = hang(map, old, npg_tracker_reference(from), graph);
    if (status) npg_pose_map_close(map);
    return status;
}

/* Add what an old node makes of a new one at rest, by its weight. */
static void add_node(double out[NPG_POSE_SIZE], const double *pose, const float *old, const float *rest,
                     double weight)
{
    double arm[3];
    npg_vec3_between(arm, old, rest);
    for (int i = 0; i < 9; i++) out[i] += weight * pose[i];
    for (int i = 0; i < 3; i++) {
        double moved = npg_vec3_dot(pose + 3 * i, arm) + (double)old[i] + pose[9 + i];
        out[9 + i] += weight * (moved - (double)rest[i]);
    }
}

void npg_pose_map_apply(const npg_pose_map *map, const npg_tracker *to, double *out, const double *pose)
{
    const float *rest = npg_tracker_graph(to)->node_pos;
    for (size_t k = 0; k < map->count; k++, out += NPG_POSE_SIZE, rest += 3) {
        memset(out, 0, NPG_POSE_SIZE * sizeof *out);
        for (int b = 0; b < NPG_GRAPH_BIND && map->node[k][b] != UINT32_MAX; b++) {
            size_t j = map->node[k][b];
            add_node(out, pose + j * NPG_POSE_SIZE, map->old_pos + 3 * j, rest, (double)map->weight[k][b]);
        }
        npg_pose_straighten(out);
    }
}

/* ---- as a block: counts, nodes, weights, positions ---- */

npg_status npg_pose_map_pack(const npg_pose_map *map, unsigned char **bytes, size_t *size)
{
    const uint64_t counts[2] = {map->count, map->old_count};
    size_t nodes = map->count * sizeof *map->node, weights = map->count * sizeof *map->weight,
           places = map->old_count * 3 * sizeof(float);
    *size = sizeof counts + nodes + weights + places;
    NPG_TRY(npg_alloc(bytes, NPG_FOR_FIT, *size));
    unsigned char *at = *bytes;
    memcpy(at, counts, sizeof counts);
    memcpy(at += sizeof counts, map->node, nodes);
    memcpy(at += nodes, map->weight, weights);
    memcpy(at + weights, map->old_pos, places);
    return NPG_OK;
}

/* Every new node hangs on old ones that are there, on one at least. */
static bool hangs_well(const npg_pose_map *map)
{
    for (size_t k = 0; k < map->count; k++)
        for (int b = 0; b < NPG_GRAPH_BIND; b++) {
            uint32_t old = map->node[k][b];
            if (old >= map->old_count && (old != UINT32_MAX || !b)) return false;
        }
    return true;
}

npg_status npg_pose_map_unpack(npg_pose_map *map, const unsigned char *bytes, size_t size)
{
    uint64_t counts[2] = {0, 0};
    *map = (npg_pose_map){0};
    if (size >= sizeof counts) memcpy(counts, bytes, sizeof counts);
    size_t each = sizeof *map->node + sizeof *map->weight, place = 3 * sizeof(float);
    bool is_sane = counts[0] && counts[0] < size / each + 1 && counts[1] < size / place + 1;
    if (!is_sane || size != sizeof counts + counts[0] * each + counts[1] * place)
        return npg_error(NPG_BAD_INPUT, "the state to resume from has no poses to start from");
    npg_status status = alloc_map(map, counts[0], counts[1]);
    if (!status) {
        const unsigned char *at = bytes + sizeof counts;
        memcpy(map->node, at, counts[0] * sizeof *map->node);
        memcpy(map->weight, at += counts[0] * sizeof *map->node, counts[0] * sizeof *map->weight);
        if (counts[1]) memcpy(map->old_pos, at + counts[0] * sizeof *map->weight, counts[1] * place);
        if (!hangs_well(map))
            status = npg_error(NPG_BAD_INPUT, "the state to resume from hangs nodes on poses that it lacks");
    }
    if (status) npg_pose_map_close(map);
    return status;
}
