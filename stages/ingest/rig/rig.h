#ifndef NPG_INGEST_RIG_H
#define NPG_INGEST_RIG_H

#include <stdbool.h>
#include <stdint.h>

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/json_file.h"
#include "pipeline/status.h"

/* Camera: pinhole with OpenCV's lens distortion.  Camera axes: x right, y down, z ahead; pixel (0, 0) is the
 * centre of the upper left pixel.
 *
 *     x = X / Z, y = Y / Z, r2 = x x + y y
 *     s = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
 *     u = fx (x s + 2 p1 x y + p2 (r2 + 2 x x)) + cx
 *     v = fy (y s + p1 (r2 + 2 y y) + 2 p2 x y) + cy
 *
 * Poses are 3 x 4, row-major, [R | t]: p' = R p + t. */

enum { NPG_K1, NPG_K2, NPG_P1, NPG_P2, NPG_K3, NPG_K4, NPG_K5, NPG_K6, NPG_DISTORTIONS }; /* OpenCV's order */

typedef struct npg_camera {
    size_t width, height;  /* of the images that the intrinsics are of, pixels */
    double fx, fy, cx, cy; /* pixels */
    double distortion[NPG_DISTORTIONS];
} npg_camera;

/* NPG_BAD_INPUT when sizes or focal lengths are none that a camera has; `where` begins the text. */
npg_status npg_camera_check(const npg_camera *camera, const char *where);

/* Pixel that a point of the camera's space falls on; false where it is not in front of the camera. */
bool npg_camera_project(const npg_camera *camera, double pixel[2], const double point[3]);

/* The ray of a pixel as (x, y) = (X / Z, Y / Z); false where the distortion can't be undone there. */
bool npg_camera_ray(const npg_camera *camera, double ray[2], const double pixel[2]);

/* ---- poses ---- */

void npg_pose_identity(double pose[12]);
void npg_pose_apply(double out[3], const double pose[12], const double point[3]);
/* out = a after b; out is neither of them. */
void npg_pose_combine(double out[12], const double a[12], const double b[12]);
void npg_pose_invert(double out[12], const double pose[12]); /* of a rotation; out is not pose */

/* NPG_BAD_INPUT when the 3 x 3 part is no rotation (a scale, a shear, a mirror, numbers that are not finite);
 * what is off by rounding in a file is made exact. */
npg_status npg_pose_check(double pose[12], const char *where);

/* [R | t] from a quaternion (any length but 0) and a translation. */
npg_status npg_pose_of_quaternion(double pose[12], const double xyzw[4], const double t[3],
                                  const char *where);

/* Rig: depth sensors with their calibration, and which image of which sensor belongs to which frame.
 *
 * Conventions of all layouts, once they are loaded: lengths in one unit (metres, as a rule), camera axes as
 * in camera.c (x right, y down, z ahead), poses from sensor to world.
 *
 * A frame is what all sensors saw at one time.  A sensor whose image is missing then is a gap of that sensor,
 * not of the frame. */

#define NPG_RIG_SENSORS_MAX NPG_FRAME_SENSORS_MOST
#define NPG_RIG_SHOTS_MAX   4000000            /* images of one sensor: 18 hours at 60 a second           */
#define NPG_RIG_TEXT_MAX    ((size_t)64 << 20) /* bytes of a calibration or trajectory file    */

/* What to make of the poses in the files (option sensor-poses). */
typedef enum npg_rig_poses { NPG_POSES_FILE, NPG_POSES_INVERSE, NPG_POSES_NONE } npg_rig_poses;

typedef struct npg_rig_settings {
    int poses;            /* npg_rig_poses                                                            */
    double step_share;    /* neighbouring pixels whose depths differ by more than this share of the   */
                          /* nearer one are not one surface                                           */
    int64_t margin;       /* pixels beside such a step and beside missing depth that are dropped      */
                          /* unless they continue the surface; 0: none                                */
    double near_m, far_m; /* depths that are used, in the rig's unit; far 0: no limit                */
    double tolerance_s;   /* images of different sensors belong together within this                  */
    bool confine;         /* refuse what the rig names outside its folder                             */
} npg_rig_settings;

/* Images of one sensor at one time. */
typedef struct npg_rig_shot {
    char *depth, *colour, *mask; /* paths, owned; colour and mask may be NULL */
    int64_t number;              /* of the frame, where images are numbered   */
    double time_s;               /* where they are timed                      */
    bool has_pose;
    double pose[12]; /* sensor to world, where the sensor moves */
} npg_rig_shot;

