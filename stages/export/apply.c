/* Apply: another mesh, or points, carried through all frames of a finished run. */
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "export/exporters/exporters_internal.h"
#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "pipeline/file.h"
#include "pipeline/json_file.h"
#include "pipeline/struct_size.h"

typedef struct moment { /* a solved frame */
    bool is_there;
    int64_t index, number;
    float *vert_pos; /* V x 3 */
} moment;

typedef struct applying {
    const npg_apply_settings *s; /* prefix and steps are known */
    npg_arena arena;
    npg_origin origin;
    npg_mesh *reference, *carried;
    npg_attachment *attachment;
    moment window[4];   /* in time; [1] and [2] are the two frames that are being written between */
    float *between;     /* reference's V x 3                                                      */
    double *pos;        /* carried's V x 3                                                        */
    float *pos_float;   /* the same, where normals are made from it                               */
    float *pos_world;   /* and where it is written, for formats that hold floats                  */
    float *normals;     /* carried's V x 3, or NULL                                               */
    bool turns_normals; /* they are the file's own                                                */
    bool is_like;       /* OBJ from OBJ: the file's lines are kept                                */
    npg_mesh_names names;
    json_t *files; /* of OUT/done.json, which appears last; owned */
    npg_applied *applied;
    size_t frame_count;
    int64_t number_max;
    int64_t first_index, last_index;
    json_t *done; /* of the job, owned */
    npg_export_choice choice;
    npg_export_facts facts;
    npg_exporters_pass pass;
} applying;

/* ---- the job ---- */

static npg_status count_line(void *user, const json_t *frame, const char *line, size_t size)
{
    applying *a = user;
    int64_t number = json_integer_value(json_object_get(frame, "number"));
    int64_t index = json_integer_value(json_object_get(frame, "index"));
    const char *file = json_string_value(json_object_get(frame, "file"));
    (void)line, (void)size;
    if (!file) return NPG_OK;
    if (npg_path_stays(file) && !npg_is_in_folder(a->s->job, file))
        return npg_error(NPG_BAD_INPUT, "%s/%s is missing; apply needs the meshes of all frames", a->s->job,
                         file);
    if (a->frame_count && index <= a->last_index)
        return npg_error(NPG_BAD_INPUT, "%s/frames.jsonl: frame %lld is not after the one before it",
                         a->s->job, (long long)index);
    if (!a->frame_count++) a->first_index = index;
    a->last_index = index;
    if (number > a->number_max) a->number_max = number;
    return NPG_OK;
}

static npg_status open_job(applying *a)
{
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_export_open_done(&a->done, a->s->job, "apply"));
    NPG_TRY(npg_json_lines(a->s->job, "frames.jsonl", -1, count_line, a));
    if (!a->frame_count) return npg_error(NPG_BAD_INPUT, "%s/frames.jsonl names no mesh", a->s->job);
    NPG_TRY(npg_path_of(path, a->s->job, "reference.ply"));
    return npg_read_mesh(&a->reference, path, &a->origin);
}

/* Check that a mesh is the reference moved, and copy its positions. */
static npg_status copy_positions(const applying *a, float *vert_pos, const npg_mesh *mesh, const char *path)
{
    const npg_mesh *reference = a->reference;
    NPG_TRY(npg_mesh_require_finite(mesh, path));
    if (mesh->vert_count != reference->vert_count || mesh->face_count != reference->face_count)
        return npg_error(NPG_BAD_INPUT, "%s has %zu vertices and %zu faces, %s/reference.ply %zu and %zu",
                         path, mesh->vert_count, mesh->face_count, a->s->job, reference->vert_count,
                         reference->face_count);
    if (memcmp(mesh->faces, reference->faces, reference->face_count * 3 * sizeof *reference->faces) != 0)
        return npg_error(NPG_BAD_INPUT, "%s: its faces are not those of %s/reference.ply", path, a->s->job);
    memcpy(vert_pos, mesh->vert_pos, 3 * mesh->vert_count * sizeof *vert_pos);
    return NPG_OK;
}

