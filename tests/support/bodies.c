/* neupig synth with other bodies than the walker: a bar that bends, and bodies whose topology changes.
 *
 *     neupig-bodies --body walker|bar|hands|two|gone [--change FRAME] OPTIONS OF neupig synth
 *
 * hands: a walker whose right hand has grown into its hip and leaves it.  two: the bar, beside which a ball appears.
 * gone: the bar with a ball that disappears.  --change: the first frame in which the hand is off the hip, or the ball
 * there or gone; else the middle one. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "tools/synth/synth.h"

#define PI 3.14159265358979323846

/* ---- bar: 2 m along y, rounded edges; bends in an arc and twists ---- */

static const double bar_half[3] = {0.18, 1.0, 0.12}, bar_radius = 0.05;

static double bar_distance(const double p[3], const void *user)
{
    double outside_sq = 0, inside = -INFINITY;
    (void)user;
    for (int k = 0; k < 3; k++) {
        double d = fabs(p[k]) - bar_half[k] + bar_radius;
        outside_sq += d > 0 ? d * d : 0;
        inside = fmax(inside, d);
    }
    return sqrt(outside_sq) + fmin(inside, 0) - bar_radius;
}

static size_t bar_verts; /* the ball's come after them */

static void bend_bar(const npg_body *body, float *vert_pos, double phase)
{
    double curvature = 1.1 * sin(2 * PI * phase), twist = 0.35 * sin(4 * PI * phase);
    for (size_t v = 0; v < bar_verts; v++) {
        const float *p = body->rest->vert_pos + 3 * v;
        double y = (double)p[1], turn = twist * y, angle = curvature * y;
        double x = cos(turn) * (double)p[0] + sin(turn) * (double)p[2];
        double z = -sin(turn) * (double)p[0] + cos(turn) * (double)p[2];
        /* The middle line is an arc of that curvature through the origin;
         * (1 - cos a) / k without dividing by 0. */
        double half = 0.5 * angle, ratio = fabs(half) < 1e-9 ? 1 : sin(half) / half;
        double line_x = y * ratio * sin(half), line_y = y * ratio * cos(half);
        vert_pos[3 * v] = (float)(line_x + x * cos(angle));
        vert_pos[3 * v + 1] = (float)(line_y - x * sin(angle));
        vert_pos[3 * v + 2] = (float)z;
    }
}

/* ---- the ball that comes to the bar, or leaves it ---- */

static const double ball_radius = 0.22;

static double ball_distance(const double p[3], const void *user)
{
    (void)user;
    return npg_vec3_length(p) - ball_radius;
}

/* It rolls along in front of the bar, out of reach of its bending. */
static void pose_ball(const npg_body *body, float *vert_pos, double since)
{
    const double shift[3] = {0.1, -0.5 + 0.03 * since, 0.55};
    for (size_t v = bar_verts; v < body->rest->vert_count; v++)
        for (size_t k = 0; k < 3; k++)
            vert_pos[3 * v + k] = (float)((double)body->rest->vert_pos[3 * v + k] + shift[k]);
}

static npg_status join(npg_mesh **joined, const npg_mesh *a, const npg_mesh *b)
{
    NPG_TRY(npg_mesh_open(joined, a->vert_count + b->vert_count, a->face_count + b->face_count));
    npg_mesh *mesh = *joined;
    memcpy(mesh->vert_pos, a->vert_pos, a->vert_count * 3 * sizeof(float));
    memcpy(mesh->vert_pos + 3 * a->vert_count, b->vert_pos, b->vert_count * 3 * sizeof(float));
    memcpy(mesh->faces, a->faces, a->face_count * 3 * sizeof *mesh->faces);
    for (size_t i = 0; i < 3 * b->face_count; i++)
        mesh->faces[3 * a->face_count + i] = b->faces[i] + (uint32_t)a->vert_count;
    return NPG_OK;
}

static npg_status open_bar(npg_body *body, double cell, bool is_changed)
{
    static const double lo[3] = {-0.3, -1.1, -0.25}, hi[3] = {0.3, 1.1, 0.25};
    (void)is_changed;
    npg_status status = npg_body_mesh(&body->rest, bar_distance, NULL, lo, hi, cell);
    if (!status) bar_verts = body->rest->vert_count;
    return status;
}

static npg_status open_with_ball(npg_body *body, double cell, bool has_ball)
{
    static const double lo[3] = {-0.3, -0.3, -0.3}, hi[3] = {0.3, 0.3, 0.3};
    npg_mesh *ball = NULL, *bar;
    NPG_TRY(open_bar(body, cell, has_ball));
    if (!has_ball) return NPG_OK;
    NPG_TRY(npg_body_mesh(&ball, ball_distance, NULL, lo, hi, cell));
    bar = body->rest;
    body->rest = NULL;
    npg_status status = join(&body->rest, bar, ball);
    npg_mesh_unref(&bar);
    npg_mesh_unref(&ball);
    return status;
}

