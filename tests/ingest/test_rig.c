/* Rigs: cameras and poses, every layout, what is dropped at edges, gaps of sensors, and what is refused. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "tests/ingest/rig_helpers.h"

/* ---- cameras ---- */

static void a_ray_undoes_the_lens(void **state)
{
    (void)state;
    const npg_camera c = {
        640, 480, 525, 520, 321, 238, {-0.28, 0.09, 0.001, -0.0007, 0.01, 0.02, -0.01, 0.003}};
    for (double u = 0; u < 640; u += 71)
        for (double v = 0; v < 480; v += 53) {
            double ray[2], pixel[2];
            assert_true(npg_camera_ray(&c, ray, (const double[2]){u, v}));
            assert_true(npg_camera_project(&c, pixel, (const double[3]){2 * ray[0], 2 * ray[1], 2}));
            assert_true(fabs(pixel[0] - u) < 1e-3 && fabs(pixel[1] - v) < 1e-3);
        }
}

static void distortion_is_that_of_opencv(void **state)
{
    (void)state;
    const npg_camera c = {640, 480, 525, 525, 319.5, 239.5, {0.1, -0.2, 0.001, 0.002, 0.05}};
    double pixel[2], x = 0.2, y = -2.0 / 15, r2 = x * x + y * y;
    double s = 1 + 0.1 * r2 - 0.2 * r2 * r2 + 0.05 * r2 * r2 * r2;
    assert_true(npg_camera_project(&c, pixel, (const double[3]){0.3, -0.2, 1.5}));
    assert_true(fabs(pixel[0] - (525 * (x * s + 0.002 * x * y + 0.002 * (r2 + 2 * x * x)) + 319.5)) < 1e-9);
    assert_true(fabs(pixel[1] - (525 * (y * s + 0.001 * (r2 + 2 * y * y) + 0.004 * x * y) + 239.5)) < 1e-9);
    assert_false(npg_camera_project(&c, pixel, (const double[3]){0, 0, -1}));
}

static void poses_are_checked(void **state)
{
    (void)state;
    double turned[12] = {0.28, 0, 0.96, 1, 0, 1, 0, 2, -0.96, 0, 0.28, 3}, back[12], both[12];
    assert_int_equal(npg_pose_check(turned, "here"), NPG_OK);
    npg_pose_invert(back, turned);
    npg_pose_combine(both, back, turned);
    for (int i = 0; i < 12; i++) assert_true(fabs(both[i] - (i % 5 == 0)) < 1e-12);
    double mirror[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0},
           scaled[12] = {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0};
    assert_int_equal(npg_pose_check(mirror, "here"), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "mirror"));
    assert_int_equal(npg_pose_check(scaled, "here"), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "no rotation"));
}

/* ---- one sensor ---- */

static void check_plane(const npg_frame *frame, const double shift[3], int slope)
{
    assert_int_equal(frame->point_count, (WIDE - 2) * (HIGH - 2)); /* the margin of one pixel */
    double worst = 0;
    for (size_t i = 0; i < frame->point_count; i++) {
        double x = 1 + (double)(i % (WIDE - 2)), y = 1 + (double)(i / (WIDE - 2)), z = 1 + 0.001 * slope * x;
        const float *p = frame->pos_local + 3 * i, *n = frame->normals + 3 * i;
        const double want[3] = {(x - 19.5) / 50 * z, (y - 14.5) / 50 * z, z};
        for (int a = 0; a < 3; a++) worst = fmax(worst, fabs((double)p[a] - want[a] - shift[a]));
        assert_true(fabs((double)(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) - 1) < 1e-5);
        assert_true(n[2] < 0); /* to the sensor */
        if (!slope) assert_true(n[2] < -0.9999f);
        if (frame->colours) {
            assert_int_equal(frame->colours[4 * i], 5 * (int)x);
            assert_int_equal(frame->colours[4 * i + 1], 5 * (int)y);
            assert_int_equal(frame->colours[4 * i + 3], 255);
        }
    }
    assert_true(worst < 1e-5);
    assert_true(frame->has_sure_normals && frame->sensors[0] == 0);
}