static npg_status read_moment(const applying *a, moment *m, const char *file)
{
    char path[NPG_PATH_SIZE];
    npg_origin origin = a->origin;
    npg_mesh *mesh;
    if (!npg_path_stays(file))
        return npg_error(NPG_BAD_INPUT, "%s/frames.jsonl names %s, which is not in the job", a->s->job, file);
    NPG_TRY(npg_path_of(path, a->s->job, file));
    NPG_TRY(npg_read_mesh(&mesh, path, &origin));
    npg_status status = copy_positions(a, m->vert_pos, mesh, path);
    npg_mesh_unref(&mesh);
    return status;
}

/* ---- the mesh that is carried ---- */

static npg_status attach_carried(applying *a)
{
    const npg_mesh *mesh = a->carried;
    npg_applied *found = a->applied;
    double diagonal = npg_points_diagonal(a->reference->vert_pos, a->reference->vert_count);
    NPG_TRY(npg_error_prefix(
        npg_attach_open(&a->attachment, a->reference, mesh->vert_pos, a->normals, mesh->vert_count), "%s",
        a->s->mesh));
    npg_attach_far(a->attachment, a->s->far_share * diagonal, &found->far_count, &found->worst,
                   &found->worst_dist);
    found->point_count = mesh->vert_count;
    found->worst_share = found->worst_dist / diagonal;
    return NPG_OK;
}

/* Normals say which side of a thin part a point belongs to: those of the file, else those of its faces. */
static npg_status open_carried(applying *a)
{
    NPG_TRY(npg_read_shape(&a->carried, a->s->mesh, &a->origin));
    const npg_mesh *mesh = a->carried;
    size_t v = mesh->vert_count;
    NPG_TRY(npg_mesh_require_finite(mesh, a->s->mesh));
    a->turns_normals = mesh->vert_normals != NULL;
    a->pos = npg_arena_take(&a->arena, v, 3 * sizeof *a->pos);
    a->pos_world = npg_arena_take(&a->arena, v, 3 * sizeof *a->pos_world);
    a->between = npg_arena_take(&a->arena, a->reference->vert_count, 3 * sizeof *a->between);
    for (int i = 0; i < 4; i++)
        a->window[i].vert_pos = npg_arena_take(&a->arena, a->reference->vert_count, 3 * sizeof(float));
    if (a->turns_normals || mesh->face_count)
        a->normals = npg_arena_take(&a->arena, v, 3 * sizeof *a->normals);
    if (!a->turns_normals && mesh->face_count)
        a->pos_float = npg_arena_take(&a->arena, v, 3 * sizeof *a->pos_float);
    NPG_TRY(npg_arena_status(&a->arena));
    if (a->turns_normals)
        memcpy(a->normals, mesh->vert_normals, v * 3 * sizeof *a->normals);
    else if (mesh->face_count)
        npg_mesh_vertex_normals(a->normals, mesh->vert_pos, v, mesh->faces, mesh->face_count);
    return attach_carried(a);
}

/* ---- the output folder ---- */

static bool is_own_name(const applying *a, const char *name)
{
    size_t length = strlen(a->names.prefix);
    if (strncmp(name, a->names.prefix, length) != 0 || name[length] != '_') return false;
    const char *digits = name + length + 1;
    size_t count = strspn(digits, "0123456789");
    return count && (!strcmp(digits + count, ".ply") || !strcmp(digits + count, ".obj"));
}

/* Remove the mesh files of this prefix, or without overwrite refuse the first. */
static npg_status clear_file(void *user, const char *name)
{
    const applying *a = user;
    bool is_own = is_own_name(a, name);
    if (!is_own && (a->s->overwrite || !npg_exporters_own(name))) return NPG_OK;
    if (a->s->overwrite) return npg_file_remove(a->s->output, name);
    return npg_error(NPG_USAGE,
                     "%s/%s lies there already and would mix with the new files: "
                     "choose another folder, or --overwrite removes what is there",
                     a->s->output, name);
}

