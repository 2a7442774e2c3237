/* Exporters: the pass over a run's meshes in the order of time that writes all of them at once. */
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "export/exporters/exporters_internal.h"
#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "pipeline/json_file.h"

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
    if (!c->is_output) return npg_mesh_name_read(name, ".ply .obj .vdb ", &number);
    for (int i = 0; npg_exporters[i]; i++)
        if (npg_exporters[i]->file && !strcmp(npg_exporters[i]->file, name)) return true;
    sscanf(name, "motion_%*[0-9].glb%n", &end);
    if (!end) sscanf(name, "motion_meshopt_%*[0-9].glb%n", &end);
    return (end && !name[end]) || !strncmp(name, "motion.usda.", 12) ||
           !strncmp(name, "motion.meshopt.", 15) || !strncmp(name, "motion_vat", 10) ||
           !strcmp(name, "motion_meshopt.glb") || !strcmp(name, "motion.glb") ||
           !strcmp(name, "reference.obj") || !strcmp(name, NPG_EXPORT_LIST_NAME);
}

bool npg_exporters_own(const char *name)
{
    int i = 0;
    while (npg_exporters[i] && (!npg_exporters[i]->folder || strcmp(npg_exporters[i]->folder, name) != 0))
        i++;
    return npg_exporters[i] || is_ours(&(clearing){.is_output = true}, name);
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
    npg_status status = npg_folder_each(output, NPG_DISK, remove_ours, &(clearing){output, true});
    for (int i = 0; npg_exporters[i] && !status; i++) {
        char folder[NPG_PATH_SIZE];
        if (!npg_exporters[i]->folder) continue;
        NPG_TRY(npg_path_of(folder, output, npg_exporters[i]->folder));
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

/* To a writer that has a file for each. */
static npg_status write_own_file(npg_exporters_pass *p, int i, npg_pose *pose)
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

static npg_status pass_pose(npg_exporters_pass *p, npg_pose pose, bool fixed_rate_only)
{
    for (int i = 0; p->choice->chosen[i]; i++)
        if (!fixed_rate_only || p->choice->chosen[i]->has_fixed_rate)
            NPG_TRY(p->choice->chosen[i]->folder ? write_own_file(p, i, &pose)
                                                 : p->choice->chosen[i]->pose(p->states[i], &pose));
    return NPG_OK;
}

npg_status npg_exporters_repeat(npg_exporters_pass *p, int64_t index)
{
    int i = 0;
    while (p->choice->chosen[i] && !p->choice->chosen[i]->has_fixed_rate) i++;
    while (p->choice->chosen[i] && p->last.pos && p->last.index + 1 < index) {
        p->last.number = ++p->last.index;
        NPG_TRY(pass_pose(p, p->last, true));
        p->repeated++;
    }
    return NPG_OK;
}

npg_status npg_exporters_pose(npg_exporters_pass *p, const npg_pose *pose)
{
    p->last = *pose;
    return pass_pose(p, *pose, false);
}

/* ---- the pass ---- */

npg_status npg_exporters_begin(npg_exporters_pass *p)
{
    NPG_TRY(npg_exporters_check(p->choice, p->facts));
    NPG_TRY(npg_file_open_in(&p->facts->list, p->facts->output, NPG_EXPORT_LIST_NAME));
    for (int i = 0; p->choice->chosen[i]; i++) {
        const npg_exporter *exporter = p->choice->chosen[i];
        NPG_TRY(npg_alloc(&p->states[i], NPG_FOR_FILES, exporter->state_size));
        npg_writer *writer = p->states[i];
        writer->facts = p->facts;
        if (exporter->file) NPG_TRY(npg_file_open_in(&writer->file, p->facts->output, exporter->file));
        if (exporter->folder) NPG_TRY(npg_export_folder(p->facts->output, exporter->folder));
        if (exporter->open) NPG_TRY(exporter->open(writer));
    }
    return NPG_OK;
}

/* The mesh whose vertices a point cache moves. */
static npg_status write_reference(const npg_export_facts *facts)
{
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, facts->output, "reference.obj"));
    NPG_TRY(npg_write_pose(path, facts, facts->rest, NULL, NULL));
    return npg_export_made(facts, NPG_EXPORT_REFERENCE, "reference.obj", facts->first_index, 1);
}

