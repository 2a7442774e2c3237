/* Layouts of others: TUM RGB-D, Redwood (Open3D), and OpenCV files per frame. */
#include <stdio.h>
#include <string.h>

#include "ingest/rig/rig_internal.h"
#include "pipeline/file.h"

/* ---- images with times ---- */

/* A path as a list names it: from the list's folder. */
static npg_status path_in_list(npg_rig *rig, char **path, const char *list, const char *name)
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
    npg_arena scratch;
    npg_stamped_list depth, colour, poses;
} timed;

static npg_status read_timed(timed *t, npg_rig *rig, const char *const files[3])
{
    npg_stamped_list *const lists[] = {&t->depth, &t->colour, &t->poses};
    for (size_t i = 0; i < 3; i++) {
        char *path;
        if (!files[i]) continue;
        NPG_TRY(npg_rig_path(rig, &path, files[i], true));
        NPG_TRY(i < 2 ? npg_read_image_list(lists[i], &t->scratch, path)
                      : npg_read_trajectory(lists[i], &t->scratch, path));
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
        NPG_TRY(path_in_list(rig, &shot.depth, files[0], t->depth.items[i].path));
        if (colour) NPG_TRY(path_in_list(rig, &shot.colour, files[1], colour->path));
        NPG_TRY(npg_rig_add_shot(rig, sensor, &shot));
    }
    if (sensor->shot_count) return NPG_OK;
    return npg_error(NPG_BAD_INPUT,
                     "%s: none of the %zu depth images of %s has a pose within %g s: images out of step",
                     rig->path, t->depth.count, files[0], tolerance);
}

npg_status npg_rig_load_timed(npg_rig *rig, npg_rig_sensor *sensor, const char *depth, const char *colour,
                              const char *poses)
{
    timed t = {.scratch.purpose = NPG_FOR_FILES};
    const char *const files[] = {depth, colour, poses};
    rig->is_timed = true;
    npg_status status = read_timed(&t, rig, files);
    if (!status) status = add_timed(rig, sensor, &t, files);
    npg_arena_release(&t.scratch);
    return status;
}

/* ---- TUM RGB-D ---- */

/* An intrinsic.json of Open3D's kind lies in the folder; false where there is none. */
static npg_status find_intrinsic(npg_rig *rig, npg_camera *camera, bool *found)
{
    static const char *const usual[] = {"intrinsic.json", "camera_intrinsic.json"};
    *found = false;
    for (size_t i = 0; i < 2 && !*found; i++) {
        char *path;
        NPG_TRY(npg_rig_path(rig, &path, usual[i], false));
        *found = npg_is_there(path);
        if (*found) NPG_TRY(npg_rig_read_intrinsic(camera, path));
    }
    return NPG_OK;
}

npg_status npg_rig_load_tum(npg_rig *rig)
{
    npg_rig_sensor *sensor;
    char *colours, *poses;
    bool has_camera;
    NPG_TRY(npg_rig_add_sensor(rig, &sensor, "tum"));
    sensor->scale = 1.0 / 5000; /* of the data set's format description */
    NPG_TRY(find_intrinsic(rig, &sensor->camera, &has_camera));
    /* The default calibration that the data set's own tools use; its folders hold none. */
    if (!has_camera)
        sensor->camera =
            (npg_camera){.width = 640, .height = 480, .fx = 525, .fy = 525, .cx = 319.5, .cy = 239.5};
    NPG_TRY(npg_rig_path(rig, &colours, "rgb.txt", false));
    NPG_TRY(npg_rig_path(rig, &poses, "groundtruth.txt", false));
    return npg_rig_load_timed(rig, sensor, "depth.txt", npg_is_there(colours) ? "rgb.txt" : NULL,
                              npg_is_there(poses) ? "groundtruth.txt" : NULL);
}

/* ---- Redwood, Open3D ---- */

/* Images of a folder, in natural order. */
static npg_status list_images(npg_rig *rig, npg_paths *out, const char *folder, const char *const *endings)
{
    *out = (npg_paths){.arena = &rig->arena};
    NPG_TRY(npg_paths_list(out, folder, endings));
    if (out->count <= NPG_RIG_SHOTS_MAX) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s: more than %d images", folder, NPG_RIG_SHOTS_MAX);
}

/* Poses in the order of the images, one each. */
static npg_status read_log(npg_rig *rig, npg_stamped_list *poses, npg_arena *scratch, size_t image_count)
{
    char *path;
    NPG_TRY(npg_rig_path(rig, &path, "trajectory.log", false));
    if (npg_is_there(path)) NPG_TRY(npg_read_trajectory(poses, scratch, path));
    if (!poses->count || poses->count == image_count) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s: %zu poses, but %zu depth images: images out of step", path,
                     poses->count, image_count);
}

