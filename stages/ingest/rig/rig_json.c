/* Our own layout: rig.json, one object with all sensors.  samples/guide/rigs.md describes every key.
 *
 *     {"neupig_rig": 1, "sensors": [{"depth": "front/depth_%04d.png", "camera": {...}, "pose": [...]}]} */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ingest/rig/rig_internal.h"
#include "pipeline/file.h"
#include "pipeline/order.h"

typedef struct place {
    const char *file;
    char at[128]; /* "sensors[1].camera" */
} place;

static npg_status bad(const place *p, const char *key, const char *what)
{
    return npg_error(NPG_BAD_INPUT, "%s: %s%s%s: %s", p->file, p->at, p->at[0] && key[0] ? "." : "", key,
                     what);
}

static place inside(const place *p, const char *key)
{
    place in = {.file = p->file};
    snprintf(in.at, sizeof in.at, "%.90s%s%.30s", p->at, p->at[0] ? "." : "", key);
    return in;
}

/* ---- values ---- */

static npg_status check_keys(const place *p, const json_t *object, const char *const *known)
{
    const char *key;
    json_t *value;
    char what[256] = "unknown key; known are";
    if (!json_is_object(object)) return bad(p, "", "must be an object");
    json_object_foreach((json_t *)object, key, value)
    {
        size_t k = 0;
        while (known[k] && strcmp(known[k], key) != 0) k++;
        if (known[k]) continue;
        for (size_t i = 0; known[i]; i++) {
            size_t used = strlen(what);
            snprintf(what + used, sizeof what - used, "%s %s", i ? "," : "", known[i]);
        }
        return bad(p, key, what);
    }
    return NPG_OK;
}

/* A number, finite; *value stays where the key is missing and may be. */
static npg_status get_number(const place *p, const json_t *object, const char *key, bool must_be,
                             double *value)
{
    const json_t *found = json_object_get(object, key);
    if (!found) return must_be ? bad(p, key, "is missing") : NPG_OK;
    if (!json_is_number(found)) return bad(p, key, "must be a number");
    *value = json_number_value(found);
    return isfinite(*value) ? NPG_OK : bad(p, key, "must be finite");
}

static npg_status get_text(const place *p, const json_t *object, const char *key, const char **text)
{
    const json_t *found = json_object_get(object, key);
    *text = NULL;
    if (!found) return NPG_OK;
    *text = json_string_value(found);
    return *text && **text && strlen(*text) < 4096 ? NPG_OK : bad(p, key, "must be a text, and not empty");
}

/* Up to `most` numbers; *count says how many there are. */
static npg_status get_numbers(const place *p, const json_t *object, const char *key, double *values,
                              size_t most, size_t *count)
{
    const json_t *found = json_object_get(object, key);
    *count = 0;
    if (!found) return NPG_OK;
    if (!json_is_array(found)) return bad(p, key, "must be a list of numbers");
    for (size_t i = 0; i < json_array_size(found); i++) {
        const json_t *item = json_array_get(found, i);
        if (i >= most) return bad(p, key, "has more numbers than it may have");
        if (!json_is_number(item) || !isfinite(json_number_value(item)))
            return bad(p, key, "must be a list of finite numbers");
        values[(*count)++] = json_number_value(item);
    }
    return NPG_OK;
}

/* Four rows of four; *is_there is false where the key is missing. */
static npg_status get_pose(const place *p, const json_t *object, const char *key, double pose[12],
                           bool *is_there)
{
    double m[16];
    size_t count;
    char where[512];
    NPG_TRY(get_numbers(p, object, key, m, 16, &count));
    *is_there = count > 0;
    if (!json_object_get(object, key)) return NPG_OK;
    if (count != 16) return bad(p, key, "must be 16 numbers: four rows of a 4 x 4 matrix");
    if (m[12] != 0 || m[13] != 0 || m[14] != 0 || m[15] != 1)
        return bad(p, key, "its last row must be 0 0 0 1");
    memcpy(pose, m, 12 * sizeof *m);
    snprintf(where, sizeof where, "%.300s: %s.%s", p->file, p->at, key);
    return npg_pose_check(pose, where);
}