static void choose_names(applying *a)
{
    const char *read_as = npg_reader_for(a->s->mesh);
    bool is_obj = a->choice.is_obj;
    a->is_like = is_obj && read_as && !strcmp(read_as, "obj");
    a->facts.like = read_as && !strcmp(read_as, "obj") ? a->s->mesh : NULL;
    int64_t steps = (a->last_index - a->first_index) * a->s->fps_scale;
    a->names = (npg_mesh_names){.prefix = a->s->prefix,
                                .ending = is_obj ? "obj" : "ply",
                                .width = npg_number_width(a->s->fps_scale > 1 ? steps : a->number_max)};
}

static npg_status open_output(applying *a)
{
    const char *output = a->s->output;
    choose_names(a);
    NPG_TRY(npg_folder_probe(output));
    if (npg_is_in_folder(output, "frames.jsonl") || npg_is_in_folder(output, "job"))
        return npg_error(NPG_USAGE, "%s holds a run; choose another output folder", output);
    if (!a->s->overwrite) NPG_TRY(npg_folder_each(output, NPG_DISK, clear_file, a));
    NPG_TRY(npg_file_remove(output, "done.json")); /* first: what is left can't pass for whole */
    if (!a->s->overwrite) return NPG_OK;
    NPG_TRY(npg_exporters_clear(output));
    return npg_folder_each(output, NPG_DISK, clear_file, a);
}

/* ---- other formats ---- */

static npg_status choose(applying *a)
{
    const char *dot = strrchr(a->s->mesh, '.'), *own = dot && !strcasecmp(dot, ".obj") ? "obj" : "ply";
    return npg_exporters_choose(&a->choice, a->s->forms && a->s->forms[0] ? a->s->forms : own, NULL);
}

/* What they may know; the box is that of the mesh where it lies on the reference. */
static npg_status begin_formats(applying *a)
{
    const npg_mesh *mesh = a->carried;
    npg_export_facts *f = &a->facts;
    npg_bounds bounds = npg_bounds_of(mesh->vert_pos, mesh->vert_count);
    bool is_finer = a->s->fps_scale > 1;
    if (!a->choice.chosen[0]) return NPG_OK;
    float *rest = npg_arena_copy(&a->arena, mesh->vert_pos, mesh->vert_count, 3 * sizeof *rest);
    NPG_TRY(npg_arena_status(&a->arena));
    for (size_t i = 0; i < 3 * mesh->vert_count; i++)
        rest[i] = (float)((double)rest[i] + a->origin.world[i % 3]);
    f->output = a->s->output;
    f->prefix = a->s->prefix;
    f->width = a->names.width;
    f->vert_count = mesh->vert_count;
    f->face_count = mesh->face_count;
    f->faces = mesh->faces;
    f->rest = rest;
    f->colours = mesh->vert_colours;
    f->uvs = mesh->vert_uvs;
    f->corner_uvs = mesh->corner_uvs;
    f->has_normals = a->turns_normals;
    f->first_index = is_finer ? 0 : a->first_index;
    f->last_index = is_finer ? (a->last_index - a->first_index) * a->s->fps_scale : a->last_index;
    f->pose_count = is_finer ? f->last_index + 1 : (int64_t)a->frame_count;
    f->fps = json_number_value(json_object_get(a->done, "fps")) * (double)a->s->fps_scale;
    f->metres_per_unit = json_number_value(json_object_get(a->done, "metres_per_unit"));
    f->is_z_up = !strcmp(npg_done_option(a->done, "up"), "z");
    f->voxel_share = strtod(npg_done_option(a->done, "vdb-voxel"), NULL);
    f->diagonal = npg_bounds_diagonal(&bounds);
    for (int k = 0; k < 3; k++) {
        f->longest = fmax(f->longest, bounds.hi[k] - bounds.lo[k]);
        f->largest = fmax(f->largest, fmax(fabs(bounds.lo[k] + a->origin.world[k]),
                                           fabs(bounds.hi[k] + a->origin.world[k])));
    }
    return npg_exporters_begin(&a->pass);
}

/* ---- writing ---- */

