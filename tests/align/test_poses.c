/* Poses: kept on disk from one pass to the next, and carried from one reference's nodes to another's. */
#include <fcntl.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "align/poses.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/group_folder.h"
#include "tests/support/shapes.h"

enum { NODES = 5, NUMBERS = NODES * NPG_POSE_SIZE };

#define RECORD_BYTES (8 + NUMBERS * (off_t)sizeof(float))

static void make_pose(double pose[NUMBERS], uint64_t seed)
{
    shape_random random = {seed};
    for (int i = 0; i < NUMBERS; i++) pose[i] = shape_gauss(&random);
}

static void assert_pose(npg_poses *poses, int64_t index, uint64_t seed)
{
    double got[NUMBERS], wanted[NUMBERS];
    bool is_there = false;
    make_pose(wanted, seed);
    assert_int_equal(npg_poses_get(poses, index, got, &is_there), NPG_OK);
    assert_true(is_there);
    for (int i = 0; i < NUMBERS; i++) assert_true(got[i] == (double)(float)wanted[i]);
}

static void assert_absent(npg_poses *poses, int64_t index)
{
    double got[NUMBERS];
    bool is_there = true;
    assert_int_equal(npg_poses_get(poses, index, got, &is_there), NPG_OK);
    assert_false(is_there);
}

/* Frames 2 and 0, in this order, and 2 again. */
static void put_some(npg_poses *poses)
{
    const int64_t frames[3] = {2, 0, 2};
    const uint64_t seeds[3] = {9, 1, 3};
    for (int i = 0; i < 3; i++) {
        double pose[NUMBERS];
        make_pose(pose, seeds[i]);
        assert_int_equal(npg_poses_put(poses, frames[i], pose), NPG_OK);
    }
}

static void check_some(npg_poses *poses)
{
    assert_int_equal(npg_poses_nodes(poses), NODES);
    assert_pose(poses, 2, 3);
    assert_pose(poses, 0, 1);
    assert_absent(poses, 1);
    assert_absent(poses, 3);
    assert_absent(poses, 1000000);
}

static const char *made_file(const char *name)
{
    npg_poses *poses;
    const char *path = in_folder(&folder, name);
    assert_int_equal(npg_poses_create(&poses, path, NODES), NPG_OK);
    put_some(poses);
    assert_int_equal(npg_poses_sync(poses), NPG_OK);
    check_some(poses);
    npg_poses_close(&poses);
    assert_null(poses);
    return path;
}

static void what_was_put_is_read_back(void **state)
{
    npg_poses *poses;
    const char *path = made_file("poses.bin");
    (void)state;
    assert_int_equal(npg_poses_open(&poses, path, NODES), NPG_OK);
    check_some(poses);
    npg_poses_close(&poses);
    assert_int_equal(npg_poses_create(&poses, path, NODES), NPG_OK); /* empties what is there */
    assert_absent(poses, 2);
    npg_poses_close(&poses);
}

static void a_file_needs_no_name(void **state)
{
    npg_poses *poses;
    (void)state;
    assert_int_equal(npg_poses_create(&poses, NULL, NODES), NPG_OK);
    put_some(poses);
    assert_int_equal(npg_poses_sync(poses), NPG_OK);
    check_some(poses);
    npg_poses_close(&poses);
}

static void a_missing_file_is_bad_input(void **state)
{
    npg_poses *poses;
    (void)state;
    assert_int_equal(npg_poses_open(&poses, in_folder(&folder, "nowhere.bin"), NODES), NPG_BAD_INPUT);
    assert_null(poses);
    assert_non_null(strstr(npg_error_text(), "nowhere.bin"));
}

static void assert_damaged(const char *path, int64_t index)
{
    npg_poses *poses;
    double got[NUMBERS];
    bool is_there;
    assert_int_equal(npg_poses_open(&poses, path, NODES), NPG_OK);
    assert_int_equal(npg_poses_get(poses, index, got, &is_there), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), path));
    npg_poses_close(&poses);
}

