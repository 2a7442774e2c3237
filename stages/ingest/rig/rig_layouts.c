/* Layouts of others: TUM RGB-D, Redwood (Open3D), and OpenCV files per frame. */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "ingest/rig/rig_internal.h"
#include "pipeline/file.h"

/* ---- names of images in a folder ---- */

typedef struct names {
    char **paths; /* owned */
    size_t count, capacity;
} names;

static void clear_names(names *list)
{
    for (size_t i = 0; i < list->count; i++) npg_release(&list->paths[i]);
    npg_release(&list->paths);
    *list = (names){0};
}

static int by_name(const void *a, const void *b)
{
    const char *left = *(char *const *)a, *right = *(char *const *)b;
    int order = npg_natural_compare(left, right);
    return order ? order : strcmp(left, right);
}

static bool has_ending(const char *name, const char *const *endings)
{
    size_t length = strlen(name);
    for (; *endings; endings++) {
        size_t size = strlen(*endings);
        if (length > size && !strcasecmp(name + length - size, *endings)) return true;
    }
    return false;
}

/* Files of a folder with one of the endings, in natural order. */
static npg_status list_names(names *list, const char *folder, const char *const *endings)
{
    npg_status status = NPG_OK;
    DIR *listing = opendir(folder);
    if (!listing) return npg_error_errno(NPG_BAD_INPUT, "can't read %s", folder);
    for (struct dirent *entry; !status && (entry = readdir(listing));) {
        if (entry->d_name[0] == '.' || !has_ending(entry->d_name, endings)) continue;
        if (list->count >= NPG_RIG_SHOTS_MAX)
            status = npg_error(NPG_BAD_INPUT, "%s: more than %d images", folder, NPG_RIG_SHOTS_MAX);
        if (!status)
            status =
                npg_grow(&list->paths, &list->capacity, list->count + 1, sizeof *list->paths, NPG_FOR_FILES);
        if (!status) status = npg_join_path(&list->paths[list->count], folder, entry->d_name);
        if (!status) list->count++;
    }
    closedir(listing);
    if (list->count) qsort(list->paths, list->count, sizeof *list->paths, by_name);
    return status;
}

/* ---- images with times ---- */

/* A path as a list names it: from the list's folder. */
static npg_status path_in_list(const npg_rig *rig, char **path, const char *list, const char *name)
{
    const char *slash = strrchr(list, '/');
    char joined[8192];
    int length = slash && name[0] != '/'
                     ? snprintf(joined, sizeof joined, "%.*s/%s", (int)(slash - list), list, name)
                     : snprintf(joined, sizeof joined, "%s", name);
    if (length < 0 || (size_t)length >= sizeof joined)
        return npg_error(NPG_BAD_INPUT, "%s: a path is too long", list);
    return npg_rig_path(rig, path, joined, true);
}

typedef struct timed {
    npg_stamped_list depth, colour, poses;
} timed;

static npg_status read_timed(timed *t, const npg_rig *rig, const char *depth, const char *colour,
                             const char *poses)
{
    const char *const files[] = {depth, colour, poses};
    npg_stamped_list *const lists[] = {&t->depth, &t->colour, &t->poses};
    for (size_t i = 0; i < 3; i++) {
        char *path;
        if (!files[i]) continue;
        NPG_TRY(npg_rig_path(rig, &path, files[i], true));
        npg_status status = i < 2 ? npg_read_image_list(lists[i], path) : npg_read_trajectory(lists[i], path);
        npg_release(&path);
        NPG_TRY(status);
    }
    return NPG_OK;
}