/* ---- cameras ---- */

static npg_status get_side(const place *p, const json_t *object, const char *key, size_t *side)
{
    double value = 0;
    NPG_TRY(get_number(p, object, key, true, &value));
    if (!(value >= 1 && value <= NPG_IMAGE_SIDE_MAX && value == floor(value)))
        return bad(p, "width", "and height must be whole numbers of pixels");
    *side = (size_t)value;
    return NPG_OK;
}

static npg_status get_camera(const place *p, const json_t *object, npg_camera *camera, bool is_colour,
                             double from_depth[12])
{
    static const char *const keys[] = {"width", "height", "fx", "fy", "cx", "cy", "distortion", NULL};
    static const char *const colour_keys[] = {"width", "height",     "fx",         "fy", "cx",
                                              "cy",    "distortion", "from_depth", NULL};
    double *const values[] = {&camera->fx, &camera->fy, &camera->cx, &camera->cy};
    size_t count;
    char where[512];
    bool is_there;
    *camera = (npg_camera){0};
    NPG_TRY(check_keys(p, object, is_colour ? colour_keys : keys));
    NPG_TRY(get_side(p, object, "width", &camera->width));
    NPG_TRY(get_side(p, object, "height", &camera->height));
    for (size_t i = 0; i < 4; i++) NPG_TRY(get_number(p, object, keys[2 + i], true, values[i]));
    NPG_TRY(get_numbers(p, object, "distortion", camera->distortion, NPG_DISTORTIONS, &count));
    if (count && count != 4 && count != 5 && count != 8)
        return bad(p, "distortion", "must be 4, 5 or 8 numbers: k1 k2 p1 p2 [k3 [k4 k5 k6]]");
    if (is_colour) NPG_TRY(get_pose(p, object, "from_depth", from_depth, &is_there));
    snprintf(where, sizeof where, "%.300s: %s", p->file, p->at);
    return npg_camera_check(camera, where);
}

/* ---- images ---- */

/* Files of a numbered pattern, in order; the pattern starts from the rig's folder. */
static npg_status find_numbered(npg_rig *rig, const place *p, const char *key, const char *pattern,
                                npg_paths *paths)
{
    char *path;
    *paths = (npg_paths){.arena = &rig->arena};
    if (!strchr(pattern, '%') && !strchr(pattern, '#'))
        return bad(p, key,
                   "must be a pattern with the frame's number, such as depth_%04d.png, or a list *.txt");
    NPG_TRY(npg_rig_path(rig, &path, pattern, false));
    npg_status status = npg_paths_find(paths, path);
    if (status == NPG_USAGE) status = npg_error_restore(NPG_BAD_INPUT, npg_error_text());
    if (!status && !paths->numbers) status = bad(p, key, "must be a pattern with the frame's number");
    return status < 0 ? npg_error_prefix(status, "%s: %s.%s", p->file, p->at, key) : status;
}

static char *path_of_number(const npg_paths *paths, int64_t number)
{
    const int64_t *found =
        paths->count ? bsearch(&number, paths->numbers, paths->count, sizeof number, npg_order_int64) : NULL;
    return found ? paths->paths[found - paths->numbers] : NULL;
}

/* Poses in a file: by the frame's number, or in the order of the images. */
static npg_status give_poses(npg_rig_sensor *sensor, const place *p, const npg_stamped_list *poses,
                             bool is_ordered)
{
    char what[160];
    if (is_ordered && poses->count != sensor->shot_count) {
        snprintf(what, sizeof what, "%zu poses, but %zu depth images", poses->count, sensor->shot_count);
        return bad(p, "poses", what);
    }
    for (size_t i = 0; i < sensor->shot_count; i++) {
        npg_rig_shot *shot = &sensor->shots[i];
        const npg_stamped *pose =
            is_ordered ? &poses->items[i] : npg_stamped_near(poses, (double)shot->number, 0);
        if (!pose) {
            snprintf(what, sizeof what, "there is no pose for frame %lld", (long long)shot->number);
            return bad(p, "poses", what);
        }
        shot->has_pose = true;
        memcpy(shot->pose, pose->pose, sizeof shot->pose);
    }
    return NPG_OK;
}

