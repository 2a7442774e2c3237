/* Rig alignment: which sensor's pose is off, by how much, that the correction brings it back, and that
 * nothing is said where the surfaces do not determine it.  The scenes are balls before a ring of depth
 * cameras. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "ingest/rig/rig_internal.h"
#include "pipeline/random.h"
#include "tests/ingest/rig_helpers.h"

enum { ACROSS = 128, DOWN = 96, FRAMES = 4 };
#define FOCAL 130.0
#define STEP  0.0005 /* metres per depth step */

typedef struct ball {
    double centre[3], radius;
} ball;

/* A body of balls of different sizes, which moves; no turn of it looks like itself. */
static const ball body[] = {{{0, 0, 0}, 0.3},          {{0.35, 0.15, 0.1}, 0.2},  {{-0.3, 0.25, 0.15}, 0.16},
                            {{0.1, 0.42, -0.12}, 0.2}, {{-0.12, -0.4, 0}, 0.22},  {{0.25, -0.3, -0.25}, 0.17},
                            {{-0.2, 0, -0.35}, 0.2},   {{0.05, 0.05, 0.42}, 0.18}};
static const ball one = {{0, 0, 0}, 0.5};

/* Poses of a ring of cameras that look at the origin from 1.8 metres. */
static void ring(double pose[12], int camera, int cameras)
{
    double angle = 6.283185307179586 * camera / cameras, lift = camera % 2 ? 0.1 : 0.3;
    double ahead[3] = {-sin(angle), -lift, -cos(angle)}, right[3] = {-cos(angle), 0, sin(angle)}, down[3];
    double length = sqrt(1 + lift * lift);
    for (int a = 0; a < 3; a++) ahead[a] /= length;
    for (int a = 0; a < 3; a++)
        down[a] = ahead[(a + 1) % 3] * right[(a + 2) % 3] - ahead[(a + 2) % 3] * right[(a + 1) % 3];
    for (int r = 0; r < 3; r++) {
        const double row[4] = {right[r], down[r], ahead[r], -1.8 * ahead[r]};
        memcpy(pose + 4 * r, row, sizeof row);
    }
}

/* Depth along the camera's axis of a ray (x, y, 1) turned to the world; infinite where it meets nothing. */
static double meet(const double pose[12], double x, double y, const ball *balls, size_t count, double shift)
{
    double best = (double)INFINITY, ray[3];
    for (int r = 0; r < 3; r++) ray[r] = pose[4 * r] * x + pose[4 * r + 1] * y + pose[4 * r + 2];
    for (size_t i = 0; i < count; i++) {
        double a = 0, b = 0, c = -balls[i].radius * balls[i].radius;
        for (int k = 0; k < 3; k++) {
            double from = pose[4 * k + 3] - balls[i].centre[k] - (k == (int)(i % 3) ? shift : 0);
            a += ray[k] * ray[k];
            b += ray[k] * from;
            c += from * from;
        }
        double root = b * b - a * c;
        if (root > 0) best = fmin(best, (-b - sqrt(root)) / a);
    }
    return best;
}

static void write_view(const char *rig, int camera, int cameras, int frame, const ball *balls, size_t count)
{
    static uint16_t depth[ACROSS * DOWN];
    char name[128];
    double pose[12];
    npg_random random = npg_random_stream(7, (uint64_t)frame, (uint64_t)camera);
    ring(pose, camera, cameras);
    for (int i = 0; i < ACROSS * DOWN; i++) {
        double x = (i % ACROSS - 63.5) / FOCAL, y = (i / ACROSS - 47.5) / FOCAL;
        double z = meet(pose, x, y, balls, count, 0.04 * frame);
        depth[i] = isinf(z) ? 0 : (uint16_t)lrint((z + 0.001 * npg_random_gauss(&random)) / STEP);
    }
    snprintf(name, sizeof name, "%s/d%d_%04d.png", rig, camera, frame);
    write_png(name, PNG_FORMAT_LINEAR_Y, ACROSS, DOWN, depth);
}