static npg_status add_timed(npg_rig *rig, npg_rig_sensor *sensor, const timed *t, const char *const files[3])
{
    double tolerance = rig->settings.tolerance_s;
    for (size_t i = 0; i < t->depth.count; i++) {
        npg_rig_shot shot = {.time_s = t->depth.items[i].time_s, .number = (int64_t)i};
        const npg_stamped *colour = npg_stamped_near(&t->colour, shot.time_s, tolerance),
                          *pose = npg_stamped_near(&t->poses, shot.time_s, tolerance);
        if (files[2] && !pose) {
            rig->left_out++;
            continue;
        }
        shot.has_pose = pose != NULL;
        if (pose) memcpy(shot.pose, pose->pose, sizeof shot.pose);
        npg_status status = path_in_list(rig, &shot.depth, files[0], t->depth.items[i].path);
        if (!status && colour) status = path_in_list(rig, &shot.colour, files[1], colour->path);
        if (!status) status = npg_rig_add_shot(sensor, &shot);
        npg_release(&shot.depth);
        npg_release(&shot.colour);
        NPG_TRY(status);
    }
    if (sensor->shot_count) return NPG_OK;
    return npg_error(NPG_BAD_INPUT,
                     "%s: none of the %zu depth images of %s has a pose within %g s: images out of step",
                     rig->path, t->depth.count, files[0], tolerance);
}

npg_status npg_rig_load_timed(npg_rig *rig, npg_rig_sensor *sensor, const char *depth, const char *colour,
                              const char *poses)
{
    timed t = {0};
    const char *const files[] = {depth, colour, poses};
    rig->is_timed = true;
    npg_status status = read_timed(&t, rig, depth, colour, poses);
    if (!status) status = add_timed(rig, sensor, &t, files);
    npg_stamped_clear(&t.depth);
    npg_stamped_clear(&t.colour);
    npg_stamped_clear(&t.poses);
    return status;
}

/* ---- TUM RGB-D ---- */

/* An intrinsic.json of Open3D's kind lies in the folder; false where there is none. */
static npg_status find_intrinsic(const npg_rig *rig, npg_camera *camera, bool *found)
{
    static const char *const usual[] = {"intrinsic.json", "camera_intrinsic.json"};
    *found = false;
    for (size_t i = 0; i < 2 && !*found; i++) {
        char *path;
        NPG_TRY(npg_rig_path(rig, &path, usual[i], false));
        *found = npg_is_there(path);
        npg_status status = *found ? npg_rig_read_intrinsic(camera, path) : NPG_OK;
        npg_release(&path);
        NPG_TRY(status);
    }
    return NPG_OK;
}

npg_status npg_rig_load_tum(npg_rig *rig)
{
    npg_rig_sensor *sensor;
    char *colours = NULL, *poses = NULL;
    bool has_camera;
    NPG_TRY(npg_rig_add_sensor(rig, &sensor, "tum"));
    sensor->scale = 1.0 / 5000; /* of the data set's format description */
    NPG_TRY(find_intrinsic(rig, &sensor->camera, &has_camera));
    /* The default calibration that the data set's own tools use; its folders hold none. */
    if (!has_camera)
        sensor->camera =
            (npg_camera){.width = 640, .height = 480, .fx = 525, .fy = 525, .cx = 319.5, .cy = 239.5};
    npg_status status = npg_rig_path(rig, &colours, "rgb.txt", false);
    if (!status) status = npg_rig_path(rig, &poses, "groundtruth.txt", false);
    if (!status)
        status = npg_rig_load_timed(rig, sensor, "depth.txt", npg_is_there(colours) ? "rgb.txt" : NULL,
                                    npg_is_there(poses) ? "groundtruth.txt" : NULL);
    npg_release(&colours);
    npg_release(&poses);
    return status;
}

/* ---- Redwood, Open3D ---- */

/* Poses in the order of the images, one each. */
static npg_status read_log(const npg_rig *rig, npg_stamped_list *poses, size_t image_count)
{
    char *path;
    NPG_TRY(npg_rig_path(rig, &path, "trajectory.log", false));
    npg_status status = npg_is_there(path) ? npg_read_trajectory(poses, path) : NPG_OK;
    if (!status && poses->count && poses->count != image_count)
        status = npg_error(NPG_BAD_INPUT, "%s: %zu poses, but %zu depth images: images out of step", path,
                           poses->count, image_count);
    npg_release(&path);
    return status;
}

