/* Exporters: the pass over a run's meshes in the order of time that writes all of them at once. */
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "export/exporters/exporters_internal.h"
#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "pipeline/json_file.h"

typedef struct exporters_pass {
    const npg_export_choice *choice;
    npg_export_facts *facts;
    npg_export_watch *watch;
    void *states[NPG_EXPORTERS_MAX]; /* of the chosen formats, owned; NULL: not open */
    npg_mesh *mesh;                  /* of the pose before, owned */
    int64_t index;                   /* its frame */
} exporters_pass;

/* ---- what earlier runs left ---- */

typedef struct clearing {
    const char *folder;
    bool is_output; /* the results' folder itself; else one of numbered files */
} clearing;

/* Also "motion_000.glb". */
static bool is_ours(const clearing *c, const char *name)
{
    int64_t number;
    int end = 0;
    if (!c->is_output) return npg_mesh_name_read(name, ".obj .vdb ", &number);
    for (int i = 0; npg_exporters[i]; i++)
        if (npg_exporters[i]->file && !strcmp(npg_exporters[i]->file, name)) return true;
    sscanf(name, "motion_%*[0-9].glb%n", &end);
    return (end && !name[end]) || !strcmp(name, "motion.glb") || !strcmp(name, "reference.obj") ||
           !strcmp(name, "exports.jsonl");
}

/* Also what a killed run left half-written (pipeline/file.h): ".<name>.part". */
static npg_status remove_ours(void *user, const char *entry)
{
    const clearing *c = user;
    char name[NAME_MAX + 1];
    size_t length = strlen(entry);
    bool is_part = entry[0] == '.' && length > 6 && !strcmp(entry + length - 5, ".part");
    snprintf(name, sizeof name, "%.*s", (int)(is_part ? length - 6 : length), entry + is_part);
    return is_ours(c, name) ? npg_file_remove(c->folder, entry) : NPG_OK;
}

npg_status npg_exporters_clear(const char *output)
{
    static const char *const folders[] = {"obj", "volumes"};
    npg_status status = npg_folder_each(output, NPG_DISK, remove_ours, &(clearing){output, true});
    for (size_t i = 0; i < sizeof folders / sizeof *folders && !status; i++) {
        char folder[NPG_PATH_SIZE];
        NPG_TRY(npg_path_of(folder, output, folders[i]));
        status = npg_folder_each(folder, NPG_DISK, remove_ours, &(clearing){folder, false});
        if (!status) rmdir(folder); /* stays where something else lies in it */
    }
    return status;
}

/* ---- the list of files ---- */

npg_status npg_export_made(const npg_export_facts *facts, const char *format, const char *file, int64_t first,
                           int64_t pose_count)
{
    json_t *entry = json_pack("{ss ss sI sI}", "form", format, "file", file, "first", (json_int_t)first,
                              "frames", (json_int_t)pose_count);
    npg_status status = npg_file_facts(entry, facts->output, file);
    if (!status) status = npg_json_print(facts->list, entry, JSON_COMPACT);
    json_decref(entry);
    return status ? status : npg_file_write(facts->list, "\n", 1);
}

/* ---- poses ---- */

static npg_status count_line(void *user, const json_t *frame, const char *line, size_t size)
{
    npg_export_facts *facts = user;
    (void)line, (void)size;
    if (!json_is_string(json_object_get(frame, "file"))) return NPG_OK;
    facts->last_index = json_integer_value(json_object_get(frame, "index"));
    if (!facts->pose_count++) facts->first_index = facts->last_index;
    return NPG_OK;
}

/* To a writer that has a file for each. */
static npg_status write_own_file(exporters_pass *p, int i, npg_pose *pose)
{
    const npg_export_facts *facts = p->facts;
    const npg_exporter *exporter = p->choice->chosen[i];
    const npg_mesh_names names = {facts->prefix, exporter->ending, facts->width};
    char name[NPG_MESH_NAME_SIZE], file[NPG_MESH_NAME_SIZE + 16], path[NPG_PATH_SIZE];
    npg_mesh_name(name, &names, pose->number);
    snprintf(file, sizeof file, "%s/%s", exporter->folder, name);
    NPG_TRY(npg_path_of(path, facts->output, file));
    pose->path = path;
    NPG_TRY(exporter->pose(p->states[i], pose));
    return npg_export_made(facts, exporter->name, file, pose->index, 1);
}

static npg_status pass_pose(exporters_pass *p, int64_t index, int64_t number, bool fixed_rate_only)
{
    npg_pose pose = {index,
                     number,
                     p->mesh->vert_pos,
                     p->mesh->vert_normals,
                     p->facts->has_pose_colours ? p->mesh->vert_colours : NULL,
                     NULL};
    for (int i = 0; p->choice->chosen[i]; i++)
        if (!fixed_rate_only || p->choice->chosen[i]->has_fixed_rate)
            NPG_TRY(p->choice->chosen[i]->folder ? write_own_file(p, i, &pose)
                                                 : p->choice->chosen[i]->pose(p->states[i], &pose));
    return NPG_OK;
}

