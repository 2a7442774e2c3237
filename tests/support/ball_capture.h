/* Ball capture: a ball that moves and bends over some frames, and the poses that a tracker finds. */
#ifndef TEST_BALL_CAPTURE_H
#define TEST_BALL_CAPTURE_H

#include <string.h>

#include "align/align_internal.h"
#include "pipeline/random.h"
#include "tests/support/ball_mesh.h"

enum { RINGS = 20, SPOKES = 30, VERTS = RINGS * SPOKES + 2, FRAMES = 8 };

static const npg_tracker_settings ball_settings = {60, VERTS, 12, 0.1, 0.02};

typedef struct capture {
    npg_mesh *ball;
    npg_tracker *tracker;
    float points[FRAMES][3 * VERTS];
    double *poses; /* FRAMES x K x 12 */
    size_t size;   /* of a pose       */
    npg_recover_frame frames[FRAMES];
} capture;

/* All frames found, one after the other. */
static inline void open_capture(capture *c)
{
    npg_random random = npg_random_stream(4, 0, 0);
    c->ball = ball_mesh(RINGS, SPOKES);
    assert_int_equal(npg_tracker_open(&c->tracker, c->ball, &ball_settings), NPG_OK);
    c->size = npg_tracker_node_count(c->tracker) * NPG_POSE_SIZE;
    assert_int_equal(npg_alloc_array(&c->poses, NPG_FOR_RUN, FRAMES * c->size, sizeof(double)), NPG_OK);
    npg_pose_rest(c->poses, c->size / NPG_POSE_SIZE);
    for (int t = 0; t < FRAMES; t++) {
        double *pose = c->poses + (size_t)t * c->size;
        npg_tracked tracked;
        if (t) memcpy(pose, pose - c->size, c->size * sizeof *pose);
        pose_ball(c->points[t], c->ball->vert_pos, VERTS, 0.3 * t);
        for (int i = 0; i < 3 * VERTS; i++)
            c->points[t][i] += (float)(0.02 * (npg_random_real(&random) - 0.5));
        const npg_tracker_cloud cloud = {.points = c->points[t], .count = VERTS};
        assert_int_equal(npg_tracker_fit(c->tracker, &tracked, pose, &cloud, NULL, NULL), NPG_OK);
        c->frames[t] = (npg_recover_frame){.index = 10 + t, .pose = pose, .tracked = tracked, .cloud = cloud};
    }
}

static inline void close_capture(capture *c)
{
    npg_release(&c->poses);
    npg_tracker_close(&c->tracker);
    npg_mesh_unref(&c->ball);
}

/* A pose far from the truth. */
static inline void lose(capture *c, int t)
{
    npg_recover_frame *frame = &c->frames[t];
    for (size_t k = 0; k < c->size; k += NPG_POSE_SIZE) frame->pose[k + 9] += 0.7;
    frame->tracked.cost = frame->tracked.chamfer = 0.5;
    frame->tracked.point_dist_sq = 0.25;
}

static inline bool stop_at_once(void *user)
{
    (void)user;
    return true;
}

#endif
