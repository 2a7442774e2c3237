/* Our own layout: rig.json, one object with all sensors.  samples/guide/rigs.md describes every key.
 *
 *     {"neupig_rig": 1, "sensors": [{"depth": "front/depth_%04d.png", "camera": {...}, "pose": [...]}]} */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ingest/rig/rig_internal.h"
#include "pipeline/file.h"
#include "pipeline/order.h"

#define SHOTS_MAX 4000000            /* images of one sensor: 18 hours at 60 a second */
#define TEXT_MAX  ((size_t)64 << 20) /* bytes of a rig.json                           */

/* at: the place of the object in the file, "sensors[1].camera". */
static npg_status NPG_PRINTF(3, 4) bad(const char *at, const char *key, const char *format, ...)
{
    char what[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    return npg_error(NPG_BAD_INPUT, "%s%s%s: %s", at, at[0] && key[0] ? "." : "", key, what);
}

/* ---- values ---- */

typedef enum kind { NUMBER, NUMBER_NEEDED, TEXT, ANY } kind;

/* What a key of an object may hold, and where its value goes; that stays as it is where the key is missing. */
typedef struct member {
    const char *name;
    kind kind;
    void *value; /* double, const char * or const json_t *; NULL: of no interest */
} member;

static npg_status take_value(const char *at, const member *k, const json_t *found)
{
    if (!found) return k->kind == NUMBER_NEEDED ? bad(at, k->name, "is missing") : NPG_OK;
    if (k->kind == ANY) {
        *(const json_t **)k->value = found;
    } else if (k->kind == TEXT) {
        const char *text = json_string_value(found);
        if (!text || !*text || strlen(text) >= 4096) return bad(at, k->name, "must be a text, and not empty");
        if (k->value) *(const char **)k->value = text;
    } else {
        if (!json_is_number(found)) return bad(at, k->name, "must be a number");
        *(double *)k->value = json_number_value(found);
        if (!isfinite(json_number_value(found))) return bad(at, k->name, "must be finite");
    }
    return NPG_OK;
}

/* Refuse an object with other keys, and take the values of these. */
static npg_status take(const char *at, const json_t *object, const member *keys, size_t count)
{
    const char *name;
    json_t *value;
    char what[256] = "unknown key; known are";
    if (!json_is_object(object)) return bad(at, "", "must be an object");
    json_object_foreach((json_t *)object, name, value)
    {
        size_t k = 0;
        while (k < count && strcmp(keys[k].name, name) != 0) k++;
        if (k < count) continue;
        for (size_t i = 0; i < count; i++) {
            size_t used = strlen(what);
            snprintf(what + used, sizeof what - used, "%s %s", i ? "," : "", keys[i].name);
        }
        return bad(at, name, "%s", what);
    }
    for (size_t k = 0; k < count; k++)
        NPG_TRY(take_value(at, &keys[k], json_object_get(object, keys[k].name)));
    return NPG_OK;
}

/* Up to `most` numbers, in one list or in rows; *count says how many there are. */
static npg_status get_numbers(const char *at, const char *key, const json_t *found, double *values,
                              size_t most, size_t *count)
{
    *count = 0;
    if (!json_is_array(found)) return bad(at, key, "must be a list of numbers");
    for (size_t i = 0; i < json_array_size(found); i++) {
        const json_t *item = json_array_get(found, i);
        if (json_is_array(item)) {
            size_t more;
            NPG_TRY(get_numbers(at, key, item, values + *count, most - *count, &more));
            *count += more;
            continue;
        }
        if (*count >= most) return bad(at, key, "has more numbers than it may have");
        if (!json_is_number(item) || !isfinite(json_number_value(item)))
            return bad(at, key, "must be a list of finite numbers");
        values[(*count)++] = json_number_value(item);
    }
    return NPG_OK;
}

/* Four rows of four; found may be NULL. */
static npg_status get_pose(const char *at, const char *key, const json_t *found, double pose[12])
{
    double m[16];
    size_t count;
    char where[256];
    if (!found) return NPG_OK;
    NPG_TRY(get_numbers(at, key, found, m, 16, &count));
    if (count != 16) return bad(at, key, "must be 16 numbers: four rows of a 4 x 4 matrix");
    if (m[12] != 0 || m[13] != 0 || m[14] != 0 || m[15] != 1)
        return bad(at, key, "its last row must be 0 0 0 1");
    memcpy(pose, m, 12 * sizeof *m);
    snprintf(where, sizeof where, "%s.%s", at, key);
    return npg_pose_check(pose, where);
}

/* ---- cameras ---- */

/* from_depth: NULL for a camera of depth images, which has no such key. */
static npg_status get_camera(const char *at, const json_t *object, npg_camera *camera, double from_depth[12])
{
    double width = 0, height = 0;
    const json_t *distortion = NULL, *matrix = NULL;
    size_t count = 0;
    *camera = (npg_camera){0};
    const member keys[] = {{"width", NUMBER_NEEDED, &width},   {"height", NUMBER_NEEDED, &height},
                           {"fx", NUMBER_NEEDED, &camera->fx}, {"fy", NUMBER_NEEDED, &camera->fy},
                           {"cx", NUMBER_NEEDED, &camera->cx}, {"cy", NUMBER_NEEDED, &camera->cy},
                           {"distortion", ANY, &distortion},   {"from_depth", ANY, &matrix}};
    NPG_TRY(take(at, object, keys, sizeof keys / sizeof *keys - !from_depth));
    if (!(fmin(width, height) >= 1 && fmax(width, height) <= NPG_IMAGE_SIDE_MAX && width == floor(width) &&
          height == floor(height)))
        return bad(at, "width", "and height must be whole numbers of pixels");
    camera->width = (size_t)width;
    camera->height = (size_t)height;
    if (distortion)
        NPG_TRY(get_numbers(at, "distortion", distortion, camera->distortion, NPG_DISTORTIONS, &count));
    if (distortion && count != 4 && count != 5 && count != 8)
        return bad(at, "distortion", "must be 4, 5 or 8 numbers: k1 k2 p1 p2 [k3 [k4 k5 k6]]");
    NPG_TRY(get_pose(at, "from_depth", matrix, from_depth));
    return npg_camera_check(camera, at);
}

/* ---- images ---- */

/* Files of a numbered pattern, in order; the pattern starts from the rig's folder. */
static npg_status find_numbered(npg_rig *rig, const char *at, const char *key, const char *pattern,
                                npg_listing *paths)
{
    char *path;
    if (!pattern || (!strchr(pattern, '%') && !strchr(pattern, '#')))
        return bad(at, key,
                   "must be a pattern with the frame's number, such as depth_%%04d.png, or a list of images "
                   "(rig_json.py makes it of a file with times)");
    NPG_TRY(npg_rig_path(rig, &path, pattern, false));
    npg_status status = npg_paths_find(paths, path);
    if (status == NPG_USAGE) status = npg_error_set(NPG_BAD_INPUT, npg_error_text());
    if (!status && !paths->numbers) status = bad(at, key, "must be a pattern with the frame's number");
    return status < 0 ? npg_error_prefix(status, "%s.%s", at, key) : status;
}

/* Files that are listed, numbered from 0. */
static npg_status find_listed(npg_rig *rig, const char *at, const char *key, const json_t *list,
                              npg_listing *paths)
{
    size_t count = json_array_size(list);
    paths->is_listed = true;
    paths->paths = npg_arena_take(paths->arena, count + 1, sizeof *paths->paths);
    paths->numbers = npg_arena_take(paths->arena, count + 1, sizeof *paths->numbers);
    NPG_TRY(npg_arena_status(paths->arena));
    for (size_t i = 0; i < count; i++) {
        const json_t *item = json_array_get(list, i);
        const char *name = json_string_value(item);
        if (json_is_null(item)) continue;
        if (!name || !*name || strlen(name) >= 4096)
            return bad(at, key, "must hold the names of images, and null for frames without one");
        paths->numbers[paths->count] = (int64_t)i;
        NPG_TRY(npg_rig_path(rig, &paths->paths[paths->count++], name, true));
    }
    return NPG_OK;
}

static npg_status add_sensor(npg_rig *rig, npg_rig_sensor **out)
{
    if (rig->sensor_count >= NPG_FRAME_SENSORS_MOST)
        return npg_error(NPG_BAD_INPUT, "more than %d sensors", NPG_FRAME_SENSORS_MOST);
    NPG_TRY(npg_arena_grow(&rig->arena, &rig->sensors, &rig->sensor_capacity, rig->sensor_count + 1,
                           sizeof *rig->sensors));
    npg_rig_sensor *sensor = &rig->sensors[rig->sensor_count++];
    *sensor = (npg_rig_sensor){0};
    npg_pose_identity(sensor->pose);
    npg_pose_identity(sensor->depth_to_colour);
    npg_pose_identity(sensor->correction);
    *out = sensor;
    return NPG_OK;
}

static npg_status add_shot(npg_rig *rig, npg_rig_sensor *sensor, const npg_rig_shot *shot)
{
    if (sensor->shot_count >= SHOTS_MAX)
        return npg_error(NPG_BAD_INPUT, "sensor %s: more than %d images", sensor->name, SHOTS_MAX);
    NPG_TRY(npg_arena_grow(&rig->arena, &sensor->shots, &sensor->shot_capacity, sensor->shot_count + 1,
                           sizeof *sensor->shots));
    sensor->shots[sensor->shot_count++] = *shot;
    return NPG_OK;
}

static char *path_of_number(const npg_listing *paths, int64_t number)
{
    const int64_t *found =
        paths->count ? bsearch(&number, paths->numbers, paths->count, sizeof number, npg_order_int64) : NULL;
    return found ? paths->paths[found - paths->numbers] : NULL;
}

static const char *const image_keys[] = {"depth", "colour", "mask"};

/* Of images with numbers every one of depth needs its colour image and mask, if there are any for this sensor: where
 * one is missing the recording is out of step. */
static npg_status load_images(npg_rig *rig, npg_rig_sensor *sensor, const char *at,
                              const json_t *const images[3])
{
    npg_listing lists[3];
    for (size_t k = 0; k < 3; k++) {
        lists[k] = (npg_listing){.arena = &rig->arena};
        if (images[k])
            NPG_TRY(json_is_array(images[k])
                        ? find_listed(rig, at, image_keys[k], images[k], &lists[k])
                        : find_numbered(rig, at, image_keys[k], json_string_value(images[k]), &lists[k]));
    }
    for (size_t i = 0; i < lists[0].count; i++) {
        npg_rig_shot shot = {.number = lists[0].numbers[i], .depth = lists[0].paths[i]};
        char **paths[] = {NULL, &shot.colour, &shot.mask};
        for (size_t k = 1; k < 3; k++) {
            *paths[k] = path_of_number(&lists[k], shot.number);
            if (!images[k] || *paths[k] || lists[k].is_listed) continue;
            return bad(at, image_keys[k], "frame %lld has a depth image, but none of these",
                       (long long)shot.number);
        }
        NPG_TRY(add_shot(rig, sensor, &shot));
    }
    return NPG_OK;
}

/* One for each depth image, in their order. */
static npg_status get_poses(npg_rig_sensor *sensor, const char *at, const json_t *poses)
{
    char text[32];
    if (json_array_size(poses) != sensor->shot_count)
        return bad(at, "poses", "%zu poses, but %zu depth images (rig_json.py lists those of a file)",
                   json_array_size(poses), sensor->shot_count);
    for (size_t i = 0; i < sensor->shot_count; i++) {
        snprintf(text, sizeof text, "poses[%zu]", i);
        NPG_TRY(get_pose(at, text, json_array_get(poses, i), sensor->shots[i].pose));
        sensor->shots[i].has_pose = true;
    }
    return NPG_OK;
}

/* ---- sensors ---- */

/* Two sensors with the same images: a copied line of the description. */
static npg_status check_alone(const npg_rig *rig, const npg_rig_sensor *sensor, const char *at)
{
    for (const npg_rig_sensor *other = rig->sensors; other < sensor && sensor->shot_count; other++) {
        if (!other->shot_count || strcmp(other->shots[0].depth, sensor->shots[0].depth) != 0) continue;
        return bad(at, "depth", "its images are those of sensor %.80s, too", other->name);
    }
    return NPG_OK;
}

static npg_status load_sensor(npg_rig *rig, const char *at, const json_t *object, double scale,
                              bool is_opengl)
{
    char number[32];
    const char *name = number;
    const json_t *images[3] = {NULL}, *camera = NULL, *other = NULL, *pose = NULL, *poses = NULL;
    npg_rig_sensor *sensor = NULL;
    snprintf(number, sizeof number, "%zu", rig->sensor_count);
    NPG_TRY(add_sensor(rig, &sensor));
    sensor->scale = scale;
    sensor->is_opengl = is_opengl;
    const member keys[] = {{"name", TEXT, &name},
                           {"depth", ANY, &images[0]},
                           {"colour", ANY, &images[1]},
                           {"mask", ANY, &images[2]},
                           {"camera", ANY, &camera},
                           {"colour_camera", ANY, &other},
                           {"pose", ANY, &pose},
                           {"poses", ANY, &poses},
                           {"near", NUMBER, &sensor->near_m},
                           {"far", NUMBER, &sensor->far_m},
                           {"depth_scale", NUMBER, &sensor->scale}};
    NPG_TRY(take(at, object, keys, sizeof keys / sizeof *keys));
    sensor->name = npg_arena_text(&rig->arena, name);
    NPG_TRY(npg_arena_status(&rig->arena));
    if (!(sensor->scale > 0)) return bad(at, "depth_scale", "must be more than 0");
    if (sensor->far_m > 0 && sensor->near_m >= sensor->far_m) return bad(at, "near", "must be less than far");
    if (!images[0]) return bad(at, "depth", "is missing");
    if (!camera) return bad(at, "camera", "is missing: the intrinsics of the depth image");
    if (pose && poses) return bad(at, "poses", "a sensor has either one pose or one per frame");
    char in[64], in_colour[64];
    snprintf(in, sizeof in, "%s.camera", at);
    snprintf(in_colour, sizeof in_colour, "%s.colour_camera", at);
    NPG_TRY(get_camera(in, camera, &sensor->camera, NULL));
    sensor->has_colour_camera = other != NULL;
    if (other) NPG_TRY(get_camera(in_colour, other, &sensor->colour_camera, sensor->depth_to_colour));
    NPG_TRY(get_pose(at, "pose", pose, sensor->pose));
    NPG_TRY(load_images(rig, sensor, at, images));
    if (poses) NPG_TRY(get_poses(sensor, at, poses));
    return check_alone(rig, sensor, at);
}

static npg_status load_root(npg_rig *rig, const json_t *root)
{
    const char *axes = "opencv", *unit = NULL;
    const json_t *sensors = NULL;
    double scale = 0.001, version = 0;
    const member keys[] = {{"neupig_rig", NUMBER_NEEDED, &version},
                           {"comment", TEXT, NULL},
                           {"depth_scale", NUMBER, &scale},
                           {"axes", TEXT, &axes},
                           {"unit", TEXT, &unit},
                           {"sensors", ANY, &sensors}};
    NPG_TRY(take("", root, keys, sizeof keys / sizeof *keys));
    if (version != 1) return bad("", "neupig_rig", "this program knows version 1");
    if (unit) rig->unit = npg_arena_text(&rig->arena, unit);
    const bool is_opengl = !strcmp(axes, "opengl");
    if (!is_opengl && strcmp(axes, "opencv") != 0)
        return bad("", "axes", "must be opencv (x right, y down, z ahead) or opengl (x right, y up, z back)");
    if (!json_array_size(sensors)) return bad("", "sensors", "must be a list of at least one sensor");
    for (size_t s = 0; s < json_array_size(sensors); s++) {
        char at[32];
        snprintf(at, sizeof at, "sensors[%zu]", s);
        NPG_TRY(load_sensor(rig, at, json_array_get(sensors, s), scale, is_opengl));
    }
    return NPG_OK;
}

npg_status npg_rig_load_json(npg_rig *rig)
{
    json_t *root;
    char *file = npg_is_folder(rig->path) ? npg_arena_path(&rig->arena, rig->path, "rig.json") : rig->path;
    NPG_TRY(npg_arena_status(&rig->arena));
    npg_status status = npg_json_read(&root, file, TEXT_MAX);
    if (status == NPG_USAGE) status = npg_error_set(NPG_BAD_INPUT, npg_error_text());
    if (!status && (status = load_root(rig, root)) == NPG_BAD_INPUT) npg_error_prefix(status, "%s", file);
    json_decref(root);
    return status;
}
