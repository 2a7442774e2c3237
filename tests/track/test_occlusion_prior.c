/* Occlusion prior: edges of what is hidden follow the pose that holds them, those of what is seen stay at rest; in a fit
 * a hidden part stays bent as it is held, and goes back to rest where rest holds it; from both sides in time
 * a hidden part moves evenly. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "tests/support/ball_mesh.h"
#include "track/track.h"

#define TWIST 0.6 /* of the lower half against the upper one, radians */

enum { RINGS = 40, SPOKES = 60, NODES = 200 };

typedef struct scene {
    npg_mesh *ball;
    npg_graph *graph;
    npg_arena arena; /* of prior */
    npg_occlusion_prior prior;
    double *rest, *bent; /* K x 12 */
    uint32_t *verts;     /* all     */
    uint8_t *is_seen;
} scene;

/* Nodes below the middle turned about z, more the lower they are. */
static void twist(double *pose, const npg_graph *graph, double share)
{
    npg_pose_rest(pose, graph->node_count);
    for (size_t k = 0; k < graph->node_count; k++) {
        const float *g = graph->node_pos + 3 * k;
        double angle = share * TWIST * fmin(1, fmax(0, -4 * (double)g[2])), *p = pose + k * NPG_POSE_SIZE;
        double x = (double)g[0], y = (double)g[1];
        p[0] = p[4] = cos(angle);
        p[1] = -sin(angle);
        p[3] = sin(angle);
        p[9] = cos(angle) * x - sin(angle) * y - x;
        p[10] = sin(angle) * x + cos(angle) * y - y;
    }
}

static void open_scene(scene *s)
{
    *s = (scene){.ball = ball_mesh(RINGS, SPOKES), .arena = {.purpose = NPG_FOR_RUN}};
    size_t v = s->ball->vert_count;
    assert_int_equal(npg_graph_open(&s->graph, s->ball, NODES), NPG_OK);
    assert_int_equal(npg_prior_open(&s->prior, &s->arena, s->graph), NPG_OK);
    assert_int_equal(npg_alloc(&s->rest, NPG_FOR_RUN, npg_pose_bytes(s->graph->node_count)), NPG_OK);
    assert_int_equal(npg_alloc(&s->bent, NPG_FOR_RUN, npg_pose_bytes(s->graph->node_count)), NPG_OK);
    assert_int_equal(npg_alloc_array(&s->verts, NPG_FOR_RUN, v, sizeof *s->verts), NPG_OK);
    assert_int_equal(npg_alloc(&s->is_seen, NPG_FOR_RUN, v), NPG_OK);
    for (size_t i = 0; i < v; i++) s->verts[i] = (uint32_t)i;
    npg_pose_rest(s->rest, s->graph->node_count);
    twist(s->bent, s->graph, 1);
}

static void close_scene(scene *s)
{
    npg_arena_release(&s->arena);
    npg_graph_close(&s->graph);
    npg_mesh_unref(&s->ball);
    void *all[] = {&s->rest, &s->bent, &s->verts, &s->is_seen};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) npg_release(all[i]);
}

/* Sum over all edges of how far they are from those at rest. */
static double bend(const scene *s)
{
    double sum = 0;
    for (size_t e = 0; e < 2 * s->graph->edge_count; e++) {
        const uint32_t *pair = s->graph->edges[e / 2];
        const float *gj = s->graph->node_pos + 3 * (size_t)pair[e % 2],
                    *gk = s->graph->node_pos + 3 * (size_t)pair[1 - e % 2];
        double edge[3], off = 0;
        assert_true(npg_prior_edge(edge, &s->prior, s->graph, e) == 1);
        for (int i = 0; i < 3; i++) off += pow(edge[i] - (double)gk[i] + (double)gj[i], 2);
        sum += sqrt(off);
    }
    return sum;
}

static void see(scene *s, bool all)
{
    memset(s->is_seen, all, s->ball->vert_count);
    npg_prior_see(&s->prior, s->graph, s->verts, s->is_seen, s->ball->vert_count);
}

static void hidden_edges_are_those_of_the_pose(void **state)
{
    scene s;
    (void)state;
    open_scene(&s);
    npg_prior_take(&s.prior, s.graph, &(npg_prior_poses){.pose = s.bent});
    see(&s, true);
    assert_true(bend(&s) < 1e-9);
    see(&s, false);
    double bent = bend(&s);
    assert_true(bent > 0.1);
    npg_prior_take(&s.prior, s.graph, &(npg_prior_poses){.pose = s.rest});
    assert_true(bend(&s) < 1e-3 * bent);
    /* turned and moved as a whole, a body is not bent */
    for (size_t k = 0; k < s.graph->node_count; k++) {
        const float *g = s.graph->node_pos + 3 * k;
        double *p = s.bent + k * NPG_POSE_SIZE;
        const double whole[NPG_POSE_SIZE] = {
            0, -1, 0, 1, 0, 0, 0, 0, 1, 0.3 - (double)g[1] - (double)g[0], (double)g[0] - (double)g[1]};
        memcpy(p, whole, sizeof whole);
    }
    npg_prior_take(&s.prior, s.graph, &(npg_prior_poses){.pose = s.bent});
    assert_true(bend(&s) < 1e-3 * bent);
    close_scene(&s);
}