typedef struct npg_rig_sensor {
    char *name; /* owned */
    npg_camera camera;
    bool has_colour_camera; /* else colours lie on the depth image pixel by pixel */
    npg_camera colour_camera;
    double depth_to_colour[12]; /* from the depth camera's axes to the colour camera's */
    double scale;               /* unit / depth step                                   */
    double near_m, far_m;       /* of this sensor; far 0: no limit                     */
    bool is_opengl;             /* its poses are of axes x right, y up, z backward     */
    double pose[12];            /* sensor to world, where it stands still              */
    bool is_corrected;
    double correction[12]; /* world to world, after the pose; of npg_rig_correct() */
    npg_rig_shot *shots;   /* in order; owned */
    size_t shot_count, shot_capacity;
    float *rays; /* H x W x 2, NaN where there is none; made at the first use, owned */
} npg_rig_sensor;

typedef struct npg_rig {
    char *path, *folder; /* as given; the folder that its names start from; owned */
    const char *layout;  /* "rig.json", "redwood", "tum", "opencv"                */
    char *unit;          /* of lengths, as rig.json names it; owned, NULL: "m"    */
    npg_rig_settings settings;
    bool is_timed; /* frames are matched by time, else by number */
    npg_rig_sensor *sensors;
    size_t sensor_count, sensor_capacity;
    size_t frame_count;
    int64_t *numbers; /* per frame, growing; owned               */
    int32_t *shot_of; /* frame_count x sensor_count, -1: a gap   */
    size_t left_out;  /* images without a pose or without a time */
} npg_rig;

/* Whether a path is one: rig.json (any file *.json), or a folder of one of the known layouts that has no
 * frames of its own. */
bool npg_rig_is(const char *path);

/* Load the description; no image is decoded, but headers where a layout does not say the size.
 * NPG_BAD_INPUT names file and place. */
npg_status npg_rig_open(npg_rig **rig, const char *path, const npg_rig_settings *settings);
void npg_rig_close(npg_rig **rig);

/* The settings without any option. */
npg_rig_settings npg_rig_defaults(void);

/* Place of a frame number; SIZE_MAX for one that is not there. */
size_t npg_rig_find(const npg_rig *rig, int64_t number);

/* The shot of a sensor in a frame, NULL for a gap. */
const npg_rig_shot *npg_rig_shot_of(const npg_rig *rig, size_t frame, size_t sensor);

/* The pose (sensor to world) it is used with: settings, axes and correction applied. */
void npg_rig_pose(const npg_rig *rig, double pose[12], size_t sensor, const npg_rig_shot *shot);

/* Call visit for every image of a frame; ends with the first status that is not NPG_OK. */
npg_status npg_rig_each_image(const npg_rig *rig, size_t frame,
                              npg_status (*visit)(void *user, const char *path), void *user);

/* Numbers that stand for all calibration a frame is made with (intrinsics, poses, settings): two rigs that
 * give one frame the same points from the same images have the same. */
uint64_t npg_rig_frame_hash(const npg_rig *rig, size_t frame);

/* ---- points (depth_points.c, rig_read.c) ---- */

/* All points of a frame, of all its sensors: positions, normals that face the sensor, colours where there are
 * colour images, the sensor of each.  frame must be empty.  Sensors are decoded in parallel; the result does
 * not depend on it.  NPG_BAD_INPUT names the image.  A frame without a usable pixel has 0 points. */
npg_status npg_rig_read(npg_rig *rig, npg_frame *frame, size_t at, npg_origin *origin);

/* What one depth image gave, in the sensor's own axes. */
typedef struct npg_depth_points {
    size_t count, capacity;
    float *pos, *normals; /* N x 3 each, owned                      */
    uint8_t *colours;     /* N x 4, sRGB, alpha 0: not seen; owned  */
    uint32_t *pixels;     /* N, y x width + x, growing; owned       */
    bool has_colours;
} npg_depth_points;

npg_status npg_depth_points_read(npg_depth_points *points, npg_rig *rig, size_t sensor,
                                 const npg_rig_shot *shot);
void npg_depth_points_clear(npg_depth_points *points);

/* ---- agreement (rig_overlap.c) ---- */

#define NPG_RIG_COMPARED 24 /* frames at most in which sensors are compared */

/* A sensor's pose, by what it sees together with the others. */
typedef enum npg_rig_verdict {
    NPG_RIG_ALONE,   /* there is no other sensor                                    */
    NPG_RIG_FIXED,   /* the others are measured against it: most agree with it      */
    NPG_RIG_ALIGNED, /* within 0.001 of the depth (2.5 mm at 2.5 m) and 0.2 degrees */
    NPG_RIG_OFF,     /* beyond that, and beyond three deviations                    */
    NPG_RIG_UNKNOWN  /* what they see together does not determine it                */
} npg_rig_verdict;