static void own_layout(void **state)
{
    (void)state;
    npg_frame frame;
    make_folder("own");
    for (int f = 0; f < 2; f++) {
        write_depth(f ? "own/d_0004.png" : "own/d_0003.png", 0);
        write_colour(f ? "own/c_0004.png" : "own/c_0003.png");
    }
    write_text("own/rig.json", "{\"neupig_rig\": 1, // ours\n\"sensors\": [{\"name\": \"front\", \"depth\": "
                               "\"d_%04d.png\", \"colour\": \"c_%04d.png\", " CAMERA ", " POSE "}]}");
    assert_int_equal(read_rig_frame(&frame, "own", 1, NULL), NPG_OK);
    check_plane(&frame, (const double[3]){5, 6, 7}, 0);
    npg_frame_clear(&frame);
    npg_rig_settings none = usual_settings(), inverse = none;
    none.poses = NPG_POSES_NONE;
    inverse.poses = NPG_POSES_INVERSE;
    assert_int_equal(read_rig_frame(&frame, "own/rig.json", 0, &none), NPG_OK);
    check_plane(&frame, (const double[3]){0, 0, 0}, 0);
    npg_frame_clear(&frame);
    assert_int_equal(read_rig_frame(&frame, "own/rig.json", 0, &inverse), NPG_OK);
    check_plane(&frame, (const double[3]){-5, -6, -7}, 0);
    npg_frame_clear(&frame);
}

/* A sensor with OpenGL axes looks along -z: its pose then is half a turn about x of the other one. */
static void opengl_axes(void **state)
{
    (void)state;
    npg_frame frame;
    make_folder("gl");
    write_depth("gl/d_0000.png", 0);
    write_text("gl/rig.json",
               "{\"neupig_rig\": 1, \"axes\": \"opengl\", \"sensors\": [{\"depth\": \"d_%04d.png\", " CAMERA
               ", \"pose\": [1,0,0,5, 0,-1,0,6, 0,0,-1,7, 0,0,0,1]}]}");
    assert_int_equal(read_rig_frame(&frame, "gl", 0, NULL), NPG_OK);
    check_plane(&frame, (const double[3]){5, 6, 7}, 0);
    npg_frame_clear(&frame);
}

/* The normal of a slanted plane, which a camera does not see as one of constant slope. */
static void normals_of_a_slanted_plane(void **state)
{
    (void)state;
    npg_frame frame;
    double mean[3] = {0};
    make_folder("slant");
    static uint16_t depth[WIDE * HIGH];
    /* z = 1 + 0.5 x in the camera's space: 1 / z = 1 - 0.5 ray */
    for (int i = 0; i < WIDE * HIGH; i++)
        depth[i] = (uint16_t)lrint(20000 / (1 - 0.5 * (i % WIDE - 19.5) / 50));
    write_png("slant/d_0000.png", PNG_FORMAT_LINEAR_Y, WIDE, HIGH, depth);
    write_text("slant/rig.json", "{\"neupig_rig\": 1, \"depth_scale\": 0.00005, \"sensors\": [{\"depth\": "
                                 "\"d_%04d.png\", " CAMERA "}]}");
    assert_int_equal(read_rig_frame(&frame, "slant", 0, NULL), NPG_OK);
    for (size_t i = 0; i < 3 * frame.point_count; i++)
        mean[i % 3] += (double)frame.normals[i] / (double)frame.point_count;
    assert_true(fabs(mean[0] - 0.5 / sqrt(1.25)) < 1e-3 && fabs(mean[2] + 1 / sqrt(1.25)) < 1e-3);
    npg_frame_clear(&frame);
}

/* ---- what is dropped ---- */