/* The floats of the file as they are: no origin is taken off. */
static npg_status read_pose(exporters_pass *p, const char *file)
{
    const npg_export_facts *facts = p->facts;
    npg_origin zero = {.known = true};
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, facts->output, file));
    npg_mesh_unref(&p->mesh);
    npg_status status = npg_read_mesh(&p->mesh, path, &zero);
    if (!status && (p->mesh->vert_count != facts->vert_count || p->mesh->face_count != facts->face_count ||
                    (facts->has_normals && !p->mesh->vert_normals) ||
                    (facts->has_pose_colours && !p->mesh->vert_colours)))
        status = npg_error(NPG_BAD_INPUT, "%s was changed since it was written: %zu vertices and %zu faces",
                           path, p->mesh->vert_count, p->mesh->face_count);
    if (!status) status = npg_mesh_require_finite(p->mesh, path);
    return status;
}

static bool any_fixed_rate(const npg_export_choice *choice)
{
    int i = 0;
    while (choice->chosen[i] && !choice->chosen[i]->has_fixed_rate) i++;
    return choice->chosen[i];
}

static npg_status write_line_poses(void *user, const json_t *frame, const char *line, size_t size)
{
    exporters_pass *p = user;
    const char *file = json_string_value(json_object_get(frame, "file"));
    int64_t index = json_integer_value(json_object_get(frame, "index"));
    (void)line, (void)size;
    if (p->watch->should_stop && p->watch->should_stop(p->watch->user)) return NPG_STOPPED;
    if (!file) return NPG_OK;
    /* Frames without a mesh since the last one: formats of a fixed rate repeat the mesh before them. */
    for (int64_t i = p->index + 1; p->mesh && any_fixed_rate(p->choice) && i < index; i++) {
        NPG_TRY(pass_pose(p, i, i, true));
        p->watch->repeated++;
    }
    NPG_TRY(read_pose(p, file));
    p->index = index;
    return pass_pose(p, index, json_integer_value(json_object_get(frame, "number")), false);
}

/* ---- the pass ---- */

static npg_status open_writers(exporters_pass *p)
{
    for (int i = 0; p->choice->chosen[i]; i++) {
        NPG_TRY(npg_alloc(&p->states[i], NPG_FOR_FILES, p->choice->chosen[i]->state_size));
        npg_writer *writer = p->states[i];
        writer->facts = p->facts;
        if (p->choice->chosen[i]->file)
            NPG_TRY(npg_file_open_in(&writer->file, p->facts->output, p->choice->chosen[i]->file));
        if (p->choice->chosen[i]->folder)
            NPG_TRY(npg_export_folder(p->facts->output, p->choice->chosen[i]->folder));
        if (p->choice->chosen[i]->open) NPG_TRY(p->choice->chosen[i]->open(writer));
    }
    return NPG_OK;
}

/* The mesh whose vertices a point cache moves. */
static npg_status write_reference(const npg_export_facts *facts)
{
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, facts->output, "reference.obj"));
    npg_status status = NPG_OK;
    if (!npg_is_there(path)) { /* the other point cache may have made it in this pass */
        status = npg_write_obj_pose(path, facts, facts->rest, NULL, NULL);
        if (!status) status = npg_export_made(facts, "obj", "reference.obj", facts->first_index, 1);
    }
    return status;
}

/* The file that holds all poses is whole. */
static npg_status end_file(const exporters_pass *p, const npg_exporter *exporter, npg_writer *writer)
{
    const npg_export_facts *facts = p->facts;
    int64_t frames = facts->last_index - facts->first_index + 1;
    NPG_TRY(npg_file_commit(&writer->file));
    return npg_export_made(facts, exporter->name, exporter->file, facts->first_index,
                           exporter->has_fixed_rate ? frames : facts->pose_count);
}

static npg_status finish_writers(exporters_pass *p)
{
    for (int i = 0; p->choice->chosen[i]; i++) {
        if (p->choice->chosen[i]->finish) NPG_TRY(p->choice->chosen[i]->finish(p->states[i]));
        if (p->choice->chosen[i]->file) NPG_TRY(end_file(p, p->choice->chosen[i], p->states[i]));
        if (p->choice->chosen[i]->with_reference) NPG_TRY(write_reference(p->facts));
    }
    return npg_file_commit(&p->facts->list);
}

static void close_pass(exporters_pass *p)
{
    for (int i = 0; p->choice->chosen[i]; i++) {
        if (p->states[i] && p->choice->chosen[i]->close) p->choice->chosen[i]->close(p->states[i]);
        if (p->states[i]) npg_file_discard(&((npg_writer *)p->states[i])->file);
        npg_release(&p->states[i]);
    }
    npg_file_discard(&p->facts->list);
    npg_mesh_unref(&p->mesh);
}

static npg_status write_exports(exporters_pass *p)
{
    npg_export_facts *facts = p->facts;
    facts->pose_count = 0;
    p->watch->repeated = 0;
    NPG_TRY(npg_exporters_clear(facts->output));
    NPG_TRY(npg_json_lines(facts->output, "frames.jsonl", -1, count_line, facts));
    if (!facts->pose_count) return npg_error(NPG_BAD_INPUT, "%s/frames.jsonl names no mesh", facts->output);
    NPG_TRY(npg_exporters_check(p->choice, facts));
    NPG_TRY(npg_file_open_in(&facts->list, facts->output, "exports.jsonl"));
    NPG_TRY(open_writers(p));
    NPG_TRY(npg_json_lines(facts->output, "frames.jsonl", -1, write_line_poses, p));
    return finish_writers(p);
}

npg_status npg_exporters_write(const npg_export_choice *choice, npg_export_facts *facts,
                               npg_export_watch *watch)
{
    exporters_pass p = {.choice = choice, .facts = facts, .watch = watch};
    npg_status status = write_exports(&p);
    close_pass(&p);
    return status;
}