static npg_status read_poses(npg_rig *rig, npg_rig_sensor *sensor, const place *p, const char *name)
{
    char *path;
    npg_arena scratch = {.purpose = NPG_FOR_FILES};
    npg_stamped_list poses;
    NPG_TRY(npg_rig_path(rig, &path, name, true));
    npg_status status = npg_read_trajectory(&poses, &scratch, path);
    if (!status) status = give_poses(sensor, p, &poses, npg_rig_ends_with(name, ".log"));
    npg_arena_release(&scratch);
    return status;
}

static const char *const image_keys[] = {"depth", "colour", "mask"};

/* Every depth image needs its colour image and mask, if there are any for this sensor: where one is missing
 * the recording is out of step. */
static npg_status add_numbered(npg_rig *rig, npg_rig_sensor *sensor, const place *p, const npg_paths lists[3],
                               const char *names[3])
{
    for (size_t i = 0; i < lists[0].count; i++) {
        npg_rig_shot shot = {.number = lists[0].numbers[i], .depth = lists[0].paths[i]};
        char **paths[] = {NULL, &shot.colour, &shot.mask};
        for (size_t k = 1; k < 3; k++) {
            if (!names[k]) continue;
            *paths[k] = path_of_number(&lists[k], shot.number);
            if (*paths[k]) continue;
            char what[160];
            snprintf(what, sizeof what, "frame %lld has a depth image, but none of these",
                     (long long)shot.number);
            return bad(p, image_keys[k], what);
        }
        NPG_TRY(npg_rig_add_shot(rig, sensor, &shot));
    }
    return NPG_OK;
}

static npg_status load_numbered(npg_rig *rig, npg_rig_sensor *sensor, const place *p, const char *names[3])
{
    npg_paths lists[3];
    for (size_t k = 0; k < 3; k++)
        if (names[k]) NPG_TRY(find_numbered(rig, p, image_keys[k], names[k], &lists[k]));
    return add_numbered(rig, sensor, p, lists, names);
}

static bool is_list(const char *name)
{
    return npg_rig_ends_with(name, ".txt");
}

/* ---- sensors ---- */

static npg_status load_images(npg_rig *rig, npg_rig_sensor *sensor, const place *p, const json_t *object)
{
    const char *names[3], *poses;
    for (size_t k = 0; k < 3; k++) NPG_TRY(get_text(p, object, image_keys[k], &names[k]));
    NPG_TRY(get_text(p, object, "poses", &poses));
    if (!names[0]) return bad(p, "depth", "is missing");
    bool is_timed = is_list(names[0]);
    if (rig->sensor_count > 1 && is_timed != rig->is_timed)
        return bad(p, "depth", "either all sensors have lists with times, or none");
    rig->is_timed = is_timed;
    if (is_timed && names[2]) return bad(p, "mask", "goes with numbered images, not with lists");
    if (is_timed && names[1] && !is_list(names[1]))
        return bad(p, "colour", "must be a list *.txt as depth is");
    if (is_timed) return npg_rig_load_timed(rig, sensor, names[0], names[1], poses);
    NPG_TRY(load_numbered(rig, sensor, p, names));
    return poses ? read_poses(rig, sensor, p, poses) : NPG_OK;
}

/* Two sensors with the same images: a copied line of the description. */
static npg_status check_alone(const npg_rig *rig, const npg_rig_sensor *sensor, const place *p)
{
    char what[160];
    for (const npg_rig_sensor *other = rig->sensors; other < sensor && sensor->shot_count; other++) {
        if (!other->shot_count || strcmp(other->shots[0].depth, sensor->shots[0].depth) != 0) continue;
        snprintf(what, sizeof what, "its images are those of sensor %.80s, too", other->name);
        return bad(p, "depth", what);
    }
    return NPG_OK;
}