static void edges_and_flying_pixels_are_dropped(void **state)
{
    (void)state;
    npg_frame frame;
    static uint16_t depth[WIDE * HIGH];
    for (int i = 0; i < WIDE * HIGH; i++) depth[i] = i % WIDE < 20 ? 1000 : 2000;
    depth[10 * WIDE + 8] = 0;    /* a hole */
    depth[20 * WIDE + 8] = 1500; /* a flying pixel */
    /* beside the step, and a little of what is behind it: no step of its own, but not on the plane either */
    depth[15 * WIDE + 19] = 1012;
    make_folder("edge");
    write_png("edge/d_0000.png", PNG_FORMAT_LINEAR_Y, WIDE, HIGH, depth);
    write_text("edge/rig.json",
               "{\"neupig_rig\": 1, \"sensors\": [{\"depth\": \"d_%04d.png\", " CAMERA "}]}");
    assert_int_equal(read_rig_frame(&frame, "edge", 0, NULL), NPG_OK);
    /* without the rim and these three: what is beside them and at the step continues its plane */
    assert_int_equal(frame.point_count, (WIDE - 2) * (HIGH - 2) - 3);
    for (size_t i = 0; i < frame.point_count; i++)
        assert_true(frame.pos_local[3 * i + 2] == 1.0f || frame.pos_local[3 * i + 2] == 2.0f);
    npg_frame_clear(&frame);
    npg_rig_settings loose = usual_settings();
    loose.margin = 3;
    assert_int_equal(read_rig_frame(&frame, "edge", 0, &loose), NPG_OK);
    assert_true(frame.point_count < (WIDE - 6) * (HIGH - 4) - 18);
    npg_frame_clear(&frame);
    loose = usual_settings();
    loose.far_m = 1.2;
    assert_int_equal(read_rig_frame(&frame, "edge", 0, &loose), NPG_OK);
    for (size_t i = 0; i < frame.point_count; i++) assert_true(frame.pos_local[3 * i + 2] == 1.0f);
    npg_frame_clear(&frame);
}

/* ---- several sensors ---- */

/* A wall at 1 m with a hole in its middle; most of the picture has no depth where `is_bare`. */
static void write_wall(const char *name, bool is_bare)
{
    static uint16_t depth[WIDE * HIGH];
    for (int i = 0; i < WIDE * HIGH; i++) {
        int x = i % WIDE, y = i / WIDE;
        bool is_hole = x >= 15 && x < 25 && y >= 10 && y < 20;
        depth[i] = is_hole || (is_bare && x >= 10) ? 0 : (uint16_t)(1000 + x);
    }
    write_png(name, PNG_FORMAT_LINEAR_Y, WIDE, HIGH, depth);
}

static float view_at(const npg_frame *frame, int x, int y)
{
    return frame->view_cells[frame->views[0].at + (size_t)(y * WIDE + x)];
}

/* A hole in a whole picture is what the sensor failed at; where most is missing, it was taken away. */
static void a_view_says_where_nothing_is(void **state)
{
    static const struct {
        bool is_bare, has_mask;
        int background;
        float hole, right; /* cells in the hole, and on the right: 0 not known, INFINITY nothing */
    } cases[] = {{false, false, NPG_BACKGROUND_AUTO, 0, 1.035f},
                 {true, false, NPG_BACKGROUND_AUTO, INFINITY, INFINITY},
                 {true, false, NPG_BACKGROUND_UNKNOWN, 0, 0},
                 {false, false, NPG_BACKGROUND_REMOVED, INFINITY, 1.035f},
                 {false, true, NPG_BACKGROUND_AUTO, 0, INFINITY},
                 {false, true, NPG_BACKGROUND_UNKNOWN, 0, 1.035f}};
    (void)state;
    make_folder("view");
    write_mask_jpeg("view/m_0.jpg");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        npg_rig_settings settings = usual_settings();
        npg_frame frame;
        settings.background = cases[i].background;
        write_wall("view/d_0.png", cases[i].is_bare);
        write_text("view/rig.json",
                   cases[i].has_mask ? "{\"neupig_rig\": 1, \"sensors\": [{\"depth\": \"d_%d.png\", "
                                       "\"mask\": \"m_%d.jpg\", " CAMERA ", " POSE "}]}"
                                     : "{\"neupig_rig\": 1, \"sensors\": [{\"depth\": \"d_%d.png\", " CAMERA
                                       ", " POSE "}]}");
        assert_int_equal(read_rig_frame(&frame, "view", 0, &settings), NPG_OK);
        const npg_depth_view *view = &frame.views[0];
        assert_int_equal(view->width, WIDE);
        assert_int_equal(view->height, HIGH);
        assert_float_equal(view->to_sensor[3], -5, 1e-9);
        assert_float_equal(view->to_sensor[11], -7, 1e-9);
        assert_float_equal(view_at(&frame, 5, 5), 1.005, 1e-6);
        assert_true(view_at(&frame, 18, 15) == cases[i].hole);
        if (isinf(cases[i].right))
            assert_true(isinf(view_at(&frame, 35, 15)));
        else
            assert_float_equal(view_at(&frame, 35, 15), cases[i].right, 1e-6);
        npg_frame_clear(&frame);
    }
}

