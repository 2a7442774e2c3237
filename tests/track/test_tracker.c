/* Tracker: a fine reference is aligned by few of its vertices, and all of them move; a piece without points
 * goes with the one beside it, and is not drawn to points of another part. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/geometry.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/image_space.h"
#include "tests/support/shapes.h"
#include "track/track.h"

static void thin_meshes_are_made_of_the_whole_one_s_vertices(void **state)
{
    npg_proxy *thin;
    npg_manifold m;
    npg_mesh *ball = ball_mesh(60, 80);
    (void)state;
    assert_int_equal(npg_proxy_open(&thin, ball, 1000), NPG_OK);
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
    npg_proxy_close(&thin);
    assert_int_equal(npg_proxy_open(&thin, ball, 0), NPG_OK);
    assert_int_equal(thin->mesh->vert_count, ball->vert_count);
    assert_memory_equal(thin->mesh->faces, ball->faces, 3 * ball->face_count * sizeof *ball->faces);
    npg_proxy_close(&thin);
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
    assert_true(v > 2 * NPG_PROXY_SURFACE - 10);
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

/* Points beyond its border are all that says so. */
static void a_sheet_that_moves_in_its_plane_is_followed(void **state)
{
    enum { COLUMNS = 41, ROWS = 25, POINTS = 3000 };
    static const npg_tracker_settings settings = {100, 1500, 15, 0.1, 0.02};
    static float points[3 * POINTS], found[3 * COLUMNS * ROWS];
    npg_mesh *sheet;
    npg_tracker *tracker;
    npg_tracked tracked;
    double *pose, moved = 0;
    shape_random r = {3};
    (void)state;
    assert_int_equal(npg_mesh_open(&sheet, COLUMNS * ROWS, (size_t)2 * (COLUMNS - 1) * (ROWS - 1)), NPG_OK);
    assert_int_equal(
        npg_alloc_array(&sheet->vert_normals, NPG_FOR_MESH, sheet->vert_count, 3 * sizeof(float)), NPG_OK);
    size_t f = 0;
    for (uint32_t v = 0; v < COLUMNS * ROWS; v++) {
        uint32_t x = v % COLUMNS, y = v / COLUMNS;
        memcpy(sheet->vert_pos + 3 * v, (float[]){(float)x / 20 - 1, (float)y / 20 - 0.6f, 0},
               3 * sizeof(float));
        memcpy(sheet->vert_normals + 3 * v, (float[]){0, 0, 1}, 3 * sizeof(float));
        if (x + 1 == COLUMNS || y + 1 == ROWS) continue;
        memcpy(sheet->faces + 3 * f++, (uint32_t[]){v, v + 1, v + COLUMNS + 1}, 3 * sizeof(uint32_t));
        memcpy(sheet->faces + 3 * f++, (uint32_t[]){v, v + COLUMNS + 1, v + COLUMNS}, 3 * sizeof(uint32_t));
    }
    for (size_t i = 0; i < POINTS; i++) {
        points[3 * i] = (float)shape_uniform(&r) * 2 - 1 + 0.1f;
        points[3 * i + 1] = (float)shape_uniform(&r) * 1.2f - 0.6f;
    }
    assert_int_equal(npg_tracker_open(&tracker, sheet, &settings), NPG_OK);
    size_t nodes = npg_tracker_node_count(tracker);
    assert_int_equal(npg_alloc_array(&pose, NPG_FOR_RUN, nodes, NPG_POSE_SIZE * sizeof(double)), NPG_OK);
    npg_pose_rest(pose, nodes);
    const npg_tracker_cloud cloud = {.points = points, .count = POINTS};
    assert_int_equal(npg_tracker_fit(tracker, &tracked, pose, &cloud, NULL, NULL), NPG_OK);
    npg_tracker_vertices(tracker, found, pose);
    for (size_t v = 0; v < COLUMNS * ROWS; v++)
        moved += ((double)found[3 * v] - (double)sheet->vert_pos[3 * v]) / (COLUMNS * ROWS);
    print_message("moved by %.4f of 0.1\n", moved);
    assert_true(moved > 0.05 && moved < 0.11);
    npg_release(&pose);
    npg_tracker_close(&tracker);
    npg_mesh_unref(&sheet);
}