/* The mesh in its place, into the sequence. */
static npg_status write_mesh(applying *a, int64_t number)
{
    char name[NPG_MESH_NAME_SIZE], path[NPG_PATH_SIZE];
    const npg_mesh *mesh = a->carried;
    npg_mesh_view view = {.vert_count = mesh->vert_count,
                          .face_count = mesh->face_count,
                          .vert_world = a->pos,
                          .vert_normals = a->normals,
                          .faces = mesh->faces,
                          .vert_colours = mesh->vert_colours,
                          .vert_uvs = mesh->vert_uvs};
    npg_mesh_name(name, &a->names, number);
    NPG_TRY(npg_path_of(path, a->s->output, name));
    NPG_TRY(a->is_like ? npg_write_obj_like(path, a->s->mesh, &view) : npg_write_mesh(path, &view));
    return npg_done_add(a->files, a->s->output, name);
}

/* The carried mesh as it is when the reference's vertices are at vert_pos. */
static npg_status write_pose(applying *a, const float *vert_pos, int64_t index, int64_t number)
{
    const npg_mesh *mesh = a->carried;
    if (a->choice.chosen[0]) NPG_TRY(npg_exporters_repeat(&a->pass, index));
    NPG_TRY(npg_attach_move(a->attachment, vert_pos, a->pos, a->turns_normals ? a->normals : NULL));
    if (!a->turns_normals && a->normals) {
        for (size_t i = 0; i < 3 * mesh->vert_count; i++) a->pos_float[i] = (float)a->pos[i];
        npg_mesh_vertex_normals(a->normals, a->pos_float, mesh->vert_count, mesh->faces, mesh->face_count);
    }
    for (size_t i = 0; i < 3 * mesh->vert_count; i++) {
        a->pos[i] += a->origin.world[i % 3];
        a->pos_world[i] = (float)a->pos[i];
    }
    a->applied->frames++;
    if (a->choice.has_sequence) NPG_TRY(write_mesh(a, number));
    if (!a->choice.chosen[0]) return NPG_OK;
    const npg_pose pose = {.index = index,
                           .number = number,
                           .pos = a->pos_world,
                           .normals = a->turns_normals ? a->normals : NULL};
    return npg_exporters_pose(&a->pass, &pose);
}

/* ---- time ---- */

/* Change per index at window[k], from its neighbours in time; one-sided at the ends of the run. */
static double slope(const moment *window, int k, size_t i)
{
    const moment *before = &window[window[k - 1].is_there ? k - 1 : k];
    const moment *after = &window[window[k + 1].is_there ? k + 1 : k];
    return ((double)after->vert_pos[i] - (double)before->vert_pos[i]) /
           (double)(after->index - before->index);
}

/* The reference at share 0..1 of the way from window[1] to window[2]: the cubic that has the two
 * positions and the slopes there (Catmull-Rom; the slopes count missing frames, so that a gap does
 * not bend the curve). */
static void make_curve(applying *a, double share)
{
    const moment *w = a->window;
    double gap = (double)(w[2].index - w[1].index), u = share, u2 = u * u, u3 = u2 * u;
    for (size_t i = 0; i < 3 * a->reference->vert_count; i++) {
        double p = (double)w[1].vert_pos[i], q = (double)w[2].vert_pos[i];
        a->between[i] = (float)((2 * u3 - 3 * u2 + 1) * p + (3 * u2 - 2 * u3) * q +
                                (u3 - 2 * u2 + u) * gap * slope(w, 1, i) + (u3 - u2) * gap * slope(w, 2, i));
    }
}

/* window[1], and the steps from it to window[2]. */
static npg_status write_step(applying *a)
{
    const moment *from = &a->window[1], *to = &a->window[2];
    int64_t scale = a->s->fps_scale, first = (from->index - a->first_index) * scale;
    if (!from->is_there) return NPG_OK;
    NPG_TRY(write_pose(a, from->vert_pos, scale > 1 ? first : from->index, scale > 1 ? first : from->number));
    if (!to->is_there || scale == 1) return NPG_OK;
    int64_t steps = (to->index - from->index) * scale;
    for (int64_t k = 1; k < steps; k++) {
        make_curve(a, (double)k / (double)steps);
        NPG_TRY(write_pose(a, a->between, first + k, first + k));
    }
    return NPG_OK;
}