/* Of the checksum, of the first number, of the last one. */
static void a_changed_byte_is_noticed_and_the_file_named(void **state)
{
    const off_t places[3] = {0, 8, RECORD_BYTES - 1};
    (void)state;
    for (int i = 0; i < 3; i++) {
        const char *path = made_file("changed.bin");
        unsigned char byte;
        int fd = open(path, O_RDWR);
        assert_int_equal(pread(fd, &byte, 1, 2 * RECORD_BYTES + places[i]), 1);
        byte ^= 0x10;
        assert_int_equal(pwrite(fd, &byte, 1, 2 * RECORD_BYTES + places[i]), 1);
        close(fd);
        assert_damaged(path, 2);
    }
}

static void a_record_that_was_cut_is_noticed(void **state)
{
    const char *path = made_file("cut.bin");
    (void)state;
    assert_int_equal(truncate(path, 3 * RECORD_BYTES - 1), 0);
    assert_damaged(path, 2);
}

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

/* ---- the map as a block ---- */

static npg_pose_map made_map(void)
{
    npg_tracker *trackers[2];
    npg_pose_map map;
    open_trackers(trackers);
    assert_int_equal(npg_pose_map_open(&map, trackers[0], trackers[1]), NPG_OK);
    for (int i = 0; i < 2; i++) npg_tracker_close(&trackers[i]);
    return map;
}

static void a_packed_map_is_the_same_map(void **state)
{
    npg_pose_map map = made_map(), back;
    unsigned char *bytes;
    size_t size;
    (void)state;
    assert_int_equal(npg_pose_map_pack(&map, &bytes, &size), NPG_OK);
    assert_int_equal(npg_pose_map_unpack(&back, bytes, size), NPG_OK);
    assert_int_equal(back.count, map.count);
    assert_int_equal(back.old_count, map.old_count);
    assert_memory_equal(back.node, map.node, map.count * sizeof *map.node);
    assert_memory_equal(back.weight, map.weight, map.count * sizeof *map.weight);
    assert_memory_equal(back.old_pos, map.old_pos, map.old_count * 3 * sizeof(float));
    npg_pose_map_close(&back);
    npg_pose_map_close(&map);
    npg_release(&bytes);
}

static void assert_refused(const unsigned char *bytes, size_t size)
{
    npg_pose_map map;
    assert_int_equal(npg_pose_map_unpack(&map, bytes, size), NPG_BAD_INPUT);
    assert_null(map.node);
    assert_null(map.weight);
    assert_null(map.old_pos);
}

static void every_cut_of_a_packed_map_is_refused(void **state)
{
    npg_pose_map map = made_map();
    unsigned char *bytes;
    size_t size;
    (void)state;
    assert_int_equal(npg_pose_map_pack(&map, &bytes, &size), NPG_OK);
    npg_pose_map_close(&map);
    for (size_t cut = 0; cut < size; cut++) assert_refused(bytes, cut);
    npg_release(&bytes);
}

/* Nodes that the poses don't have would be read from behind their end. */
static void a_map_to_nodes_that_are_not_there_is_refused(void **state)
{
    npg_pose_map map = made_map();
    unsigned char *bytes;
    size_t size;
    const uint32_t wrong[2] = {(uint32_t)map.old_count, UINT32_MAX};
    (void)state;
    assert_int_equal(npg_pose_map_pack(&map, &bytes, &size), NPG_OK);
    for (int i = 0; i < 2; i++) {
        memcpy(bytes + 16, &wrong[i], sizeof wrong[i]); /* a new node's first old one; there must be one */
        assert_refused(bytes, size);
    }
    npg_pose_map_close(&map);
    npg_release(&bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_was_put_is_read_back),
        cmocka_unit_test(a_file_needs_no_name),
        cmocka_unit_test(a_missing_file_is_bad_input),
        cmocka_unit_test(a_changed_byte_is_noticed_and_the_file_named),
        cmocka_unit_test(a_record_that_was_cut_is_noticed),
        cmocka_unit_test(a_rigid_motion_stays_one),
        cmocka_unit_test(a_packed_map_is_the_same_map),
        cmocka_unit_test(every_cut_of_a_packed_map_is_refused),
        cmocka_unit_test(a_map_to_nodes_that_are_not_there_is_refused),
    };
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