#define RIG(sensor) "{\"neupig_rig\": 1, \"sensors\": [" sensor "]}"

static void a_missing_image_is_a_gap_of_its_sensor(void **state)
{
    (void)state;
    npg_frame frame;
    npg_rig *rig;
    npg_rig_settings usual = usual_settings();
    make_folder("two");
    write_depth("two/a_0000.png", 0);
    write_depth("two/a_0001.png", 0);
    write_depth("two/b_0001.png", 3);
    write_depth("two/b_0002.png", 3);
    write_text("two/rig.json", "{\"neupig_rig\": 1, \"sensors\": [{\"depth\": \"a_%04d.png\", " CAMERA "}, "
                               "{\"depth\": \"b_%04d.png\", " CAMERA ", " POSE "}]}");
    assert_int_equal(npg_rig_open(&rig, in_folder(&folder, "two"), &usual), NPG_OK);
    assert_int_equal(rig->frame_count, 3);
    assert_null(npg_rig_shot_of(rig, 0, 1));
    assert_null(npg_rig_shot_of(rig, 2, 0));
    assert_int_equal(npg_rig_find(rig, 2), 2);
    npg_rig_close(&rig);
    const size_t each = (WIDE - 2) * (HIGH - 2);
    for (size_t f = 0; f < 3; f++) {
        assert_int_equal(read_rig_frame(&frame, "two", f, NULL), NPG_OK);
        assert_int_equal(frame.point_count, f == 1 ? 2 * each : each);
        assert_int_equal(frame.sensors[frame.point_count - 1], f > 0);
        assert_int_equal(frame.sensor_count, 2); /* where they stand; not known where an image is missing */
        assert_int_equal(!isnan(frame.sensor_local[0]), f < 2);
        assert_int_equal(!isnan(frame.sensor_local[3]), f > 0);
        npg_frame_clear(&frame);
    }
}

static void an_image_without_depth_is_counted_and_named(void **state)
{
    (void)state;
    static uint16_t depth[WIDE * HIGH]; /* 0 */
    npg_rig_settings usual = usual_settings();
    npg_origin origin = {.known = true};
    npg_frame frame = {0};
    npg_rig *rig;
    make_folder("blank");
    write_depth("blank/a_0000.png", 0);
    write_png("blank/a_0001.png", PNG_FORMAT_LINEAR_Y, WIDE, HIGH, depth);
    memset(depth, 255, sizeof depth);
    write_png("blank/a_0002.png", PNG_FORMAT_LINEAR_Y, WIDE, HIGH, depth);
    write_text("blank/rig.json", RIG("{\"depth\": \"a_%04d.png\", " CAMERA "}"));
    assert_int_equal(npg_rig_open(&rig, in_folder(&folder, "blank"), &usual), NPG_OK);
    for (size_t f = 0; f < 3; f++) {
        assert_int_equal(npg_rig_read(rig, &frame, f, &origin), NPG_OK);
        assert_int_equal(frame.point_count > 0, f == 0);
        assert_int_equal(rig->blank_count, f);
        npg_frame_clear(&frame);
    }
    assert_non_null(strstr(rig->first_blank, "a_0001.png"));
    npg_rig_close(&rig);
}