/* by[6]: turn (radians) and shift (metres) of camera `off` in the file alone. */
static void write_rig(const char *rig, int cameras, int off, const double by[6], const char *unit)
{
    char name[128], text[8192], *at = text;
    at +=
        sprintf(at, "{\"neupig_rig\": 1, \"depth_scale\": %g, \"unit\": \"%s\", \"sensors\": [", STEP, unit);
    for (int c = 0; c < cameras; c++) {
        double pose[12], moved[12];
        double turn[12] = {1,      -by[2], by[1],  0,     by[2], 1,
                           -by[0], 0,      -by[1], by[0], 1,     0}; /* by's first order */
        ring(pose, c, cameras);
        memcpy(moved, pose, sizeof moved);
        if (c == off) {
            assert_int_equal(npg_pose_check(turn, "here"), NPG_OK);
            npg_pose_combine(moved, turn, pose);
            for (int r = 0; r < 3; r++) moved[4 * r + 3] = pose[4 * r + 3] + by[3 + r];
        }
        at += sprintf(at,
                      "%s{\"name\": \"c%d\", \"depth\": \"d%d_%%04d.png\", \"camera\": {\"width\": %d, "
                      "\"height\": %d, \"fx\": %g, \"fy\": %g, \"cx\": 63.5, \"cy\": 47.5}, \"pose\": [",
                      c ? ", " : "", c, c, ACROSS, DOWN, FOCAL, FOCAL);
        for (int i = 0; i < 12; i++) at += sprintf(at, "%.17g, ", moved[i]);
        at += sprintf(at, "0, 0, 0, 1]}");
    }
    sprintf(at, "]}");
    snprintf(name, sizeof name, "%s/rig.json", rig);
    write_text(name, text);
}

static void write_views(const char *rig, int cameras, const ball *balls, size_t count)
{
    make_folder(rig);
    for (int c = 0; c < cameras; c++)
        for (int f = 0; f < FRAMES; f++) write_view(rig, c, cameras, f, balls, count);
}

static npg_rig *compare(const char *name, npg_rig_view *views)
{
    static const size_t frames[FRAMES] = {0, 1, 2, 3};
    npg_rig_settings usual = usual_settings();
    npg_rig *rig;
    assert_int_equal(npg_rig_open(&rig, in_folder(&folder, name), &usual), NPG_OK);
    assert_int_equal(npg_rig_compare(rig, views, frames, FRAMES), NPG_OK);
    return rig;
}

static const double nothing[6] = {0}, bump[6] = {0.005, 0.009, -0.0066, 0.008, -0.008, 0.004};

static int make_scenes(void **state)
{
    if (open_rig_tests(state)) return -1;
    write_views("ring", 4, body, sizeof body / sizeof *body);
    write_rig("ring", 4, -1, nothing, "m");
    return 0;
}

static void true_poses_are_aligned(void **state)
{
    (void)state;
    npg_rig_view views[4];
    npg_rig *rig = compare("ring", views);
    int fixed = 0;
    for (int s = 0; s < 4; s++) {
        fixed += views[s].verdict == NPG_RIG_FIXED;
        if (views[s].verdict == NPG_RIG_FIXED) continue;
        assert_int_equal(views[s].verdict, NPG_RIG_ALIGNED);
        assert_true(views[s].shift < 0.002 && views[s].turn_deg < 0.2);
        assert_true(views[s].overlap > 0.05 && views[s].apart < 0.002);
        for (int i = 0; i < 12; i++) assert_true(views[s].correction[i] == (i % 5 == 0));
    }
    assert_int_equal(fixed, 1);
    npg_rig_correct(rig, views);
    for (int i = 0; i < 12; i++) assert_true(rig->sensors[1].correction[i] == (i % 5 == 0));
    npg_rig_close(&rig);
}

/* Whichever sensor it is, the first included: most agree with one of the others. */
static void the_one_that_is_off_is_found(void **state)
{
    (void)state;
    double length = sqrt(0.008 * 0.008 * 2 + 0.004 * 0.004), angle = 0;
    for (int i = 0; i < 3; i++) angle += bump[i] * bump[i];
    angle = sqrt(angle) * 180 / 3.14159265358979;
    for (int off = 0; off < 3; off += 2) {
        npg_rig_view views[4], after[4];
        static const size_t frames[FRAMES] = {0, 1, 2, 3};
        write_rig("ring", 4, off, bump, "m");
        npg_rig *rig = compare("ring", views);
        for (int s = 0; s < 4; s++) {
            assert_int_equal(views[s].verdict == NPG_RIG_OFF, s == off);
        }
        assert_true(fabs(views[off].shift - length) < 0.002 && fabs(views[off].turn_deg - angle) < 0.2);
        npg_rig_correct(rig, views);
        double pose[12], truth[12];
        npg_rig_pose(rig, pose, (size_t)off, npg_rig_shot_of(rig, 0, (size_t)off));
        ring(truth, off, 4);
        for (int i = 0; i < 12; i++) assert_true(fabs(pose[i] - truth[i]) < 0.002);
        assert_int_equal(npg_rig_compare(rig, after, frames, FRAMES), NPG_OK);
        for (int s = 0; s < 4; s++) assert_true(after[s].verdict != NPG_RIG_OFF);
        npg_rig_close(&rig);
    }
    write_rig("ring", 4, -1, nothing, "m");
}