static void both_sides_have_a_say(void **state)
{
    scene s;
    float since[2 * NODES];
    (void)state;
    open_scene(&s);
    assert_true(s.graph->node_count <= sizeof since / sizeof *since);
    see(&s, false);
    npg_prior_take(&s.prior, s.graph, &(npg_prior_poses){.pose = s.bent});
    double bent = bend(&s);
    for (size_t k = 0; k < s.graph->node_count; k++) since[k] = 3;
    npg_prior_take(&s.prior, s.graph, &(npg_prior_poses){s.rest, s.bent, since});
    assert_true(fabs(bend(&s) / bent - 0.75) < 0.01);
    npg_prior_take(&s.prior, s.graph, &(npg_prior_poses){s.bent, s.rest, since});
    assert_true(fabs(bend(&s) / bent - 0.25) < 0.01);
    /* what was hidden until now has been so for one more frame, what is seen for none */
    npg_prior_count(&s.prior, since, since, s.graph->node_count);
    assert_true(since[0] == 4);
    see(&s, true);
    npg_prior_count(&s.prior, since, since, s.graph->node_count);
    assert_true(since[0] == 0);
    close_scene(&s);
}

/* Mean distance of the lower half from where the twist has it, in distances at rest. */
static double untwisted(const scene *s, const npg_tracker *tracker, const double *pose)
{
    size_t v = s->ball->vert_count, nodes = npg_tracker_node_count(tracker);
    float *is, *wanted;
    double *bent, off = 0, all = 0;
    assert_int_equal(npg_alloc_array(&is, NPG_FOR_RUN, v, 3 * sizeof *is), NPG_OK);
    assert_int_equal(npg_alloc_array(&wanted, NPG_FOR_RUN, v, 3 * sizeof *wanted), NPG_OK);
    assert_int_equal(npg_alloc(&bent, NPG_FOR_RUN, npg_pose_bytes(nodes)), NPG_OK);
    twist(bent, npg_tracker_graph(tracker), 1);
    npg_tracker_vertices(tracker, wanted, bent);
    npg_tracker_vertices(tracker, is, pose);
    for (size_t i = 0; i < 3 * v; i++) {
        const float *rest = s->ball->vert_pos;
        if (rest[i - i % 3 + 2] > -0.25f) continue;
        off += fabs((double)is[i] - (double)wanted[i]);
        all += fabs((double)rest[i] - (double)wanted[i]);
    }
    npg_release(&is);
    npg_release(&wanted);
    npg_release(&bent);
    return off / all;
}

static void a_fit_keeps_hidden_parts_as_they_are_held(void **state)
{
    static const npg_tracker_settings settings = {NODES, 1500, 15, 0.006, 0.001};
    const float sensor[3] = {0, 0, 3};
    scene s;
    npg_tracker *tracker;
    npg_tracked tracked;
    (void)state;
    open_scene(&s);
    assert_int_equal(npg_tracker_open(&tracker, s.ball, &settings), NPG_OK);
    assert_int_equal(npg_tracker_node_count(tracker), s.graph->node_count);
    size_t count = 0, bytes = npg_pose_bytes(s.graph->node_count);
    float *points;
    double *pose;
    assert_int_equal(npg_alloc(&pose, NPG_FOR_RUN, bytes), NPG_OK);
    assert_int_equal(npg_alloc_array(&points, NPG_FOR_RUN, s.ball->vert_count, 3 * sizeof *points), NPG_OK);
    for (size_t v = 0; v < s.ball->vert_count; v++)
        if (s.ball->vert_pos[3 * v + 2] > 0.1f)
            memcpy(points + 3 * count++, s.ball->vert_pos + 3 * v, 3 * sizeof *points);
    const npg_tracker_cloud cloud = {.points = points, .count = count, .sensors = sensor, .sensor_count = 1};
    const npg_prior_poses holds[2] = {{.pose = s.bent}, {.pose = s.rest}};
    for (int way = 0; way < 2; way++) {
        memcpy(pose, s.bent, bytes);
        assert_int_equal(npg_tracker_fit(tracker, &tracked, pose, &cloud, &holds[way], NULL), NPG_OK);
        double off = untwisted(&s, tracker, pose);
        assert_true(way ? off > 0.8 : off < 0.2);
    }
    npg_release(&pose);
    npg_release(&points);
    npg_tracker_close(&tracker);
    close_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hidden_edges_are_those_of_the_pose),
        cmocka_unit_test(both_sides_have_a_say),
        cmocka_unit_test(a_fit_keeps_hidden_parts_as_they_are_held),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