/* Two balls as one mesh, the second a quarter as large and beside the first. */
static npg_mesh *two_balls(size_t *first_count)
{
    npg_mesh *ball = ball_mesh(20, 30), *both;
    size_t v = ball->vert_count, f = ball->face_count;
    assert_int_equal(npg_mesh_open(&both, 2 * v, 2 * f), NPG_OK);
    assert_int_equal(npg_alloc_array(&both->vert_normals, NPG_FOR_MESH, 2 * v, 3 * sizeof(float)), NPG_OK);
    for (size_t i = 0; i < 3 * v; i++) {
        both->vert_pos[i] = ball->vert_pos[i];
        both->vert_pos[3 * v + i] = ball->vert_pos[i] / 4 + (i % 3 ? 0 : 0.7F);
        both->vert_normals[i] = both->vert_normals[3 * v + i] = ball->vert_normals[i];
    }
    for (size_t i = 0; i < 3 * f; i++) {
        both->faces[i] = ball->faces[i];
        both->faces[3 * f + i] = ball->faces[i] + (uint32_t)v;
    }
    npg_mesh_unref(&ball);
    *first_count = v;
    return both;
}

static void a_piece_without_points_goes_along(void **state)
{
    static const npg_tracker_settings settings = {100, 1500, 15, 0.1, 0.02};
    const double away = 0.05;
    size_t v;
    npg_mesh *both = two_balls(&v);
    npg_tracker *tracker;
    npg_tracked tracked;
    float *points, *found;
    double *pose;
    (void)state;
    assert_int_equal(npg_tracker_open(&tracker, both, &settings), NPG_OK);
    size_t nodes = npg_tracker_node_count(tracker);
    assert_int_equal(npg_alloc_array(&points, NPG_FOR_RUN, v, 3 * sizeof(float)), NPG_OK);
    assert_int_equal(npg_alloc_array(&found, NPG_FOR_RUN, 2 * v, 3 * sizeof(float)), NPG_OK);
    assert_int_equal(npg_alloc_array(&pose, NPG_FOR_RUN, nodes, NPG_POSE_SIZE * sizeof(double)), NPG_OK);
    npg_pose_rest(pose, nodes);
    for (size_t i = 0; i < 3 * v; i++)
        points[i] = both->vert_pos[i] + (i % 3 == 1 ? (float)away : 0); /* of the first ball alone */
    const npg_tracker_cloud cloud = {.points = points, .count = v};
    for (int frame = 0; frame < 5; frame++)
        assert_int_equal(npg_tracker_fit(tracker, &tracked, pose, &cloud, NULL, NULL), NPG_OK);
    npg_tracker_vertices(tracker, found, pose);
    double moved = 0;
    for (size_t i = v; i < 2 * v; i++)
        moved += ((double)found[3 * i + 1] - (double)both->vert_pos[3 * i + 1]) / (double)v;
    print_message("the piece moved by %.4f of %.4f\n", moved, away);
    assert_true(moved > 0.5 * away && moved < 1.5 * away);
    npg_release(&points);
    npg_release(&found);
    npg_release(&pose);
    npg_tracker_close(&tracker);
    npg_mesh_unref(&both);
}

/* A rod along z, bent into two arms that stand beside each other: the place of one that was at (x, y, z). */
static void bend_rod(float place[3])
{
    const double radius = 0.3, bow = M_PI / 2 * radius, x = (double)place[0], s = (double)place[2];
    double turn = fmax(-M_PI / 2, fmin(M_PI / 2, s / radius)), arm = fmax(0, fabs(s) - bow);
    place[0] = (float)((radius + x) * sin(turn));
    place[2] = (float)(arm - (radius + x) * cos(turn));
}

