/* Rig: what is one, its frames, and the pose of every shot. */
#include "ingest/rig/rig_internal.h"

#include <glob.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

#include "pipeline/file.h"
#include "pipeline/order.h"

/* ---- what is one ---- */

static bool ends_with(const char *name, const char *ending)
{
    size_t length = strlen(name), size = strlen(ending);
    return length >= size && !strcmp(name + length - size, ending);
}

/* A file NNNN_camera.xml, .yml or .yaml lies in the folder. */
static bool has_camera_files(const char *folder)
{
    char pattern[NPG_PATH_SIZE];
    glob_t found = {0};
    bool is_found = !npg_path_of(pattern, folder, "*_camera.[xy]*ml") && !glob(pattern, 0, NULL, &found);
    globfree(&found);
    return is_found;
}

/* Which other program has written the depth images of a folder; NULL: none that is known. */
static const char *foreign_layout(const char *folder)
{
    bool has_camera =
        npg_is_in_folder(folder, "intrinsic.json") || npg_is_in_folder(folder, "camera_intrinsic.json");
    return npg_is_in_folder(folder, "depth.txt")             ? "TUM RGB-D"
           : npg_is_in_folder(folder, "depth") && has_camera ? "Redwood and Open3D"
           : has_camera_files(folder)                        ? "OpenCV"
                                                             : NULL;
}

bool npg_rig_is(const char *path)
{
    if (!npg_is_folder(path)) return ends_with(path, ".json");
    return npg_is_in_folder(path, "rig.json") || foreign_layout(path);
}

const npg_rig_settings npg_rig_usual = {.step_share = 0.02, .margin = 1};

/* ---- its frames ---- */

static npg_status list_numbers(npg_rig *rig)
{
    size_t all = 0, count = 0;
    for (size_t s = 0; s < rig->sensor_count; s++) all += rig->sensors[s].shot_count;
    rig->numbers = npg_arena_take(&rig->arena, all + 1, sizeof *rig->numbers);
    NPG_TRY(npg_arena_status(&rig->arena));
    for (size_t s = 0; s < rig->sensor_count; s++)
        for (size_t i = 0; i < rig->sensors[s].shot_count; i++)
            rig->numbers[count++] = rig->sensors[s].shots[i].number;
    if (count) qsort(rig->numbers, count, sizeof *rig->numbers, npg_order_int64);
    for (size_t i = 0; i < count; i++)
        if (!rig->frame_count || rig->numbers[i] != rig->numbers[rig->frame_count - 1])
            rig->numbers[rig->frame_count++] = rig->numbers[i];
    return NPG_OK;
}

static npg_status join(npg_rig *rig)
{
    NPG_TRY(list_numbers(rig));
    if (!rig->frame_count) return npg_error(NPG_BAD_INPUT, "%s: there is no depth image", rig->path);
    rig->shot_of = npg_arena_take(&rig->arena, rig->frame_count * rig->sensor_count, sizeof *rig->shot_of);
    NPG_TRY(npg_arena_status(&rig->arena));
    for (size_t f = 0; f < rig->frame_count; f++)
        for (size_t s = 0; s < rig->sensor_count; s++) {
            /* they begin with their numbers, and are in that order */
            const npg_rig_sensor *of = &rig->sensors[s];
            const npg_rig_shot *shot = of->shot_count ? bsearch(&rig->numbers[f], of->shots, of->shot_count,
                                                                sizeof *shot, npg_order_int64)
                                                      : NULL;
            rig->shot_of[f * rig->sensor_count + s] = shot ? (int32_t)(shot - of->shots) : -1;
        }
    return NPG_OK;
}

/* ---- open and close ---- */

/* The folder that names start from: the path itself, or the one its file lies in. */
static char *find_folder(npg_rig *rig)
{
    char *folder = npg_arena_text(&rig->arena, rig->path), *slash = folder ? strrchr(folder, '/') : NULL;
    if (!folder || npg_is_folder(folder)) return folder;
    if (!slash) return npg_arena_text(&rig->arena, ".");
    slash[slash == folder] = 0;
    return folder;
}

static npg_status load(npg_rig *rig, const char *path)
{
    const char *foreign =
        npg_is_folder(path) && !npg_is_in_folder(path, "rig.json") ? foreign_layout(path) : NULL;
    if (foreign)
        return npg_error(NPG_BAD_INPUT,
                         "%s: depth images as %s has them, without a rig.json: rig_json.py writes one "
                         "(in tools/, installed in share/neupig/)",
                         path, foreign);
    if (!npg_rig_is(path)) return npg_error(NPG_BAD_INPUT, "%s: no rig.json", path);
    rig->path = npg_arena_text(&rig->arena, path);
    rig->folder = rig->path ? find_folder(rig) : NULL;
    NPG_TRY(npg_arena_status(&rig->arena));
    NPG_TRY(npg_rig_load_json(rig));
    return join(rig);
}

npg_status npg_rig_open(npg_rig **out, const char *path, const npg_rig_settings *settings)
{
    NPG_TRY(npg_object_open(out, NPG_FOR_FILES, sizeof **out));
    (*out)->settings = *settings;
    npg_status status = load(*out, path);
    if (status) npg_rig_close(out);
    return status;
}