static npg_status add_redwood(npg_rig *rig, npg_rig_sensor *sensor, const npg_paths *depth,
                              const npg_paths *colour)
{
    npg_arena scratch = {.purpose = NPG_FOR_FILES};
    npg_stamped_list poses = {0};
    if (colour->count && colour->count != depth->count)
        return npg_error(NPG_BAD_INPUT, "%s: %zu depth and %zu colour images: images out of step", rig->path,
                         depth->count, colour->count);
    npg_status status = read_log(rig, &poses, &scratch, depth->count);
    for (size_t i = 0; i < depth->count && !status; i++) {
        npg_rig_shot shot = {.number = (int64_t)i,
                             .depth = depth->paths[i],
                             .colour = colour->count ? colour->paths[i] : NULL,
                             .has_pose = poses.count > 0};
        if (poses.count) memcpy(shot.pose, poses.items[i].pose, sizeof shot.pose);
        status = npg_rig_add_shot(rig, sensor, &shot);
    }
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_rig_load_redwood(npg_rig *rig)
{
    static const char *const png[] = {".png", NULL}, *const any[] = {".png", ".jpg", ".jpeg", NULL};
    static const char *const colour_folders[] = {"color", "colour", "rgb", "image"};
    npg_rig_sensor *sensor;
    char *folder;
    npg_paths depth, colour = {0};
    bool has_camera;
    NPG_TRY(npg_rig_add_sensor(rig, &sensor, "redwood"));
    NPG_TRY(find_intrinsic(rig, &sensor->camera, &has_camera));
    NPG_TRY(npg_rig_path(rig, &folder, "depth", true));
    NPG_TRY(list_images(rig, &depth, folder, png));
    for (size_t i = 0; i < sizeof colour_folders / sizeof *colour_folders && !colour.count; i++) {
        NPG_TRY(npg_rig_path(rig, &folder, colour_folders[i], false));
        if (npg_is_there(folder)) NPG_TRY(list_images(rig, &colour, folder, any));
    }
    return add_redwood(rig, sensor, &depth, &colour);
}

/* ---- OpenCV files per frame: NNNN_depth.png, NNNN.jpg, NNNN_mask.jpg, NNNN_camera.xml ---- */

/* "<stem><ending>" beside a depth image, for the first ending that is there; NULL for none. */
static npg_status beside(npg_rig *rig, char **path, const char *depth, const char *const *endings)
{
    size_t stem = strlen(depth) - strlen("_depth.png");
    for (; *endings; endings++) {
        *path = npg_arena_take(&rig->arena, stem + strlen(*endings) + 1, 1);
        NPG_TRY(npg_arena_status(&rig->arena));
        memcpy(*path, depth, stem);
        strcpy(*path + stem, *endings);
        if (npg_is_there(*path)) return NPG_OK;
    }
    *path = NULL;
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
static npg_status read_camera(npg_arena *scratch, npg_camera *camera, double pose[12], const char *path)
{
    static const char *const rotations[] = {"R", "rotation", NULL}, *const shifts[] = {"t", "T",
                                                                                       "translation", NULL};
    double r[9], t[3];
    char *text;
    NPG_TRY(npg_opencv_open(scratch, &text, path));
    NPG_TRY(camera_of(camera, text, path));
    NPG_TRY(get_matrix(text, path, rotations, r, 9));
    NPG_TRY(get_matrix(text, path, shifts, t, 3));
    for (size_t row = 0; row < 3; row++) {
        memcpy(pose + 4 * row, r + 3 * row, 3 * sizeof *r);
        pose[4 * row + 3] = t[row];
    }
    return npg_pose_check(pose, path);
}

static npg_status add_opencv(npg_rig *rig, npg_rig_sensor *sensor, char *depth)
{
    static const char *const cameras[] = {"_camera.xml", "_camera.yml", "_camera.yaml", NULL},
                             *const masks[] = {"_mask.png", "_mask.jpg", NULL},
                             *const colours[] = {"_color.png", "_color.jpg", ".png", ".jpg", NULL};
    npg_rig_shot shot = {.depth = depth, .number = npg_name_number(depth, 0), .has_pose = true};
    npg_camera camera = {.width = sensor->camera.width, .height = sensor->camera.height};
    npg_arena scratch = {.purpose = NPG_FOR_FILES};
    char *file;
    if (shot.number < 0) shot.number = (int64_t)sensor->shot_count;
    NPG_TRY(beside(rig, &file, depth, cameras));
    if (!file)
        return npg_error(NPG_BAD_INPUT,
                         "%s: there is no *_camera.xml or .yml beside it: "
                         "intrinsics missing",
                         depth);
    if (rig->settings.confine) NPG_TRY(npg_path_confine(file, rig->folder));
    if (!camera.width) NPG_TRY(npg_image_size(&camera.width, &camera.height, depth));
    npg_status status = read_camera(&scratch, &camera, shot.pose, file);
    npg_arena_release(&scratch);
    NPG_TRY(status);
    if (sensor->camera.width && memcmp(&camera, &sensor->camera, sizeof camera) != 0)
        return npg_error(NPG_BAD_INPUT, "%s: other intrinsics than in the frames before it", file);
    sensor->camera = camera;
    NPG_TRY(beside(rig, &shot.mask, depth, masks));
    NPG_TRY(beside(rig, &shot.colour, depth, colours));
    return npg_rig_add_shot(rig, sensor, &shot);
}

npg_status npg_rig_load_opencv(npg_rig *rig)
{
    static const char *const endings[] = {"_depth.png", NULL};
    npg_rig_sensor *sensor;
    npg_paths depth;
    NPG_TRY(npg_rig_add_sensor(rig, &sensor, "opencv"));
    NPG_TRY(list_images(rig, &depth, rig->folder, endings));
    for (size_t i = 0; i < depth.count; i++) {
        if (rig->settings.confine) NPG_TRY(npg_path_confine(depth.paths[i], rig->folder));
        NPG_TRY(add_opencv(rig, sensor, depth.paths[i]));
    }
    if (depth.count) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s: camera files, but no *_depth.png beside them", rig->folder);
}