/* An arm that has come close to the other one, and that no point was seen of, is not drawn to the other's points. */
static void a_part_without_points_is_not_drawn_to_another(void **state)
{
    static const npg_tracker_settings settings = {200, 1500, 12, 1e-6, 0.001};
    npg_mesh *rod = ball_mesh(80, 24);
    size_t v = rod->vert_count, count = 0, arm = 0;
    npg_tracker *tracker;
    npg_tracked tracked;
    float *placed, *points, *found;
    double *pose, moved = 0;
    (void)state;
    for (size_t i = 0; i < 3 * v; i++) rod->vert_pos[i] *= i % 3 == 2 ? 2 : 0.2F;
    for (size_t i = 0; i < v; i++) bend_rod(rod->vert_pos + 3 * i);
    assert_int_equal(npg_tracker_open(&tracker, rod, &settings), NPG_OK);
    const npg_graph *graph = npg_tracker_graph(tracker);
    assert_int_equal(npg_alloc_array(&placed, NPG_FOR_RUN, v, 3 * sizeof(float)), NPG_OK);
    assert_int_equal(npg_alloc_array(&points, NPG_FOR_RUN, v, 3 * sizeof(float)), NPG_OK);
    assert_int_equal(npg_alloc_array(&found, NPG_FOR_RUN, v, 3 * sizeof(float)), NPG_OK);
    assert_int_equal(npg_alloc_array(&pose, NPG_FOR_RUN, graph->node_count, NPG_POSE_SIZE * sizeof(double)),
                     NPG_OK);
    npg_pose_rest(pose, graph->node_count);
    for (size_t k = 0; k < graph->node_count; k++) /* the arms, 0.6 apart, come to 0.26 */
        pose[k * NPG_POSE_SIZE + 9] = 0.17 * fmax(-1, fmin(1, (double)graph->node_pos[3 * k] / -0.3));
    npg_tracker_vertices(tracker, placed, pose);
    for (size_t i = 0; i < v; i++)
        if (rod->vert_pos[3 * i] < 0) memcpy(points + 3 * count++, placed + 3 * i, 3 * sizeof(float));
    const npg_tracker_cloud cloud = {.points = points, .count = count};
    assert_int_equal(npg_tracker_fit(tracker, &tracked, pose, &cloud, NULL, NULL), NPG_OK);
    npg_tracker_vertices(tracker, found, pose);
    for (size_t i = 0; i < v; i++) {
        if (rod->vert_pos[3 * i] < 0.2F || rod->vert_pos[3 * i + 2] < 0.1F) continue;
        moved += (double)placed[3 * i] - (double)found[3 * i];
        arm++;
    }
    print_message("the arm without points came nearer by %.4f\n", moved / (double)arm);
    assert_true(arm && moved < 0.01 * (double)arm);
    npg_release(&placed);
    npg_release(&points);
    npg_release(&found);
    npg_release(&pose);
    npg_tracker_close(&tracker);
    npg_mesh_unref(&rod);
}

enum { SIDE = 60 }; /* cells of an image */

/* How far the second ball moves towards the first, of which alone there are points, in three fits. */
static double moved_inward(const npg_free_space *space)
{
    static const npg_tracker_settings settings = {100, 1500, 15, 0.1, 0.02};
    static const float sensor[3] = {0, 0, -4};
    size_t v;
    npg_mesh *both = two_balls(&v);
    npg_tracker *tracker;
    npg_tracked tracked;
    assert_int_equal(npg_tracker_open(&tracker, both, &settings), NPG_OK);
    size_t nodes = npg_tracker_node_count(tracker);
    float *found;
    double *pose, moved = 0;
    assert_int_equal(npg_alloc_array(&found, NPG_FOR_RUN, 2 * v, 3 * sizeof(float)), NPG_OK);
    assert_int_equal(npg_alloc_array(&pose, NPG_FOR_RUN, nodes, NPG_POSE_SIZE * sizeof(double)), NPG_OK);
    npg_pose_rest(pose, nodes);
    const npg_tracker_cloud cloud = {
        .points = both->vert_pos, .count = v, .sensors = sensor, .sensor_count = 1, .space = space};
    for (int frame = 0; frame < 3; frame++)
        assert_int_equal(npg_tracker_fit(tracker, &tracked, pose, &cloud, NULL, NULL), NPG_OK);
    npg_tracker_vertices(tracker, found, pose);
    for (size_t i = v; i < 2 * v; i++)
        moved += ((double)both->vert_pos[3 * i] - (double)found[3 * i]) / (double)v;
    npg_release(&found);
    npg_release(&pose);
    npg_tracker_close(&tracker);
    npg_mesh_unref(&both);
    return moved;
}