/* A ball looks the same however it is turned: nothing may be said, and nothing corrected. */
static void what_is_not_determined_is_not_said(void **state)
{
    (void)state;
    npg_rig_view views[4];
    char text[160];
    write_views("ball", 4, &one, 1);
    write_rig("ball", 4, 1, bump, "m");
    npg_rig *rig = compare("ball", views);
    int unknown = 0;
    for (int s = 0; s < 4; s++) {
        assert_true(views[s].verdict == NPG_RIG_UNKNOWN || views[s].verdict == NPG_RIG_FIXED);
        unknown += views[s].verdict == NPG_RIG_UNKNOWN;
        if (views[s].verdict == NPG_RIG_FIXED) continue;
        npg_rig_describe_pose(text, sizeof text, rig, &views[s]);
        assert_non_null(strstr(text, "not determined (deviation"));
    }
    assert_int_equal(unknown, 3);
    npg_rig_close(&rig);
}

static void nothing_is_seen_together(void **state)
{
    (void)state;
    npg_rig_view views[2];
    char text[160];
    write_views("opposite", 2, body, sizeof body / sizeof *body);
    write_rig("opposite", 2, -1, nothing, "m");
    npg_rig *rig = compare("opposite", views);
    assert_int_equal(views[0].verdict, NPG_RIG_FIXED);
    assert_int_equal(views[1].verdict, NPG_RIG_UNKNOWN);
    npg_rig_describe_pose(text, sizeof text, rig, &views[1]);
    assert_string_equal(text, "not determined: nothing is seen together with others");
    json_t *sensor = json_object();
    npg_rig_report_pose(sensor, &views[1]);
    assert_string_equal(json_string_value(json_object_get(sensor, "pose")), "not determined");
    assert_true(json_is_null(json_object_get(sensor, "shift_sd")));
    assert_null(json_object_get(sensor, "correction"));
    json_decref(sensor);
    npg_rig_close(&rig);
}

static void lengths_have_the_unit_of_the_rig(void **state)
{
    (void)state;
    static const char *const units[] = {"m", "mm", "cm", "foot"}, *const texts[] = {"1250.0 mm", "1.2 mm",
                                                                                    "12.5 mm", "1.25 foot"};
    for (int u = 0; u < 4; u++) {
        char text[64];
        npg_rig_settings usual = usual_settings();
        npg_rig *rig;
        write_rig("ring", 4, -1, nothing, units[u]);
        assert_int_equal(npg_rig_open(&rig, in_folder(&folder, "ring"), &usual), NPG_OK);
        npg_rig_describe_length(text, sizeof text, rig, 1.25);
        assert_string_equal(text, texts[u]);
        npg_rig_close(&rig);
    }
    write_rig("ring", 4, -1, nothing, "m");
}

/* An image that can't be read is a missing one here; who reads the frame reports it. */
static void damaged_images_are_passed_over(void **state)
{
    (void)state;
    npg_rig_view views[4];
    write_text("ring/d1_0002.png", "none");
    npg_rig *rig = compare("ring", views);
    assert_int_equal(views[1].frames, FRAMES - 1);
    assert_int_equal(views[0].frames, FRAMES);
    npg_rig_close(&rig);
    write_view("ring", 1, 4, 2, body, sizeof body / sizeof *body);
}

static void memory_runs_out(void **state)
{
    (void)state;
    static const size_t frames[FRAMES] = {0, 1, 2, 3};
    npg_rig_settings usual = usual_settings();
    for (uint64_t n = 1; n < 1000; n += 1 + n / 2) {
        npg_rig_view views[4];
        npg_rig *rig;
        assert_int_equal(npg_rig_open(&rig, in_folder(&folder, "ring"), &usual), NPG_OK);
        npg_memory_fail_at(n, true);
        npg_status status = npg_rig_compare(rig, views, frames, 1);
        npg_memory_fail_at(0, false);
        npg_rig_close(&rig);
        if (!status) return;
        assert_int_equal(status, NPG_MEMORY);
    }
    fail();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(true_poses_are_aligned),
                                       cmocka_unit_test(the_one_that_is_off_is_found),
                                       cmocka_unit_test(what_is_not_determined_is_not_said),
                                       cmocka_unit_test(nothing_is_seen_together),
                                       cmocka_unit_test(lengths_have_the_unit_of_the_rig),
                                       cmocka_unit_test(damaged_images_are_passed_over),
                                       cmocka_unit_test(memory_runs_out)};
    return cmocka_run_group_tests(tests, make_scenes, close_rig_tests);
}