/* The file that holds all poses is whole. */
static npg_status end_file(const npg_exporters_pass *p, const npg_exporter *exporter, npg_writer *writer)
{
    const npg_export_facts *facts = p->facts;
    int64_t frames = facts->last_index - facts->first_index + 1;
    NPG_TRY(npg_file_commit(&writer->file));
    return npg_export_made(facts, exporter->name, exporter->file, facts->first_index,
                           exporter->has_fixed_rate ? frames : facts->pose_count);
}

npg_status npg_exporters_finish(npg_exporters_pass *p)
{
    bool with_reference = false;
    for (int i = 0; p->choice->chosen[i]; i++) {
        if (p->choice->chosen[i]->finish) NPG_TRY(p->choice->chosen[i]->finish(p->states[i]));
        if (p->choice->chosen[i]->file) NPG_TRY(end_file(p, p->choice->chosen[i], p->states[i]));
        with_reference = with_reference || p->choice->chosen[i]->with_reference;
    }
    if (with_reference) NPG_TRY(write_reference(p->facts));
    return npg_file_commit(&p->facts->list);
}

void npg_exporters_end(npg_exporters_pass *p)
{
    for (int i = 0; p->choice->chosen[i]; i++) {
        if (p->states[i] && p->choice->chosen[i]->close) p->choice->chosen[i]->close(p->states[i]);
        if (p->states[i]) npg_file_discard(&((npg_writer *)p->states[i])->file);
        npg_release(&p->states[i]);
    }
    npg_file_discard(&p->facts->list);
}

/* ---- of the meshes of a run ---- */

typedef struct run_pass {
    npg_exporters_pass pass;
    const npg_export_watch *watch;
    npg_mesh *mesh; /* of the pose before, owned */
} run_pass;

static npg_status count_line(void *user, const json_t *frame, const char *line, size_t size)
{
    npg_export_facts *facts = user;
    (void)line, (void)size;
    if (!json_is_string(json_object_get(frame, "file"))) return NPG_OK;
    facts->last_index = json_integer_value(json_object_get(frame, "index"));
    if (!facts->pose_count++) facts->first_index = facts->last_index;
    return NPG_OK;
}

/* The floats of the file as they are: no origin is taken off. */
static npg_status read_pose(run_pass *p, const char *file)
{
    const npg_export_facts *facts = p->pass.facts;
    npg_origin zero = {.known = true};
    char path[NPG_PATH_SIZE];
    if (!npg_path_stays(file))
        return npg_error(NPG_BAD_INPUT, "%s/frames.jsonl names %s, which is not in it", facts->output, file);
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

static npg_status write_line_poses(void *user, const json_t *frame, const char *line, size_t size)
{
    run_pass *p = user;
    const char *file = json_string_value(json_object_get(frame, "file"));
    npg_pose pose = {.index = json_integer_value(json_object_get(frame, "index")),
                     .number = json_integer_value(json_object_get(frame, "number"))};
    (void)line, (void)size;
    if (p->watch->should_stop && p->watch->should_stop(p->watch->user)) return NPG_STOPPED;
    if (!file) return NPG_OK;
    NPG_TRY(npg_exporters_repeat(&p->pass, pose.index));
    NPG_TRY(read_pose(p, file));
    pose.pos = p->mesh->vert_pos;
    pose.normals = p->mesh->vert_normals;
    if (p->pass.facts->has_pose_colours) pose.colours = p->mesh->vert_colours;
    return npg_exporters_pose(&p->pass, &pose);
}

npg_status npg_exporters_write(const npg_export_choice *choice, npg_export_facts *facts,
                               npg_export_watch *watch)
{
    run_pass p = {.pass = {.choice = choice, .facts = facts}, .watch = watch};
    facts->pose_count = 0;
    npg_status status = npg_json_lines(facts->output, "frames.jsonl", -1, count_line, facts);
    if (!status && !facts->pose_count)
        status = npg_error(NPG_BAD_INPUT, "%s/frames.jsonl names no mesh", facts->output);
    if (!status) status = npg_exporters_begin(&p.pass);
    if (!status) status = npg_json_lines(facts->output, "frames.jsonl", -1, write_line_poses, &p);
    if (!status) status = npg_exporters_finish(&p.pass);
    npg_exporters_end(&p.pass);
    npg_mesh_unref(&p.mesh);
    watch->repeated = p.pass.repeated;
    return status;
}