static void surface_where_nothing_is_is_pulled_out(void **state)
{
    static float cells[SIDE * SIDE];
    (void)state;
    for (int i = 0; i < SIDE * SIDE; i++) { /* the first ball as a disc, around it nothing */
        double x = (i % SIDE + 0.5) / 100 - 0.3, y = (i / SIDE + 0.5) / 100 - 0.3;
        cells[i] = hypot(x, y) < 0.125 ? 3.5F : INFINITY;
    }
    npg_free_space *space = image_space(cells, SIDE, image_from_below);
    double without = moved_inward(NULL), with = moved_inward(space);
    print_message("the second ball moved by %.4f, where nothing says that it can't be there by %.4f\n", with,
                  without);
    assert_true(fabs(without) < 0.02 && with > 0.05);
    npg_free_space_close(&space);
}

/* Share of the vertices of a rod that stand in empty space after so many steps; its left end has points. */
static double left_in_empty_space(const npg_free_space *space, int steps)
{
    const npg_tracker_settings settings = {100, 1500, steps, 0.006, 0.02};
    static const float sensor[3] = {0, 0, -4};
    npg_mesh *ball = ball_mesh(30, 40);
    size_t v = ball->vert_count, count = 0, empty = 0;
    npg_tracker *tracker;
    npg_tracked tracked;
    float *points, *found;
    double *pose;
    for (size_t i = 0; i < 3 * v; i++) ball->vert_pos[i] *= i % 3 ? 0.15F : 1;
    npg_mesh_vertex_normals(ball->vert_normals, ball->vert_pos, v, ball->faces, ball->face_count);
    assert_int_equal(npg_tracker_open(&tracker, ball, &settings), NPG_OK);
    size_t nodes = npg_tracker_node_count(tracker);
    assert_int_equal(npg_alloc_array(&points, NPG_FOR_RUN, v, 3 * sizeof(float)), NPG_OK);
    assert_int_equal(npg_alloc_array(&found, NPG_FOR_RUN, v, 3 * sizeof(float)), NPG_OK);
    assert_int_equal(npg_alloc_array(&pose, NPG_FOR_RUN, nodes, NPG_POSE_SIZE * sizeof(double)), NPG_OK);
    npg_pose_rest(pose, nodes);
    for (size_t i = 0; i < v; i++)
        if (ball->vert_pos[3 * i] < -0.1F)
            memcpy(points + 3 * count++, ball->vert_pos + 3 * i, 3 * sizeof(float));
    const npg_tracker_cloud cloud = {
        .points = points, .count = count, .sensors = sensor, .sensor_count = 1, .space = space};
    assert_int_equal(npg_tracker_fit(tracker, &tracked, pose, &cloud, NULL, NULL), NPG_OK);
    npg_tracker_vertices(tracker, found, pose);
    for (size_t i = 0; i < v; i++) empty += npg_free_space_is_empty(space, found + 3 * i);
    npg_release(&points);
    npg_release(&found);
    npg_release(&pose);
    npg_tracker_close(&tracker);
    npg_mesh_unref(&ball);
    return (double)empty / (double)v;
}

static void what_has_left_empty_space_stays_out(void **state)
{
    static float cells[SIDE * SIDE];
    (void)state;
    for (int i = 0; i < SIDE * SIDE; i++) /* nothing above and where the right half is, something below it */
        cells[i] = i % SIDE < SIDE / 2 || i / SIDE < SIDE / 2 - 3 ? 4 : INFINITY;
    npg_free_space *space = image_space(cells, SIDE, image_from_below);
    double even = left_in_empty_space(space, 14), odd = left_in_empty_space(space, 15);
    print_message("in empty space after 14 steps %.3f, after 15 %.3f\n", even, odd);
    assert_true(even < 0.05 && odd < 0.05);
    npg_free_space_close(&space);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_piece_without_points_goes_along),
        cmocka_unit_test(a_sheet_that_moves_in_its_plane_is_followed),
        cmocka_unit_test(a_part_without_points_is_not_drawn_to_another),
        cmocka_unit_test(surface_where_nothing_is_is_pulled_out),
        cmocka_unit_test(what_has_left_empty_space_stays_out),
        cmocka_unit_test(thin_meshes_are_made_of_the_whole_one_s_vertices),
        cmocka_unit_test(a_fine_reference_is_aligned_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