static npg_status add_redwood(npg_rig *rig, npg_rig_sensor *sensor, const names *depth, const names *colour)
{
    npg_stamped_list poses = {0};
    if (colour->count && colour->count != depth->count)
        return npg_error(NPG_BAD_INPUT, "%s: %zu depth and %zu colour images: images out of step", rig->path,
                         depth->count, colour->count);
    npg_status status = read_log(rig, &poses, depth->count);
    for (size_t i = 0; i < depth->count && !status; i++) {
        npg_rig_shot shot = {.number = (int64_t)i,
                             .depth = depth->paths[i],
                             .colour = colour->count ? colour->paths[i] : NULL,
                             .has_pose = poses.count > 0};
        if (poses.count) memcpy(shot.pose, poses.items[i].pose, sizeof shot.pose);
        status = npg_rig_add_shot(sensor, &shot);
    }
    npg_stamped_clear(&poses);
    return status;
}

npg_status npg_rig_load_redwood(npg_rig *rig)
{
    static const char *const png[] = {".png", NULL}, *const any[] = {".png", ".jpg", ".jpeg", NULL};
    static const char *const colour_folders[] = {"color", "colour", "rgb", "image"};
    npg_rig_sensor *sensor;
    char *folder;
    names depth = {0}, colour = {0};
    bool has_camera;
    NPG_TRY(npg_rig_add_sensor(rig, &sensor, "redwood"));
    NPG_TRY(find_intrinsic(rig, &sensor->camera, &has_camera));
    NPG_TRY(npg_rig_path(rig, &folder, "depth", true));
    npg_status status = list_names(&depth, folder, png);
    npg_release(&folder);
    for (size_t i = 0; i < sizeof colour_folders / sizeof *colour_folders && !status && !colour.count; i++) {
        status = npg_rig_path(rig, &folder, colour_folders[i], false);
        if (!status && npg_is_there(folder)) status = list_names(&colour, folder, any);
        npg_release(&folder);
    }
    if (!status) status = add_redwood(rig, sensor, &depth, &colour);
    clear_names(&depth);
    clear_names(&colour);
    return status;
}

/* ---- OpenCV files per frame: NNNN_depth.png, NNNN.jpg, NNNN_mask.jpg, NNNN_camera.xml ---- */

/* "<stem><ending>" beside a depth image, for the first ending that is there; NULL for none. */
static npg_status beside(char **path, const char *depth, const char *const *endings)
{
    size_t stem = strlen(depth) - strlen("_depth.png");
    *path = NULL;
    for (; *endings && !*path; endings++) {
        NPG_TRY(npg_alloc(path, NPG_FOR_FILES, stem + strlen(*endings) + 1));
        memcpy(*path, depth, stem);
        strcpy(*path + stem, *endings);
        if (!npg_is_there(*path)) npg_release(path);
    }
    return NPG_OK;
}

static npg_status get_matrix(const char *text, const char *path, const char *const *usual, double *values,
                             size_t count)
{
    size_t found = 0;
    for (const char *const *name = usual; *name && !found; name++)
        NPG_TRY(npg_opencv_matrix(text, path, *name, values, count, &found));
    if (found == count) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s: \"%s\" has %zu numbers, not %zu", path, usual[0], found, count);
}

static npg_status camera_of(npg_camera *camera, const char *text, const char *path)
{
    static const char *const matrices[] = {"intrinsic", "camera_matrix", "cameraMatrix", "K", NULL};
    static const char *const lenses[] = {"distortion", "distortion_coefficients", "distCoeffs", "D"};
    double k[9];
    size_t found = 0;
    NPG_TRY(get_matrix(text, path, matrices, k, 9));
    camera->fx = k[0];
    camera->fy = k[4];
    camera->cx = k[2];
    camera->cy = k[5];
    for (size_t i = 0; i < sizeof lenses / sizeof *lenses && !found; i++)
        NPG_TRY(npg_opencv_matrix(text, path, lenses[i], camera->distortion, NPG_DISTORTIONS, &found));
    if (found && found != 4 && found != 5 && found != 8)
        return npg_error(NPG_BAD_INPUT, "%s: %zu numbers of distortion; 4, 5 or 8 can be used", path, found);
    return npg_camera_check(camera, path);
}

