/* More of a run that is done: formats that it was not asked for, made of the meshes that lie there.
 *
 * Files appear whole under names that done.json does not list yet, and done.json is exchanged last: killed in between,
 * what was there is as it was.  Formats that lie there as they were written are left alone. */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "export/exporters/exporters_internal.h"
#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "pipeline/json_file.h"
#include "pipeline/struct_size.h"

typedef struct more {
    const char *output;
    json_t *done; /* owned, as all that follows */
    npg_mesh *reference, *like;
    npg_export_choice choice, all; /* what is made now; what then lies there */
    npg_export_facts facts;
    npg_arena arena;
} more;

npg_status npg_export_open_done(json_t **done, const char *job, const char *verb)
{
    *done = NULL;
    if (!npg_folder_has_run(job))
        return npg_error(NPG_USAGE, "%s is not the output folder of neupig run", job);
    if (!npg_is_in_folder(job, "done.json") || !npg_is_in_folder(job, "frames.jsonl"))
        return npg_error(NPG_BAD_INPUT, "%s: the run is not finished (%s needs its %s); run it again first",
                         job, verb, npg_is_in_folder(job, "done.json") ? "frames.jsonl" : "done.json");
    return npg_json_load(done, job, "done.json", NPG_BAD_INPUT);
}

/* ---- what is to be made ---- */

static bool is_called(const json_t *entry, const char *name)
{
    const char *form = json_string_value(json_object_get(entry, "form"));
    return form && !strcmp(form, name);
}

/* One of its files, or the mesh that several formats share. */
static bool is_of(const json_t *entry, const npg_exporter *exporter)
{
    return is_called(entry, exporter->name) ||
           (exporter->with_reference && is_called(entry, NPG_EXPORT_REFERENCE));
}

/* All its files are there, as they were written. */
static bool lies_there(const more *m, const npg_exporter *exporter)
{
    const json_t *entry;
    size_t i, count = 0;
    json_array_foreach(json_object_get(m->done, "files"), i, entry)
    {
        if (!is_of(entry, exporter)) continue;
        if (npg_file_check(entry, m->output, json_string_value(json_object_get(entry, "path")))) return false;
        count += is_called(entry, exporter->name);
    }
    return count > 0;
}

static npg_status choose(more *m, const char *list)
{
    const char *sequence = json_string_value(json_object_get(m->done, "format"));
    const json_t *name;
    size_t i, size = strlen(list) + 1;
    int count = 0;
    if (!list[0]) list = sequence ? sequence : "";
    json_array_foreach(json_object_get(m->done, "forms"), i, name) size += json_string_length(name) + 1;
    char *all = npg_arena_take(&m->arena, size + 4, 1);
    NPG_TRY(npg_arena_status(&m->arena));
    NPG_TRY(npg_exporters_choose(&m->choice, list, sequence));
    strcpy(all, list);
    json_array_foreach(json_object_get(m->done, "forms"), i, name)
        strcat(strcat(all, ","), json_string_value(name));
    NPG_TRY(npg_exporters_choose(&m->all, all, sequence));
    for (i = 0; m->choice.chosen[i]; i++)
        if (!lies_there(m, m->choice.chosen[i])) m->choice.chosen[count++] = m->choice.chosen[i];
    m->choice.chosen[count] = NULL;
    return NPG_OK;
}

/* ---- what writers may know, as the run knew it ---- */

/* Texture coordinates of corners, and the lines of an OBJ: of the user's own mesh, which must be that of then. */
static npg_status open_like(more *m)
{
    const char *path = npg_done_option(m->done, "reference"), *format = path[0] ? npg_reader_for(path) : NULL;
    npg_export_facts *f = &m->facts;
    npg_placement map;
    npg_origin origin = {.known = true};
    size_t faces = f->face_count;
    if (!format || strcmp(format, "obj") != 0) return NPG_OK;
    NPG_TRY(npg_placement_parse(&map, npg_done_option(m->done, "axes")));
    NPG_TRY(
        npg_error_prefix(npg_read_mesh(&m->like, path, &origin), "the run's own reference mesh is needed"));
    uint32_t *placed = npg_arena_take(&m->arena, m->like->face_count, 3 * sizeof *placed);
    float *corners =
        m->like->corner_uvs ? npg_arena_take(&m->arena, m->like->face_count, 6 * sizeof *corners) : NULL;
    NPG_TRY(npg_arena_status(&m->arena));
    npg_place_faces(&map, placed, m->like->faces, m->like->face_count);
    if (m->like->face_count != faces || memcmp(placed, f->faces, faces * 3 * sizeof *placed) != 0)
        return npg_error(NPG_BAD_INPUT, "%s is not the mesh that %s/reference.ply was made of", path,
                         m->output);
    if (corners) npg_place_corners(&map, corners, m->like->corner_uvs, faces);
    f->corner_uvs = corners;
    f->like = path;
    f->turns_faces = map.is_mirror;
    return NPG_OK;
}

static npg_status note_number(void *user, const json_t *frame, const char *line, size_t size)
{
    more *m = user;
    const char *name = strcmp(npg_done_option(m->done, "numbering"), "index") != 0 ? "number" : "index";
    int width = npg_number_width(json_integer_value(json_object_get(frame, name)));
    (void)line, (void)size;
    if (width > m->facts.width) m->facts.width = width;
    return NPG_OK;
}

static double box_of(const more *m, const char *name)
{
    return (double)(float)json_number_value(npg_json_at(m->done, name)); /* it was a float */
}