/* ---- layouts of others ---- */

#define AT(x, y, z) "[1, 0, 0, " #x ", 0, 1, 0, " #y ", 0, 0, 1, " #z ", 0, 0, 0, 1]"

static void lists_of_images(void **state)
{
    (void)state;
    npg_frame frame;
    npg_rig *rig;
    npg_rig_settings usual = usual_settings();
    make_folder("tum");
    make_folder("tum/depth");
    write_depth("tum/depth/1.png", 0);
    write_colour("tum/depth/c.png");
    write_text("tum/rig.json", RIG("{\"depth\": [\"depth/1.png\", null, \"depth/1.png\"], " CAMERA
                                   ", \"colour\": [null, null, \"depth/c.png\"], \"depth_scale\": 0.0002"
                                   ", \"poses\": [" AT(0, 0, 0) ", " AT(1, 2, 3) "]}"));
    assert_int_equal(npg_rig_open(&rig, in_folder(&folder, "tum"), &usual), NPG_OK);
    assert_int_equal(rig->frame_count, 2);
    assert_int_equal(rig->numbers[1], 2);
    npg_rig_close(&rig);
    assert_int_equal(read_rig_frame(&frame, "tum", 1, NULL), NPG_OK);
    assert_non_null(frame.colours);
    assert_true(fabs((double)frame.pos_local[2] - 3.2) < 1e-6); /* 1000 / 5000 + 3 */
    npg_frame_clear(&frame);
}

static void layouts_without_a_rig_name_the_script(void **state)
{
    (void)state;
    npg_frame frame;
    make_folder("red");
    make_folder("red/depth");
    make_folder("cv");
    write_text("red/intrinsic.json", "{}");
    write_text("cv/0007_camera.xml", "");
    assert_int_equal(read_rig_frame(&frame, "red", 0, NULL), NPG_BAD_INPUT);
    assert_non_null(
        strstr(npg_error_text(), "as Redwood and Open3D has them, without a rig.json: rig_json.py"));
    assert_int_equal(read_rig_frame(&frame, "cv", 0, NULL), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "as OpenCV has them"));
}

/* ---- what is refused ---- */

#define DEPTH           "\"depth\": \"d_%04d.png\""
#define GOOD            "{" DEPTH ", " CAMERA "}"
#define WITH_POSE(p)    RIG("{" DEPTH ", " CAMERA ", \"pose\": [" p "]}")
#define WITH(member)    RIG("{" DEPTH ", " CAMERA ", " member "}")
#define OTHER_CAMERA(c) RIG("{" DEPTH ", \"camera\": {" c "}}")
#define SIZED(c)        OTHER_CAMERA("\"width\": 40, \"height\": 30, " c)

