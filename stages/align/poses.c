/* Pose map: the way of a pose from the nodes of one reference to those of another. */
#include "align/align_internal.h"

#include <string.h>

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

/* ---- as blocks ---- */

#define BLOCK_MAP "align.map" /* counts */

enum { MAP_PARTS = 3 };

static void list_arrays(npg_store_array list[MAP_PARTS], const npg_pose_map *map)
{
    const npg_store_array all[MAP_PARTS] = {
        {"align.nodes", offsetof(npg_pose_map, node), map->count, sizeof *map->node},
        {"align.weights", offsetof(npg_pose_map, weight), map->count, sizeof *map->weight},
        {"align.places", offsetof(npg_pose_map, old_pos), map->old_count, 3 * sizeof(float)}};
    memcpy(list, all, sizeof all);
}

npg_status npg_pose_map_save(const npg_pose_map *map, npg_store *store)
{
    const uint64_t counts[2] = {map->count, map->old_count};
    npg_store_array list[MAP_PARTS];
    list_arrays(list, map);
    NPG_TRY(npg_store_put(store, BLOCK_MAP, counts, sizeof counts));
    return npg_store_put_arrays(store, map, list, MAP_PARTS);
}

/* Every new node hangs on old ones that are there, on one at least. */
static bool hangs_well(const npg_pose_map *map)
{
    if (!map->node || !map->weight || !map->old_pos) return false;
    for (size_t k = 0; k < map->count; k++)
        for (int b = 0; b < NPG_GRAPH_BIND; b++) {
            uint32_t old = map->node[k][b];
            if (old >= map->old_count && (old != UINT32_MAX || !b)) return false;
        }
    return true;
}

npg_status npg_pose_map_load(npg_pose_map *map, const npg_record *record)
{
    uint64_t counts[2];
    size_t size;
    npg_store_array list[MAP_PARTS];
    *map = (npg_pose_map){0};
    if (!npg_record_find(record, BLOCK_MAP, &size)) return NPG_OK;
    NPG_TRY(npg_record_get(record, BLOCK_MAP, counts, sizeof counts));
    map->count = counts[0];
    map->old_count = counts[1];
    list_arrays(list, map);
    npg_status status = npg_record_get_arrays(record, map, list, MAP_PARTS, NPG_FOR_FIT);
    if (!status && !hangs_well(map))
        status = npg_error(NPG_BAD_INPUT, "the state to resume from hangs nodes on poses that it lacks");
    if (status) npg_pose_map_close(map);
    return status;
}
