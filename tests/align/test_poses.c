/* Poses carried from one reference's nodes to another's. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "align/align_internal.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/group_folder.h"

/* ---- from one graph to another ---- */

static const npg_tracker_settings settings = {120, 800, 10, 0.1, 0.02};
static const double turn[9] = {0.36, 0.48, -0.8, -0.8, 0.6, 0, 0.48, 0.64, 0.6}; /* a rotation */
static const double way[3] = {0.3, -0.2, 0.1};

static void move_rigidly(double out[3], const float in[3])
{
    for (int a = 0; a < 3; a++) {
        out[a] = way[a];
        for (int b = 0; b < 3; b++) out[a] += turn[3 * a + b] * (double)in[b];
    }
}

/* All nodes in the same motion. */
static double *rigid_pose(const npg_tracker *tracker)
{
    const npg_graph *graph = npg_tracker_graph(tracker);
    double *pose;
    assert_int_equal(npg_alloc_array(&pose, NPG_FOR_RUN, graph->node_count, NPG_POSE_SIZE * sizeof *pose),
                     NPG_OK);
    for (size_t k = 0; k < graph->node_count; k++) {
        double there[3];
        move_rigidly(there, graph->node_pos + 3 * k);
        memcpy(pose + NPG_POSE_SIZE * k, turn, sizeof turn);
        for (size_t a = 0; a < 3; a++)
            pose[NPG_POSE_SIZE * k + 9 + a] = there[a] - (double)graph->node_pos[3 * k + a];
    }
    return pose;
}

/* Two references of the same ball, with other vertices and other nodes. */
static void open_trackers(npg_tracker *trackers[2])
{
    for (uint32_t i = 0; i < 2; i++) {
        npg_mesh *ball = ball_mesh(40 - 9 * i, 50 - 13 * i);
        npg_tracker_settings own = settings;
        own.nodes -= 40 * i;
        assert_int_equal(npg_tracker_open(&trackers[i], ball, &own), NPG_OK);
        npg_mesh_unref(&ball);
    }
    assert_int_not_equal(npg_tracker_node_count(trackers[0]), npg_tracker_node_count(trackers[1]));
}

static void a_rigid_motion_stays_one(void **state)
{
    npg_tracker *trackers[2];
    npg_pose_map map;
    float *verts;
    (void)state;
    open_trackers(trackers);
    const npg_mesh *mesh = npg_tracker_reference(trackers[1]);
    double *old = rigid_pose(trackers[0]), *pose = rigid_pose(trackers[1]);
    memset(pose, 0, npg_tracker_node_count(trackers[1]) * NPG_POSE_SIZE * sizeof *pose);
    assert_int_equal(npg_alloc_array(&verts, NPG_FOR_RUN, mesh->vert_count, 3 * sizeof(float)), NPG_OK);
    assert_int_equal(npg_pose_map_open(&map, trackers[0], trackers[1]), NPG_OK);
    npg_pose_map_apply(&map, trackers[1], pose, old);
    npg_tracker_vertices(trackers[1], verts, pose);
    for (size_t v = 0; v < mesh->vert_count; v++) {
        double there[3];
        move_rigidly(there, mesh->vert_pos + 3 * v);
        for (size_t a = 0; a < 3; a++) assert_true(fabs((double)verts[3 * v + a] - there[a]) < 1e-3);
    }
    npg_pose_map_close(&map);
    npg_release(&old);
    npg_release(&pose);
    npg_release(&verts);
    for (int i = 0; i < 2; i++) npg_tracker_close(&trackers[i]);
}

/* ---- the map as blocks ---- */

static npg_pose_map made_map(void)
{
    npg_tracker *trackers[2];
    npg_pose_map map;
    open_trackers(trackers);
    assert_int_equal(npg_pose_map_open(&map, trackers[0], trackers[1]), NPG_OK);
    for (int i = 0; i < 2; i++) npg_tracker_close(&trackers[i]);
    return map;
}

/* What comes back of a map from a state on disk. */
static npg_status stored(npg_pose_map *back, const npg_pose_map *map)
{
    npg_store *store;
    npg_record *record;
    assert_int_equal(npg_store_open_nameless(&store, NULL), NPG_OK);
    npg_store_begin(store, "state", 0, 0);
    assert_int_equal(npg_store_end(store, npg_pose_map_save(map, store), false), NPG_OK);
    assert_int_equal(npg_store_read(store, &record, "state", 0, 0), NPG_OK);
    npg_status status = npg_pose_map_load(back, record);
    npg_record_close(&record);
    npg_store_close(&store);
    return status;
}

static void a_stored_map_is_the_same_map(void **state)
{
    npg_pose_map map = made_map(), back;
    (void)state;
    assert_int_equal(stored(&back, &map), NPG_OK);
    assert_int_equal(back.count, map.count);
    assert_int_equal(back.old_count, map.old_count);
    assert_memory_equal(back.node, map.node, map.count * sizeof *map.node);
    assert_memory_equal(back.weight, map.weight, map.count * sizeof *map.weight);
    assert_memory_equal(back.old_pos, map.old_pos, map.old_count * 3 * sizeof(float));
    npg_pose_map_close(&back);
    npg_pose_map_close(&map);
}

/* Nodes that the poses don't have would be read from behind their end. */
static void a_map_to_nodes_that_are_not_there_is_refused(void **state)
{
    npg_pose_map map = made_map(), back;
    const uint32_t wrong[2] = {(uint32_t)map.old_count, UINT32_MAX};
    (void)state;
    for (int i = 0; i < 2; i++) {
        map.node[0][0] = wrong[i]; /* there must be one */
        assert_int_equal(stored(&back, &map), NPG_BAD_INPUT);
        assert_null(back.node);
        assert_null(back.weight);
        assert_null(back.old_pos);
    }
    npg_pose_map_close(&map);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_rigid_motion_stays_one),
        cmocka_unit_test(a_stored_map_is_the_same_map),
        cmocka_unit_test(a_map_to_nodes_that_are_not_there_is_refused),
    };
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