static npg_status open_facts(more *m)
{
    npg_origin zero = {.known = true}; /* floats as they are */
    char path[NPG_PATH_SIZE];
    const char *up = json_string_value(json_object_get(m->done, "up"));
    NPG_TRY(npg_path_of(path, m->output, "reference.ply"));
    NPG_TRY(npg_read_mesh(&m->reference, path, &zero));
    const npg_mesh *reference = m->reference;
    m->facts = (npg_export_facts){
        .output = m->output,
        .prefix = npg_done_option(m->done, "prefix"),
        .vert_count = reference->vert_count,
        .face_count = reference->face_count,
        .faces = reference->faces,
        .rest = reference->vert_pos,
        .colours = reference->vert_colours,
        .uvs = reference->vert_uvs,
        .has_normals = !strcmp(npg_done_option(m->done, "mesh-normals"), "yes"),
        .has_pose_colours = reference->vert_colours && !strcmp(npg_done_option(m->done, "colour"), "frames"),
        .fps = json_number_value(json_object_get(m->done, "fps")),
        .metres_per_unit = json_number_value(json_object_get(m->done, "metres_per_unit")),
        .is_z_up = up && !strcmp(up, "z"),
        .largest = box_of(m, "box.largest"),
        .diagonal = box_of(m, "box.diagonal"),
        .longest = box_of(m, "box.longest"),
        .voxel_share = strtod(npg_done_option(m->done, "vdb-voxel"), NULL)};
    if (!(m->facts.longest > 0) || !(m->facts.fps > 0) || !m->facts.prefix[0])
        return npg_error(NPG_BAD_INPUT, "%s/done.json does not say how large the capture is; run it again",
                         m->output);
    NPG_TRY(npg_json_lines(m->output, "frames.jsonl", -1, note_number, m));
    return open_like(m);
}

/* ---- the lists ---- */

/* The job first: frames that are appended later make all formats anew. */
static npg_status note_in_job(const more *m, const char *list)
{
    json_t *job;
    NPG_TRY(npg_json_load(&job, m->output, "job/job.json", NPG_BAD_INPUT));
    json_t *options = json_object_get(job, "options");
    char folder[NPG_PATH_SIZE];
    npg_status status = npg_path_of(folder, m->output, "job");
    if (options) json_object_set_new(options, "export", json_string(list));
    if (!status && options) status = npg_json_write(folder, "job.json", job);
    json_decref(job);
    return status;
}

static npg_status write_done(more *m, const json_t *before, size_t *made)
{
    json_t *files = json_array();
    json_t *entry;
    size_t i;
    json_array_foreach((json_t *)before, i, entry)
    {
        int k = 0;
        while (m->choice.chosen[k] && !is_of(entry, m->choice.chosen[k])) k++;
        if (!m->choice.chosen[k]) json_array_append(files, entry);
    }
    size_t kept = json_array_size(files);
    npg_status status = npg_done_add_exports(files, m->output);
    *made = json_array_size(files) - kept;
    char *list = npg_exporters_list(&m->all);
    if (!status && !list) status = npg_error(NPG_MEMORY, "no memory for the list of formats");
    if (!status) status = note_in_job(m, list);
    json_object_set_new(m->done, "forms", npg_exporters_json(&m->all));
    json_object_set_new(json_object_get(m->done, "options"), "export", json_string(list ? list : ""));
    if (!status) status = npg_done_write(m->output, m->done, files);
    if (!status) status = npg_file_remove(m->output, NPG_EXPORT_LIST_NAME);
    free(list);
    json_decref(files);
    return status;
}

static npg_status export_more(more *m, npg_exported *made, const char *list)
{
    npg_export_watch watch = {0};
    NPG_TRY(npg_export_open_done(&m->done, m->output, "export"));
    NPG_TRY(choose(m, list));
    if (!m->choice.chosen[0]) return NPG_OK;
    NPG_TRY(open_facts(m));
    NPG_TRY(npg_exporters_write(&m->choice, &m->facts, &watch));
    json_t *before = json_incref(json_object_get(m->done, "files"));
    json_object_del(m->done, "files");
    npg_status status = write_done(m, before, &made->files);
    json_decref(before);
    made->repeated = (size_t)watch.repeated;
    return status;
}

npg_status npg_export_locked(npg_exported *made, const char *output, const char *list)
{
    more m = {.output = output, .arena = {.purpose = NPG_FOR_FILES}};
    npg_status status = export_more(&m, made, list);
    json_decref(m.done);
    npg_mesh_unref(&m.reference);
    npg_mesh_unref(&m.like);
    npg_arena_release(&m.arena);
    return status;
}

npg_status npg_export(npg_exported *exported, const char *output, const char *list)
{
    npg_exported made = {.struct_size = sizeof made};
    npg_export_choice choice;
    char folder[NPG_PATH_SIZE];
    json_t *done;
    int lock_fd;
    NPG_REQUIRE(exported && output && list);
    NPG_TRY(npg_exporters_choose(&choice, list, NULL));
    NPG_TRY(npg_export_open_done(&done, output, "export"));
    json_decref(done);
    NPG_TRY(npg_path_of(folder, output, "job"));
    NPG_TRY(npg_file_lock(&lock_fd, folder, "lock", false));
    npg_status status = npg_export_locked(&made, output, list);
    close(lock_fd);
    npg_status given =
        npg_struct_give(exported, &made, sizeof made, NPG_SIZE_UP_TO(npg_exported, repeated), "exported");
    return status ? status : given;
}