static const struct {
    const char *text, *message;
} bad_rigs[] = {
    {"", "rig.json:1:0"},
    {"{\"neupig_rig\": 1,", "rig.json:1"},
    {"[]", "must be an object"},
    {"{\"sensors\": []}", "neupig_rig: is missing"},
    {"{\"neupig_rig\": 2, \"sensors\": []}", "version 1"},
    {"{\"neupig_rig\": 1, \"sensors\": []}", "at least one sensor"},
    {"{\"neupig_rig\": 1, \"colour\": 1, \"sensors\": [" GOOD "]}", "colour: unknown key; known are"},
    {"{\"neupig_rig\": 1, \"axes\": \"up\", \"sensors\": [" GOOD "]}", "axes: must be opencv"},
    {RIG("{" CAMERA "}"), "sensors[0].depth: is missing"},
    {RIG("{" DEPTH "}"), "sensors[0].camera: is missing: the intrinsics"},
    {WITH("\"dept\": 1"), "sensors[0].dept: unknown key"},
    {WITH("\"mask\": 7"), "sensors[0].mask: must be a pattern"},
    {WITH("\"mask\": \"m.png\""), "sensors[0].mask: must be a pattern"},
    {WITH("\"mask\": \"m_%04d.png\""), "sensors[0].mask"},
    {WITH("\"depth_scale\": 0"), "depth_scale: must be more than 0"},
    {WITH("\"poses\": []"), "0 poses, but 1 depth images"},
    {WITH("\"poses\": [[1]]"), "poses[0]: must be 16 numbers"},
    {WITH("\"poses\": \"a.log\""), "rig_json.py lists those of a file"},
    {WITH("\"mask\": [7]"), "sensors[0].mask: must hold the names of images"},
    {WITH("\"mask\": [\"none.png\"]"), "none.png"},
    {RIG("{\"depth\": [null], " CAMERA "}"), "there is no depth image"},
    {WITH("\"colour\": \"late_%04d.png\""), "frame 0 has a depth image, but none of these"},
    {WITH_POSE("1, 0, 0"), "pose: must be 16 numbers"},
    {WITH_POSE("1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,1,1"), "its last row must be 0 0 0 1"},
    {WITH_POSE("[1,0,0,0], [0,1,0,0], [0,0,1,0], [0,0,1,1]"), "its last row must be 0 0 0 1"},
    {WITH_POSE("[1,0,0,0], [0,1,0,0], [0,0,1,0], [0,0,0,1,1]"), "has more numbers"},
    {WITH_POSE("1,0,0,0, 0,1,0,0, 0,0,2,0, 0,0,0,1"), "sensors[0].pose: the pose is no rotation"},
    {WITH_POSE("1,0,0,0, 0,1,0,0, 0,0,-1,0, 0,0,0,1"), "a mirror"},
    {SIZED("\"fx\": 50, \"fy\": 50, \"cx\": 20"), "camera.cy: is missing"},
    {OTHER_CAMERA("\"width\": 40.5, \"height\": 30, \"fx\": 50, \"fy\": 50, \"cx\": 20, \"cy\": 15"),
     "whole numbers of pixels"},
    {SIZED("\"fx\": 0, \"fy\": 50, \"cx\": 20, \"cy\": 15"), "fx 0 and fy 50 are no focal lengths"},
    {SIZED("\"fx\": 50, \"fy\": 1e-30, \"cx\": 20, \"cy\": 15"), "fx 50 and fy 1e-30 are no focal lengths"},
    {WITH("\"near\": 2, \"far\": 1"), "sensors[0].near: must be less than far"},
    {RIG("{\"name\": \"one\", " DEPTH ", " CAMERA "}, " GOOD),
     "sensors[1].depth: its images are those of sensor one"},
    {SIZED("\"fx\": 50, \"fy\": 50, \"cx\": 900, \"cy\": 15"), "far outside"},
    {SIZED("\"fx\": 50, \"fy\": 50, \"cx\": 20, \"cy\": 15, "
           "\"distortion\": [1, 2, 3]"),
     "4, 5 or 8 numbers"},
    {OTHER_CAMERA("\"width\": 80, \"height\": 60, \"fx\": 50, \"fy\": 50, \"cx\": 20, \"cy\": 15"),
     "d_0000.png: 40 x 30 pixels, but the camera's intrinsics are of 80 x 60"},
    {RIG("{\"depth\": \"eight_%04d.png\", " CAMERA "}"),
     "eight_0000.png: a 8-bit grey PNG; a depth image must be 16"},
    {RIG("{\"depth\": \"cut_%04d.png\", " CAMERA "}"), "cut_0000.png: byte"},
    {RIG("{\"depth\": \"mask_%04d.jpg\", " CAMERA "}"), "a JPEG can't be a depth image"},
    {RIG("{\"depth\": \"text_%04d.png\", " CAMERA "}"), "neither PNG nor JPEG"},
};