/* Intrinsics and pose of one frame. */
static npg_status read_camera(npg_camera *camera, double pose[12], const char *path)
{
    static const char *const rotations[] = {"R", "rotation", NULL}, *const shifts[] = {"t", "T",
                                                                                       "translation", NULL};
    double r[9], t[3];
    char *text;
    NPG_TRY(npg_opencv_open(&text, path));
    npg_status status = camera_of(camera, text, path);
    if (!status) status = get_matrix(text, path, rotations, r, 9);
    if (!status) status = get_matrix(text, path, shifts, t, 3);
    npg_release(&text);
    NPG_TRY(status);
    for (size_t row = 0; row < 3; row++) {
        memcpy(pose + 4 * row, r + 3 * row, 3 * sizeof *r);
        pose[4 * row + 3] = t[row];
    }
    return npg_pose_check(pose, path);
}

static npg_status add_opencv(const npg_rig *rig, npg_rig_sensor *sensor, const char *depth)
{
    static const char *const cameras[] = {"_camera.xml", "_camera.yml", "_camera.yaml", NULL},
                             *const masks[] = {"_mask.png", "_mask.jpg", NULL},
                             *const colours[] = {"_color.png", "_color.jpg", ".png", ".jpg", NULL};
    npg_rig_shot shot = {.depth = (char *)depth, .number = npg_name_number(depth, 0), .has_pose = true};
    npg_camera camera = {.width = sensor->camera.width, .height = sensor->camera.height};
    char *file;
    if (shot.number < 0) shot.number = (int64_t)sensor->shot_count;
    NPG_TRY(beside(&file, depth, cameras));
    npg_status status = file ? NPG_OK
                             : npg_error(NPG_BAD_INPUT,
                                         "%s: there is no *_camera.xml or .yml beside it: "
                                         "intrinsics missing",
                                         depth);
    if (!status && rig->settings.confine) status = npg_path_confine(file, rig->folder);
    if (!status && !camera.width) status = npg_image_size(&camera.width, &camera.height, depth);
    if (!status) status = read_camera(&camera, shot.pose, file);
    if (!status && sensor->camera.width && memcmp(&camera, &sensor->camera, sizeof camera) != 0)
        status = npg_error(NPG_BAD_INPUT, "%s: other intrinsics than in the frames before it", file);
    sensor->camera = camera;
    if (!status) status = beside(&shot.mask, depth, masks);
    if (!status) status = beside(&shot.colour, depth, colours);
    if (!status) status = npg_rig_add_shot(sensor, &shot);
    npg_release(&file);
    npg_release(&shot.mask);
    npg_release(&shot.colour);
    return status;
}

npg_status npg_rig_load_opencv(npg_rig *rig)
{
    static const char *const endings[] = {"_depth.png", NULL};
    npg_rig_sensor *sensor;
    names depth = {0};
    NPG_TRY(npg_rig_add_sensor(rig, &sensor, "opencv"));
    npg_status status = list_names(&depth, rig->folder, endings);
    for (size_t i = 0; i < depth.count && !status; i++) {
        if (rig->settings.confine) status = npg_path_confine(depth.paths[i], rig->folder);
        if (!status) status = add_opencv(rig, sensor, depth.paths[i]);
    }
    if (!status && !depth.count)
        status = npg_error(NPG_BAD_INPUT, "%s: camera files, but no *_depth.png beside them", rig->folder);
    clear_names(&depth);
    return status;
}