typedef struct npg_rig_view {
    size_t frames, points; /* frames with an image among those looked at, and points in them  */
    double depth;          /* mean depth of all sensors' points, in the rig's unit             */
    double overlap;        /* share of its points that lie on what other sensors see, 0..1     */
    double apart;          /* distance to their surfaces there, standard deviation by the      */
                           /* median, in the rig's unit; 0: none                               */
    npg_rig_verdict verdict;
    double shift, turn_deg;       /* how far the pose is off: position, in the rig's unit; rotation */
    double shift_sd, turn_sd_deg; /* their standard deviations, infinite where nothing is known     */
    double correction[12];        /* x' = correction x, in the world; none unless it is OFF         */
} npg_rig_view;

/* Compare the surfaces that sensors see in up to NPG_RIG_COMPARED of the given frames (places in the rig),
 * spread over them; one entry per sensor.  Images that can't be read count as missing.  NPG_MEMORY. */
npg_status npg_rig_compare(npg_rig *rig, npg_rig_view *views, const size_t *frames, size_t count);

/* From now on use the corrections: npg_rig_pose() includes them. */
void npg_rig_correct(npg_rig *rig, const npg_rig_view *views);

/* ---- between the files of a rig ---- */

npg_status npg_rig_add_sensor(npg_rig *rig, npg_rig_sensor **sensor, const char *name);

/* Add an image; the paths are copied (NULL stays NULL). */
npg_status npg_rig_add_shot(npg_rig_sensor *sensor, const npg_rig_shot *shot);

/* Once all shots are there: frames by number or time.  NPG_BAD_INPUT when no image is left, or numbers or
 * times do not grow. */
npg_status npg_rig_join(npg_rig *rig);

npg_status npg_rig_load_json(npg_rig *rig);
npg_status npg_rig_load_redwood(npg_rig *rig);
npg_status npg_rig_load_tum(npg_rig *rig);
npg_status npg_rig_load_opencv(npg_rig *rig);

/* Images by lists of "time path" lines (paths from the list's folder), poses by a trajectory with times, or
 * none (NULL); colours are those nearest in time.  Images without a pose are left out and counted. */
npg_status npg_rig_load_timed(npg_rig *rig, npg_rig_sensor *sensor, const char *depth, const char *colour,
                              const char *poses);

bool npg_rig_ends_with(const char *name, const char *ending);

/* "<rig's folder>/<name>", refused under confine where it leads out; NPG_BAD_INPUT where it is not there and
 * must be. */
npg_status npg_rig_path(const npg_rig *rig, char **path, const char *name, bool must_be);

/* intrinsic.json as Open3D writes it: {"width", "height", "intrinsic_matrix": nine numbers, columns first}.
 * NPG_BAD_INPUT. */
npg_status npg_rig_read_intrinsic(npg_camera *camera, const char *path);

/* Where images are timed, or trajectories come in order: files of "time path" lines and of poses. */
typedef struct npg_stamped {
    double time_s;
    char *path;      /* of lists, owned */
    double pose[12]; /* of trajectories */
} npg_stamped;

typedef struct npg_stamped_list {
    npg_stamped *items; /* owned */
    size_t count, capacity;
} npg_stamped_list;

/* "time path" lines as TUM RGB-D has them; # begins a comment; times must grow. */
npg_status npg_read_image_list(npg_stamped_list *list, const char *path);
/* "time tx ty tz qx qy qz qw" lines (TUM), or blocks of three integers and a 4 x 4 matrix (Redwood; time_s is
 * then the place in the file).  The ending .log says Redwood. */
npg_status npg_read_trajectory(npg_stamped_list *list, const char *path);
void npg_stamped_clear(npg_stamped_list *list);
/* The nearest in time within the tolerance, NULL without one. */
const npg_stamped *npg_stamped_near(const npg_stamped_list *list, double time_s, double tolerance_s);

/* OpenCV's FileStorage, XML or YAML: matrices by name, numbers in rows.  *found is how many numbers there
 * are, 0 where the name is not in the file; more than `most` is NPG_BAD_INPUT. */
npg_status npg_opencv_open(char **text, const char *path);
npg_status npg_opencv_matrix(const char *text, const char *path, const char *name, double *values,
                             size_t most, size_t *found);

/* Rig report: what comparing sensors found, as JSON and text. */

/* Put "pose" ("aligned", "off" ...), "shift", "turn_deg", their deviations, and "correction" (four rows of
 * four, only where it is off) into a sensor's object; lengths in the rig's unit, null: not known. */
void npg_rig_report_pose(json_t *sensor, const npg_rig_view *view);

/* The same as one phrase: "off by 12.3 mm and 0.70 deg (deviation 0.8 mm, 0.03 deg)". */
void npg_rig_describe_pose(char *text, size_t size, const npg_rig *rig, const npg_rig_view *view);

/* A length in the rig's unit: "12.3 mm" where that is m, cm or mm. */
void npg_rig_describe_length(char *text, size_t size, const npg_rig *rig, double length);

#endif