static npg_status open_coming(npg_body *body, double cell, bool is_changed)
{
    return open_with_ball(body, cell, is_changed);
}

static npg_status open_going(npg_body *body, double cell, bool is_changed)
{
    return open_with_ball(body, cell, !is_changed);
}

static void pose_bar(const npg_body *body, float *vert_pos, const npg_moment *moment)
{
    bend_bar(body, vert_pos, moment->phase);
    pose_ball(body, vert_pos, moment->since);
}

/* ---- the walker whose hand has grown into its hip ---- */

/* The hand leaves the hip within so many frames. */
#define FRAMES_TO_LEAVE 5

static bool is_grown; /* the surface lies in the pose `grown` */
static npg_bone_pose grown[NPG_BONES];

/* What bears the arm is stiff, so that the hand can stay where it is on the hip: with the upper arm as at rest, the
 * lower arm turned in by this angle ends inside the pelvis. */
static void hands_gait(double angles[3], int b, const npg_moment *moment)
{
    const double turned_in = 1.55;
    double at_hip = is_grown ? 1 : fmax(1 - (moment->since + 1) / FRAMES_TO_LEAVE, 0);
    npg_walker_gait(angles, b, moment);
    if (b != 1 && (b < 3 || b > 6)) return;
    angles[0] = angles[1] = angles[2] = 0;
    if (b == 3) angles[0] = 0.35 * sin(2 * PI * moment->phase);
    if (b == 4) angles[0] = 0.5 * (1 - at_hip) * sin(2 * PI * moment->phase);
    if (b == 6) angles[2] = turned_in * at_hip;
}

static npg_status open_hands(npg_body *body, double cell, bool is_changed)
{
    is_grown = true;
    npg_walker_bones(grown, hands_gait, &(npg_moment){0});
    is_grown = !is_changed;
    return npg_walker_open(body, cell, is_grown ? grown : NULL);
}

/* at = motion after the inverse of `rest`: what takes a surface that lies in the pose `rest` to `motion`. */
static void go_on_from(npg_bone_pose *at, const npg_bone_pose *rest, const npg_bone_pose *motion)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const double *a = motion->rotation + 3 * i, *b = rest->rotation + 3 * j;
            at->rotation[3 * i + j] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        }
    for (int k = 0; k < 3; k++) {
        const double *row = at->rotation + 3 * k;
        at->shift[k] =
            motion->shift[k] - (row[0] * rest->shift[0] + row[1] * rest->shift[1] + row[2] * rest->shift[2]);
    }
}

static void pose_hands(const npg_body *body, float *vert_pos, const npg_moment *moment)
{
    npg_bone_pose bones[NPG_BONES];
    npg_walker_bones(bones, hands_gait, moment);
    for (int b = 0; b < NPG_BONES && is_grown; b++) {
        const npg_bone_pose motion = bones[b];
        go_on_from(&bones[b], &grown[b], &motion);
    }
    npg_walker_bend(body, vert_pos, bones);
}

/* ---- the program ---- */

/* The verb's row, for its options (tools/cli.c). */
static npg_figure figure;

static npg_status make(const npg_cli *cli)
{
    return npg_synth(cli, &figure);
}

static const npg_verb synth = {"synth", "--body BODY -o DIR", 0, 0, "", "", npg_synth_options, false, make};
const npg_verb npg_verbs[] = {{0}};

/* Take --NAME VALUE out of the arguments; NULL when it is not among them. */
static const char *take(int *argc, char **argv, const char *name)
{
    for (int i = 1; i + 1 < *argc; i++)
        if (!strcmp(argv[i], name)) {
            const char *value = argv[i + 1];
            memmove(argv + i, argv + i + 2, (size_t)(*argc - i - 1) * sizeof *argv);
            *argc -= 2;
            return value;
        }
    return NULL;
}

int main(int argc, char **argv)
{
    const struct {
        const char *name;
        npg_figure figure;
    } bodies[] = {{"walker", npg_walker},
                  {"bar", {open_bar, pose_bar, INT64_MAX}},
                  {"hands", {open_hands, pose_hands, -1}},
                  {"two", {open_coming, pose_bar, -1}},
                  {"gone", {open_going, pose_bar, -1}}};
    const char *body = take(&argc, argv, "--body"), *change = take(&argc, argv, "--change");
    for (size_t i = 0; body && i < sizeof bodies / sizeof *bodies; i++) {
        if (strcmp(bodies[i].name, body) != 0) continue;
        figure = bodies[i].figure;
        if (change && figure.change < 0) figure.change = strtoll(change, NULL, 10);
        int code = npg_cli_run(&synth, argc, argv);
        if (!code && figure.change < INT64_MAX) printf("changes at frame %lld\n", (long long)figure.change);
        return code;
    }
    fputs("neupig-bodies: --body walker|bar|hands|two|gone [--change FRAME] [options of neupig synth]\n",
          stderr);
    return 2;
}
