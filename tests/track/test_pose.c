/* Pose: poses stay rotations, however many frames they are carried on; a pose is moved as a whole, and that
 * motion is found again; a pose is found from where vertices are. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "tests/support/ball_mesh.h"
#include "track/track.h"

static void turn_about_z(double *pose, double angle)
{
    npg_pose_rest(pose, 1);
    pose[0] = pose[4] = cos(angle);
    pose[1] = -sin(angle);
    pose[3] = sin(angle);
    pose[9] = angle;
}

static npg_rigid some_motion(void)
{
    npg_rigid motion = {.translation = {0.3, -2, 5}};
    double turned[NPG_POSE_SIZE];
    turn_about_z(turned, 2.5);
    memcpy(motion.rotation, turned, sizeof motion.rotation);
    return motion;
}

/* A graph of a ball, and room for two of its poses; both are the caller's. */
static void open_graph(npg_graph **graph, double **poses, npg_mesh *ball, size_t nodes)
{
    assert_int_equal(npg_graph_open(graph, ball, nodes), NPG_OK);
    assert_int_equal(
        npg_alloc_array(poses, NPG_FOR_RUN, 2 * (*graph)->node_count * NPG_POSE_SIZE, sizeof **poses),
        NPG_OK);
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

/* Every point of the surface goes where the motion takes it; undone by the motion between the two. */
static void a_pose_is_moved_as_a_whole(void **state)
{
    npg_mesh *ball = ball_mesh(20, 30);
    npg_graph *graph;
    npg_rigid motion = some_motion(), between;
    double *poses, was[3], is[3];
    (void)state;
    open_graph(&graph, &poses, ball, 40);
    size_t k = graph->node_count, size = k * NPG_POSE_SIZE;
    for (size_t i = 0; i < k; i++) turn_about_z(poses + i * NPG_POSE_SIZE, 0.1 * (double)(i % 7));
    npg_pose_move(poses + size, graph, poses, &motion);
    for (size_t v = 0; v < ball->vert_count; v++) {
        const uint32_t *nodes = graph->vert_node + v * NPG_GRAPH_BIND;
        const float *weights = graph->vert_weight + v * NPG_GRAPH_BIND;
        npg_pose_point(was, graph, poses, ball->vert_pos + 3 * v, nodes, weights);
        npg_pose_point(is, graph, poses + size, ball->vert_pos + 3 * v, nodes, weights);
        for (int r = 0; r < 3; r++) {
            double wanted = motion.translation[r];
            for (int c = 0; c < 3; c++) wanted += motion.rotation[r][c] * was[c];
            assert_true(fabs(is[r] - wanted) < 1e-5);
        }
    }
    assert_int_equal(npg_pose_between(&between, graph, poses, poses + size), NPG_OK);
    for (int r = 0; r < 3; r++) {
        assert_true(fabs(between.translation[r] - motion.translation[r]) < 1e-5);
        for (int c = 0; c < 3; c++) assert_true(fabs(between.rotation[r][c] - motion.rotation[r][c]) < 1e-5);
    }
    npg_release(&poses);
    npg_graph_close(&graph);
    npg_mesh_unref(&ball);
}

/* What a rigid motion explains is no bend; nodes that every second goes up by h and the others down by it
 * are bent by h, but for what a tilt takes of it. */
static void a_bend_is_what_no_rigid_motion_explains(void **state)
{
    npg_mesh *ball = ball_mesh(20, 30);
    npg_graph *graph;
    npg_rigid motion = some_motion();
    double *poses, bend;
    const double h = 0.05;
    (void)state;
    open_graph(&graph, &poses, ball, 200);
    size_t k = graph->node_count, size = k * NPG_POSE_SIZE;
    npg_pose_rest(poses, k);
    npg_pose_move(poses + size, graph, poses, &motion);
    assert_int_equal(npg_pose_bend(&bend, graph, poses + size), NPG_OK);
    assert_true(bend < 1e-5);
    for (size_t i = 0; i < k; i++) poses[i * NPG_POSE_SIZE + 11] += i % 2 ? h : -h;
    npg_pose_move(poses + size, graph, poses, &motion);
    assert_int_equal(npg_pose_bend(&bend, graph, poses + size), NPG_OK);
    assert_true(bend > 0.9 * h && bend < 1.001 * h);
    npg_release(&poses);
    npg_graph_close(&graph);
    npg_mesh_unref(&ball);
}

/* All nodes have a rigid motion of the vertices; of a bend they have it as far as what they carry goes one way. */
static void a_pose_is_found_from_its_vertices(void **state)
{
    npg_mesh *ball = ball_mesh(20, 30);
    npg_graph *graph;
    npg_rigid motion = some_motion();
    double *poses, point[3], worst = 0, most = 0;
    float *placed;
    (void)state;
    open_graph(&graph, &poses, ball, 100);
    size_t k = graph->node_count, size = k * NPG_POSE_SIZE;
    assert_int_equal(npg_alloc_array(&placed, NPG_FOR_RUN, ball->vert_count, 3 * sizeof *placed), NPG_OK);
    for (size_t i = 0; i < 3 * ball->vert_count; i++) {
        const float *at = ball->vert_pos + i / 3 * 3;
        placed[i] = (float)motion.translation[i % 3];
        for (size_t c = 0; c < 3; c++) placed[i] += (float)motion.rotation[i % 3][c] * at[c];
    }
    npg_pose_rest(poses, k);
    npg_pose_move(poses + size, graph, poses, &motion);
    assert_int_equal(npg_pose_of(poses, graph, ball->vert_pos, placed), NPG_OK);
    for (size_t i = 0; i < size; i++) assert_true(fabs(poses[i] - poses[size + i]) < 1e-4);
    for (size_t i = 0; i < 3 * ball->vert_count; i++) /* x goes up with z squared */
        placed[i] = ball->vert_pos[i] + (i % 3 ? 0 : 0.3f * ball->vert_pos[i + 2] * ball->vert_pos[i + 2]);
    assert_int_equal(npg_pose_of(poses, graph, ball->vert_pos, placed), NPG_OK);
    for (size_t v = 0; v < ball->vert_count; v++) {
        npg_pose_point(point, graph, poses, ball->vert_pos + 3 * v, graph->vert_node + v * NPG_GRAPH_BIND,
                       graph->vert_weight + v * NPG_GRAPH_BIND);
        worst = fmax(worst, fabs(point[0] - (double)placed[3 * v]));
        most = fmax(most, (double)(placed[3 * v] - ball->vert_pos[3 * v]));
    }
    print_message("bent by %.4f at most, off by %.4f\n", most, worst);
    assert_true(worst < 0.2 * most);
    npg_release(&placed);
    npg_release(&poses);
    npg_graph_close(&graph);
    npg_mesh_unref(&ball);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(extrapolation_goes_on_for_ever),
                                       cmocka_unit_test(a_pose_is_moved_as_a_whole),
                                       cmocka_unit_test(a_pose_is_found_from_its_vertices),
                                       cmocka_unit_test(a_bend_is_what_no_rigid_motion_explains)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