void npg_rig_close(npg_rig **rig)
{
    for (size_t s = 0; *rig && s < (*rig)->sensor_count; s++) npg_release(&(*rig)->sensors[s].rays);
    npg_object_close(rig);
}

npg_status npg_rig_path(npg_rig *rig, char **path, const char *name, bool must_be)
{
    *path =
        name[0] == '/' ? npg_arena_text(&rig->arena, name) : npg_arena_path(&rig->arena, rig->folder, name);
    NPG_TRY(npg_arena_status(&rig->arena));
    bool is_there = npg_is_there(*path);
    if (must_be && !is_there) return npg_error_errno(NPG_BAD_INPUT, "can't read %s", *path);
    return rig->settings.confine && is_there ? npg_path_confine(*path, rig->folder) : NPG_OK;
}

/* ---- frames ---- */

size_t npg_rig_find(const npg_rig *rig, int64_t number)
{
    const int64_t *found =
        bsearch(&number, rig->numbers, rig->frame_count, sizeof *rig->numbers, npg_order_int64);
    return found ? (size_t)(found - rig->numbers) : SIZE_MAX;
}

const npg_rig_shot *npg_rig_shot_of(const npg_rig *rig, size_t frame, size_t sensor)
{
    int32_t at = rig->shot_of[frame * rig->sensor_count + sensor];
    return at < 0 ? NULL : &rig->sensors[sensor].shots[at];
}

/* ---- poses ---- */

void npg_rig_pose(const npg_rig *rig, double out[12], size_t s, const npg_rig_shot *shot)
{
    const npg_rig_sensor *sensor = &rig->sensors[s];
    double pose[12], other[12];
    memcpy(pose, shot && shot->has_pose ? shot->pose : sensor->pose, sizeof pose);
    if (rig->settings.poses == NPG_POSES_NONE) npg_pose_identity(pose);
    if (rig->settings.poses == NPG_POSES_INVERSE) {
        npg_pose_invert(other, pose);
        memcpy(pose, other, sizeof pose);
    }
    /* From OpenCV's axes to OpenGL's before the pose: y and z change sign. */
    if (sensor->is_opengl && rig->settings.poses != NPG_POSES_NONE)
        for (size_t r = 0; r < 3; r++) {
            pose[4 * r + 1] = -pose[4 * r + 1];
            pose[4 * r + 2] = -pose[4 * r + 2];
        }
    npg_pose_combine(out, sensor->correction, pose);
}

const char *const npg_up_words[] = {"y", "z", "-y", "-z", NULL};

npg_up npg_rig_up(const npg_rig *rig)
{
    double x = 0, y = 0, z = 0, across_y = 0, across_z = 0, pose[12];
    for (size_t s = 0; s < rig->sensor_count; s++) {
        npg_rig_pose(rig, pose, s, rig->sensors[s].shots);
        x -= pose[1]; /* images have y down */
        y -= pose[5];
        z -= pose[9];
        across_y += fabs(pose[4]);
        across_z += fabs(pose[8]);
    }
    /* They lie: across their images is up, or down, which they can't say. */
    if (fabs(x) > fmax(fabs(y), fabs(z))) return across_y >= across_z ? NPG_UP_Y : NPG_UP_Z;
    if (fabs(y) >= fabs(z)) return y < 0 ? NPG_UP_MINUS_Y : NPG_UP_Y;
    return z < 0 ? NPG_UP_MINUS_Z : NPG_UP_Z;
}

void npg_rig_correct(npg_rig *rig, const npg_rig_view *views)
{
    for (size_t s = 0; s < rig->sensor_count; s++) {
        double before[12];
        if (views[s].verdict != NPG_RIG_OFF) continue;
        memcpy(before, rig->sensors[s].correction, sizeof before);
        npg_pose_combine(rig->sensors[s].correction, views[s].correction, before);
    }
}

uint64_t npg_rig_frame_hash(const npg_rig *rig, size_t frame)
{
    const npg_rig_settings *set = &rig->settings;
    XXH64_hash_t hash = XXH3_64bits(&set->step_share, sizeof set->step_share);
    hash = XXH3_64bits_withSeed(&set->background, sizeof set->background, hash);
    for (size_t s = 0; s < rig->sensor_count; s++) {
        const npg_rig_sensor *sensor = &rig->sensors[s];
        const npg_rig_shot *shot = npg_rig_shot_of(rig, frame, s);
        if (!shot) continue;
        double pose[12];
        npg_rig_pose(rig, pose, s, shot);
        const double numbers[] = {
            (double)s,   sensor->scale, sensor->near_m,      sensor->far_m,
            set->near_m, set->far_m,    (double)set->margin, (double)sensor->has_colour_camera};
        hash = XXH3_64bits_withSeed(numbers, sizeof numbers, hash);
        hash = XXH3_64bits_withSeed(pose, sizeof pose, hash);
        hash = XXH3_64bits_withSeed(&sensor->camera, sizeof sensor->camera, hash);
        hash = XXH3_64bits_withSeed(&sensor->colour_camera, sizeof sensor->colour_camera, hash);
        hash = XXH3_64bits_withSeed(sensor->depth_to_colour, sizeof sensor->depth_to_colour, hash);
    }
    return hash;
}