static npg_status load_sensor(npg_rig *rig, const place *p, const json_t *object, double scale,
                              bool is_opengl)
{
    static const char *const keys[] = {"name", "depth", "colour",      "mask", "camera", "colour_camera",
                                       "pose", "poses", "depth_scale", "near", "far",    NULL};
    char number[32];
    const char *name;
    npg_rig_sensor *sensor;
    bool has_pose;
    NPG_TRY(check_keys(p, object, keys));
    NPG_TRY(get_text(p, object, "name", &name));
    snprintf(number, sizeof number, "%zu", rig->sensor_count);
    NPG_TRY(npg_rig_add_sensor(rig, &sensor, name ? name : number));
    sensor->scale = scale;
    sensor->is_opengl = is_opengl;
    NPG_TRY(get_number(p, object, "depth_scale", false, &sensor->scale));
    NPG_TRY(get_number(p, object, "near", false, &sensor->near_m));
    NPG_TRY(get_number(p, object, "far", false, &sensor->far_m));
    if (!(sensor->scale > 0)) return bad(p, "depth_scale", "must be more than 0");
    if (sensor->far_m > 0 && sensor->near_m >= sensor->far_m) return bad(p, "near", "must be less than far");
    const json_t *camera = json_object_get(object, "camera"),
                 *other = json_object_get(object, "colour_camera");
    if (!camera) return bad(p, "camera", "is missing: the intrinsics of the depth image");
    place in = inside(p, "camera"), in_colour = inside(p, "colour_camera");
    NPG_TRY(get_camera(&in, camera, &sensor->camera, false, NULL));
    sensor->has_colour_camera = other != NULL;
    if (other) NPG_TRY(get_camera(&in_colour, other, &sensor->colour_camera, true, sensor->depth_to_colour));
    NPG_TRY(get_pose(p, object, "pose", sensor->pose, &has_pose));
    if (has_pose && json_object_get(object, "poses"))
        return bad(p, "poses", "a sensor has either one pose or one per frame");
    NPG_TRY(load_images(rig, sensor, p, object));
    return check_alone(rig, sensor, p);
}

static npg_status load_root(npg_rig *rig, const char *file, const json_t *root)
{
    static const char *const keys[] = {"neupig_rig", "comment", "depth_scale", "axes",
                                       "tolerance",  "unit",    "sensors",     NULL};
    const place top = {.file = file};
    const char *axes, *text;
    double scale = 0.001, version = 0;
    NPG_TRY(check_keys(&top, root, keys));
    NPG_TRY(get_number(&top, root, "neupig_rig", true, &version));
    if (version != 1) return bad(&top, "neupig_rig", "this program knows version 1");
    NPG_TRY(get_number(&top, root, "depth_scale", false, &scale));
    NPG_TRY(get_number(&top, root, "tolerance", false, &rig->settings.tolerance_s));
    NPG_TRY(get_text(&top, root, "axes", &axes));
    NPG_TRY(get_text(&top, root, "comment", &text));
    NPG_TRY(get_text(&top, root, "unit", &text));
    if (text) rig->unit = npg_arena_text(&rig->arena, text);
    if (axes && strcmp(axes, "opencv") != 0 && strcmp(axes, "opengl") != 0)
        return bad(&top, "axes",
                   "must be opencv (x right, y down, z ahead) or opengl (x right, y up, z back)");
    const json_t *sensors = json_object_get(root, "sensors");
    if (!json_array_size(sensors)) return bad(&top, "sensors", "must be a list of at least one sensor");
    for (size_t s = 0; s < json_array_size(sensors); s++) {
        char key[32];
        snprintf(key, sizeof key, "sensors[%zu]", s);
        place p = inside(&top, key);
        NPG_TRY(load_sensor(rig, &p, json_array_get(sensors, s), scale, axes && !strcmp(axes, "opengl")));
    }
    return NPG_OK;
}

npg_status npg_rig_load_json(npg_rig *rig)
{
    json_t *root;
    char *file = npg_rig_ends_with(rig->path, ".json") ? rig->path
                                                       : npg_arena_path(&rig->arena, rig->path, "rig.json");
    NPG_TRY(npg_arena_status(&rig->arena));
    npg_status status = npg_json_read(&root, file, NPG_RIG_TEXT_MAX);
    if (status == NPG_USAGE) status = npg_error_restore(NPG_BAD_INPUT, npg_error_text());
    if (!status) status = load_root(rig, file, root);
    json_decref(root);
    return status;
}
