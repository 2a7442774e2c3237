/* Tracker: poses stay rotations, however many frames they are carried on; a fine reference is aligned by few
 * of its vertices, and all of them move. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "align/tracker.h"
#include "geometry/thin.h"
#include "tests/support/ball_mesh.h"

static void turn_about_z(double *pose, double angle)
{
    npg_pose_rest(pose, 1);
    pose[0] = pose[4] = cos(angle);
    pose[1] = -sin(angle);
    pose[3] = sin(angle);
    pose[9] = angle;
}

static void extrapolation_goes_on_for_ever(void **state)
{
    enum { FRAMES = 2000 };
    double poses[3][NPG_POSE_SIZE], wanted[NPG_POSE_SIZE];
    (void)state;
    turn_about_z(poses[0], 0.0);
    turn_about_z(poses[1], 0.01);
    for (int frame = 2; frame < FRAMES; frame++) {
        npg_pose_extrapolate(poses[2], poses[1], poses[0], 1);
        memcpy(poses[0], poses[1], sizeof poses[0]);
        memcpy(poses[1], poses[2], sizeof poses[1]);
    }
    turn_about_z(wanted, 0.01 * (FRAMES - 1));
    for (int i = 0; i < NPG_POSE_SIZE; i++) assert_true(fabs(poses[1][i] - wanted[i]) < 1e-6);
}

static void thin_meshes_are_made_of_the_whole_one_s_vertices(void **state)
{
    npg_thin *thin;
    npg_manifold m;
    npg_mesh *ball = ball_mesh(60, 80);
    (void)state;
    assert_int_equal(npg_thin_open(&thin, ball, 1000), NPG_OK);
    assert_in_range(thin->mesh->vert_count, 900, 1010);
    for (size_t t = 0; t < thin->mesh->vert_count; t++) {
        size_t v = thin->vertex[t];
        assert_true(v < ball->vert_count && (!t || v > thin->vertex[t - 1]));
        assert_memory_equal(thin->mesh->vert_pos + 3 * t, ball->vert_pos + 3 * v, 3 * sizeof(float));
        assert_memory_equal(thin->mesh->vert_normals + 3 * t, ball->vert_normals + 3 * v, 3 * sizeof(float));
    }
    assert_int_equal(npg_mesh_manifold(&m, thin->mesh), NPG_OK);
    assert_int_equal(m.border_edges + m.crowded_edges + m.misoriented_edges + m.unused_vertices, 0);
    assert_true(fabs(npg_mesh_volume(thin->mesh) / npg_mesh_volume(ball) - 1) < 0.02);
    npg_thin_close(&thin);
    assert_int_equal(npg_thin_open(&thin, ball, 0), NPG_OK);
    assert_int_equal(thin->mesh->vert_count, ball->vert_count);
    assert_memory_equal(thin->mesh->faces, ball->faces, 3 * ball->face_count * sizeof *ball->faces);
    npg_thin_close(&thin);
    npg_mesh_unref(&ball);
}

static void a_fine_reference_is_aligned_whole(void **state)
{
    enum { POINTS = 4000 };
    static const npg_tracker_settings settings = {200, 1500, 15, 0.1, 0.02};
    npg_mesh *ball = ball_mesh(150, 160);
    size_t v = ball->vert_count, nodes;
    npg_tracker *tracker;
    npg_tracked tracked;
    float *truth, *found, points[3 * POINTS];
    double *pose;
    (void)state;
    assert_true(v > 2 * NPG_THIN_SURFACE - 10);
    assert_int_equal(npg_tracker_open(&tracker, ball, &settings), NPG_OK);
    nodes = npg_tracker_node_count(tracker);
    assert_int_equal(npg_alloc_array(&truth, NPG_FOR_RUN, v, 3 * sizeof(float)), NPG_OK);
    assert_int_equal(npg_alloc_array(&found, NPG_FOR_RUN, v, 3 * sizeof(float)), NPG_OK);
    assert_int_equal(npg_alloc_array(&pose, NPG_FOR_RUN, nodes, NPG_POSE_SIZE * sizeof(double)), NPG_OK);
    npg_pose_rest(pose, nodes);
    pose_ball(truth, ball->vert_pos, v, 1);
    for (size_t i = 0; i < POINTS; i++) memcpy(points + 3 * i, truth + 3 * (i * 2311 % v), 3 * sizeof(float));
    const npg_tracker_cloud cloud = {.points = points, .count = POINTS};
    assert_int_equal(npg_tracker_fit(tracker, &tracked, pose, &cloud, NULL, NULL), NPG_OK);
    npg_tracker_vertices(tracker, found, pose);
    assert_true(tracked.point_dist_mean < 0.002);
    for (size_t i = 0; i < 3 * v; i++) assert_true(fabsf(found[i] - truth[i]) < 0.03f);
    npg_release(&truth);
    npg_release(&found);
    npg_release(&pose);
    npg_tracker_close(&tracker);
    npg_mesh_unref(&ball);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(extrapolation_goes_on_for_ever),
        cmocka_unit_test(thin_meshes_are_made_of_the_whole_one_s_vertices),
        cmocka_unit_test(a_fine_reference_is_aligned_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