static void make_bad_images(void)
{
    static const uint8_t grey[WIDE * HIGH];
    make_folder("bad");
    write_depth("bad/d_0000.png", 0);
    write_colour("bad/late_0001.png");
    write_png("bad/eight_0000.png", PNG_FORMAT_GRAY, WIDE, HIGH, grey);
    write_depth("bad/cut_0000.png", 1);
    assert_int_equal(truncate(in_folder(&folder, "bad/cut_0000.png"), 120), 0);
    write_mask_jpeg("bad/mask_0000.jpg");
    write_text("bad/text_0000.png", "no image");
}

static void bad_rigs_are_refused(void **state)
{
    (void)state;
    make_bad_images();
    for (size_t i = 0; i < sizeof bad_rigs / sizeof *bad_rigs; i++) {
        npg_frame frame;
        write_text("bad/rig.json", bad_rigs[i].text);
        npg_status status = read_rig_frame(&frame, "bad", 0, NULL);
        if (status != NPG_BAD_INPUT || !strstr(npg_error_text(), bad_rigs[i].message))
            fail_msg("%s\n%d: %s\nbut not: %s", bad_rigs[i].text, (int)status, npg_error_text(),
                     bad_rigs[i].message);
        assert_null(frame.pos_local);
    }
}

static void confine_refuses_what_leads_out(void **state)
{
    (void)state;
    npg_frame frame;
    npg_rig_settings confined = usual_settings();
    confined.confine = true;
    make_folder("in");
    write_colour("outside.png");
    write_depth("in/d_0000.png", 0);
    write_text("in/rig.json", WITH("\"mask\": [\"../outside.png\"]"));
    assert_int_equal(read_rig_frame(&frame, "in", 0, NULL), NPG_OK);
    npg_frame_clear(&frame);
    assert_int_equal(read_rig_frame(&frame, "in", 0, &confined), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "outside.png"));
}

/* ---- images ---- */

static void images_of_other_kinds(void **state)
{
    (void)state;
    npg_image image;
    write_colour("kind.png");
    write_mask_jpeg("kind.jpg");
    assert_int_equal(npg_image_read(&image, in_folder(&folder, "kind.png"), NPG_IMAGE_MASK, 0, 0), NPG_OK);
    assert_true(image.bytes && image.width == WIDE);
    npg_image_clear(&image);
    assert_int_equal(npg_image_read(&image, in_folder(&folder, "kind.jpg"), NPG_IMAGE_COLOUR, WIDE, HIGH),
                     NPG_OK);
    assert_true(image.bytes[0] > 240 && image.bytes[1] > 240 && image.bytes[3 * (WIDE - 1)] < 15);
    npg_image_clear(&image);
    assert_int_equal(truncate(in_folder(&folder, "kind.jpg"), 300), 0);
    assert_int_equal(npg_image_read(&image, in_folder(&folder, "kind.jpg"), NPG_IMAGE_COLOUR, 0, 0),
                     NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "kind.jpg"));
    assert_null(image.bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_ray_undoes_the_lens),
                                       cmocka_unit_test(distortion_is_that_of_opencv),
                                       cmocka_unit_test(poses_are_checked),
                                       cmocka_unit_test(own_layout),
                                       cmocka_unit_test(opengl_axes),
                                       cmocka_unit_test(normals_of_a_slanted_plane),
                                       cmocka_unit_test(edges_and_flying_pixels_are_dropped),
                                       cmocka_unit_test(a_view_says_where_nothing_is),
                                       cmocka_unit_test(a_missing_image_is_a_gap_of_its_sensor),
                                       cmocka_unit_test(an_image_without_depth_is_counted_and_named),
                                       cmocka_unit_test(lists_of_images),
                                       cmocka_unit_test(layouts_without_a_rig_name_the_script),
                                       cmocka_unit_test(bad_rigs_are_refused),
                                       cmocka_unit_test(confine_refuses_what_leads_out),
                                       cmocka_unit_test(images_of_other_kinds)};
    return cmocka_run_group_tests(tests, open_rig_tests, close_rig_tests);
}