static void shift_window(applying *a)
{
    float *vert_pos = a->window[0].vert_pos;
    memmove(a->window, a->window + 1, 3 * sizeof *a->window);
    a->window[3] = (moment){.vert_pos = vert_pos};
}

static npg_status visit_frame(void *user, const json_t *frame, const char *line, size_t size)
{
    applying *a = user;
    const char *file = json_string_value(json_object_get(frame, "file"));
    (void)line, (void)size;
    if (!file) return NPG_OK;
    shift_window(a);
    a->window[3].index = json_integer_value(json_object_get(frame, "index"));
    a->window[3].number = json_integer_value(json_object_get(frame, "number"));
    NPG_TRY(read_moment(a, &a->window[3], file));
    a->window[3].is_there = true;
    return write_step(a);
}

static npg_status write_done(applying *a)
{
    for (int i = 0; i < 2; i++) {
        shift_window(a);
        NPG_TRY(write_step(a));
    }
    if (a->choice.chosen[0]) {
        NPG_TRY(npg_exporters_finish(&a->pass));
        NPG_TRY(npg_done_add_exports(a->files, a->s->output));
    }
    json_t *facts =
        json_pack("{ss sI sI sI sf si so so}", "neupig", npg_version(), "frames", (json_int_t)a->frame_count,
                  "fps_scale", (json_int_t)a->s->fps_scale, "points_far", (json_int_t)a->applied->far_count,
                  "fps", json_number_value(json_object_get(a->done, "fps")) * (double)a->s->fps_scale,
                  "exit_code", npg_status_exit_code(a->applied->far_count ? NPG_PARTIAL : NPG_OK), "job",
                  npg_json_text(a->s->job), "mesh", npg_json_text(a->s->mesh));
    npg_status status = npg_done_write(a->s->output, facts, a->files);
    json_decref(facts);
    return status ? status : npg_file_remove(a->s->output, NPG_EXPORT_LIST_NAME);
}

static npg_status apply(applying *a)
{
    if (!a->s->mesh[0]) return npg_error(NPG_USAGE, "what is to be carried? say it with --mesh FILE");
    if (!a->s->output[0]) return npg_error(NPG_USAGE, "no output folder; say where with -o OUT");
    if (!a->s->prefix[0] || strchr(a->s->prefix, '/') || strlen(a->s->prefix) > 100)
        return npg_error(NPG_USAGE, "option prefix: \"%s\" can't begin a file's name", a->s->prefix);
    NPG_TRY(choose(a));
    NPG_TRY(open_job(a));
    NPG_TRY(open_carried(a));
    NPG_TRY(open_output(a));
    NPG_TRY(begin_formats(a));
    NPG_TRY(npg_json_lines(a->s->job, "frames.jsonl", -1, visit_frame, a));
    return write_done(a);
}

npg_status npg_apply(npg_applied *applied, const npg_apply_settings *settings)
{
    npg_apply_settings own;
    npg_applied found = {.struct_size = sizeof found};
    NPG_TRY(npg_struct_take(&own, sizeof own, settings, NPG_SIZE_UP_TO(npg_apply_settings, overwrite),
                            "the settings"));
    NPG_REQUIRE(applied && own.job && own.mesh && own.output);
    if (!own.prefix) own.prefix = "frame";
    if (own.fps_scale < 1) own.fps_scale = 1;
    applying a = {.s = &own, .applied = &found, .files = json_array(), .arena = {.purpose = NPG_FOR_MESH}};
    a.pass = (npg_exporters_pass){.choice = &a.choice, .facts = &a.facts};
    npg_status status = apply(&a);
    npg_exporters_end(&a.pass);
    json_decref(a.done);
    json_decref(a.files);
    npg_attach_close(&a.attachment);
    npg_mesh_unref(&a.reference);
    npg_mesh_unref(&a.carried);
    npg_arena_release(&a.arena);
    npg_status given =
        npg_struct_give(applied, &found, sizeof found, NPG_SIZE_UP_TO(npg_applied, worst_share), "applied");
    return status ? status : given;
}
