/* Export: writes every frame's mesh with the same faces, in the capture's own units and axes, and what the
 * run reports about it. */
#include <string.h>

#include "export/export.h"
#include "export/exporters/exporters_internal.h"
#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "job/job.h"
#include "pipeline/json_file.h"
#include "pipeline/options.h"

typedef enum numbering { NUMBER_OF_FILE, NUMBER_OF_INDEX } numbering;

typedef struct export_state {
    /* options */
    int numbering, up, unit;
    const char *axes, *exports;
    double scale;
    bool overwrite, is_centred;
    npg_export_facts facts; /* prefix, fps, voxel_share and has_normals are options */
    /* of a pass */
    npg_placement map;
    npg_mesh_names names;
    npg_export_choice choice;
    int64_t *numbers; /* of all frames, while measuring: they grow, as ingest sees to; owned */
    size_t number_count, number_capacity;
    npg_frame_log *list;
    npg_arena arena;     /* of what follows */
    uint32_t *faces;     /* F x 3 as they are written */
    double *vert_world;  /* V x 3 */
    float *vert_normals; /* V x 3 */
    int64_t mesh_count, skipped_count;
} export_state;

static const char *output_of(const npg_worker *worker)
{
    return npg_worker_settings(worker)->output;
}

/* ---- options ---- */

static npg_status check_prefix(const char *prefix)
{
    json_t *text = json_string(prefix);
    bool is_good = text && prefix[0] && prefix[0] != '.' && !strchr(prefix, '/') && strlen(prefix) <= 100;
    for (const char *c = prefix; *c; c++) is_good = is_good && (unsigned char)*c >= 32 && *c != 127;
    json_decref(text);
    if (!is_good)
        return npg_error(NPG_USAGE,
                         "option prefix: \"%s\" can't begin a file name (1 to 100 bytes, no slash)", prefix);
    return NPG_OK;
}

static npg_status read_options(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    const char *reference = npg_worker_settings(worker)->reference, *format = NULL;
    NPG_TRY(npg_placement_parse(&state->map, state->axes));
    state->map.scale = state->scale;
    NPG_TRY(check_prefix(state->facts.prefix));
    NPG_TRY(npg_exporters_choose(&state->choice, state->exports, NULL));
    if (reference[0]) format = npg_reader_for(reference);
    /* the user's own reference where it is OBJ: its lines are kept in OBJ files */
    state->facts.like = format && !strcmp(format, "obj") ? reference : NULL;
    state->names = (npg_mesh_names){state->facts.prefix, state->choice.is_obj ? "obj" : "ply", 4};
    return NPG_OK;
}

/* Once the box is known. */
static void set_centre(export_state *state, const npg_frame_box *box)
{
    for (int a = 0; a < 3 && state->is_centred && box->scale > 0; a++)
        state->map.centre[a] = box->origin[a] + box->centre[a];
}

static int64_t number_of(const export_state *state, const npg_frame *frame)
{
    return state->numbering == NUMBER_OF_INDEX ? frame->index : frame->number;
}

static void set_width(export_state *state, const npg_facts *facts)
{
    int64_t last = state->numbering == NUMBER_OF_INDEX ? facts->frame_count - 1 : facts->number_max;
    state->names.width = npg_number_width(last);
}

/* ---- measuring pass: would the names be in an earlier run's way? ---- */

/* The results must not land among the frames they are made of. */
static npg_status check_source(const npg_worker *worker, const npg_frame *frame)
{
    char *folder, meshes[NPG_PATH_SIZE];
    const char *output = output_of(worker), *slash = frame->path ? strrchr(frame->path, '/') : NULL;
    if (!slash || slash == frame->path) return NPG_OK;
    NPG_TRY(npg_copy_text(&folder, frame->path));
    folder[slash - frame->path] = 0;
    npg_status status = npg_path_of(meshes, output, "meshes");
    if (!status && npg_is_same_file(folder, meshes))
        status = npg_error(NPG_USAGE,
                           "%s is an input, and this run's meshes would be written over it: "
                           "choose another output folder than %s",
                           frame->path, output);
    npg_release(&folder);
    return status;
}

/* The user's own mesh must not be one of the files that a run makes anew. */
static npg_status check_reference(const npg_worker *worker)
{
    static const char *const names[] = {"reference.ply", "reference.obj"};
    const char *reference = npg_worker_settings(worker)->reference;
    for (size_t i = 0; reference[0] && i < sizeof names / sizeof *names; i++) {
        char path[NPG_PATH_SIZE];
        NPG_TRY(npg_path_of(path, output_of(worker), names[i]));
        if (npg_is_same_file(path, reference))
            return npg_error(NPG_USAGE,
                             "option reference: %s lies where this run writes: "
                             "copy it, or choose another output folder",
                             reference);
    }
    return NPG_OK;
}

static npg_status note_number(npg_worker *worker, const npg_frame *frame)
{
    export_state *state = npg_worker_state(worker);
    NPG_TRY(check_source(worker, frame));
    NPG_TRY(npg_grow(&state->numbers, &state->number_capacity, state->number_count + 1,
                     sizeof *state->numbers, NPG_FOR_FILES));
    state->numbers[state->number_count++] = number_of(state, frame);
    return NPG_OK;
}

static npg_status check_numbers(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    set_width(state, npg_worker_facts(worker));
    if (!state->number_count || state->overwrite || npg_worker_facts(worker)->is_live) return NPG_OK;
    return npg_folder_check(output_of(worker), &state->names, state->numbers, state->number_count);
}

/* The numbers that a live source will bring are not known: whatever lies there would be in their way. */
static npg_status check_for_live(const npg_worker *worker)
{
    const export_state *state = npg_worker_state(worker);
    const npg_job *job = npg_job_of(worker);
    bool discards = state->overwrite || (job && npg_job_is_restart(job));
    if (!npg_worker_facts(worker)->is_live || discards) return NPG_OK;
    return npg_folder_check(output_of(worker), &state->names, NULL, 0);
}

/* ---- solving pass ---- */

static const double metres_per_unit[] = {1, 0.1, 0.01, 0.001, 1000, 0.0254, 0.3048};

/* What formats may know; before the reference is there, counts are those that the run will have at most. */
static npg_export_facts *export_facts(const npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_frame_box *box = &facts->box;
    npg_export_facts *f = &state->facts;
    f->output = output_of(worker);
    f->width = state->names.width;
    f->vert_count = facts->reference ? facts->reference->vert_count : npg_worker_verts_at_most(worker);
    f->face_count = facts->reference ? facts->reference->face_count : 2 * f->vert_count;
    f->turns_faces = state->map.is_mirror;
    f->pose_count = facts->frame_count;
    f->last_index = facts->frame_count > 0 ? facts->frame_count - 1 : 0;
    f->metres_per_unit = metres_per_unit[state->unit];
    f->is_z_up = state->up;
    if (!(box->scale > 0)) return f;
    /* as float they come back from done.json as they are: what is exported later has the same bytes */
    f->largest = (double)(float)npg_place_largest(&state->map, box);
    f->diagonal = (double)(float)(state->scale * box->diagonal);
    f->longest = (double)(float)(state->scale * 2 * NPG_UNIT_EXTENT / box->scale);
    return f;
}

/* About what the meshes and formats take: binary PLY, or OBJ text with its longer numbers.
 * 0 where it is not known. */
static uint64_t bytes_of_meshes(const npg_worker *worker)
{
    const export_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    bool is_obj = state->choice.is_obj;
    uint64_t verts = npg_worker_verts_at_most(worker), per_vert = is_obj ? 30 : 12;
    if (facts->frame_count < 0 || npg_worker_settings(worker)->reference[0]) return 0;
    if (state->facts.has_normals) per_vert *= 2;
    if (npg_worker_settings(worker)->colour != NPG_COLOUR_NO) per_vert += 4; /* if there are any */
    return (uint64_t)facts->frame_count * verts * (per_vert + 2 * (is_obj ? 20 : 13)) +
           npg_exporters_bytes(&state->choice, export_facts(worker));
}

/* What a format can't hold is refused before the fit starts; of a live source as soon as its box is known. */
static npg_status check_exporters(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    set_centre(state, &npg_worker_facts(worker)->box);
    return npg_exporters_check(&state->choice, export_facts(worker));
}

/* What an earlier run of the same job wrote stays. */
static npg_status open_folder(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    const char *output = output_of(worker);
    npg_job *job = npg_job_of(worker);
    int64_t count, bytes;
    NPG_TRY(check_exporters(worker));
    NPG_TRY(npg_folder_probe(output));
    NPG_TRY(npg_folder_has_room(output, bytes_of_meshes(worker)));
    if (npg_worker_facts(worker)->is_resumed) {
        npg_job_exported(job, &count, &bytes);
        NPG_TRY(npg_frame_log_resume(&state->list, output, bytes, &state->mesh_count, &state->skipped_count));
    } else {
        NPG_TRY(npg_folder_clear(output));
        NPG_TRY(npg_export_folder(output, "meshes"));
        NPG_TRY(npg_frame_log_open(&state->list, output));
    }
    return job ? npg_job_write(job, npg_exporters_has(&state->choice, "vdb")) : NPG_OK;
}

static npg_status write_mesh(npg_worker *worker, const char *file, const float *vert_unit,
                             const uint8_t *vert_colours, bool with_normals, const char *like)
{
    export_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_mesh *reference = facts->reference;
    char path[NPG_PATH_SIZE];
    npg_place_points(&state->map, state->vert_world, &facts->box, vert_unit, reference->vert_count);
    if (with_normals) {
        npg_mesh_vertex_normals(state->vert_normals, vert_unit, reference->vert_count, reference->faces,
                                reference->face_count);
        npg_place_normals(&state->map, state->vert_normals, state->vert_normals, reference->vert_count);
    }
    npg_mesh_view view = {.vert_count = reference->vert_count,
                          .face_count = reference->face_count,
                          .vert_world = state->vert_world,
                          .vert_normals = with_normals ? state->vert_normals : NULL,
                          .faces = state->faces,
                          .vert_colours = vert_colours ? vert_colours : reference->vert_colours,
                          .vert_uvs = reference->vert_uvs,
                          .turns_faces = state->map.is_mirror};
    NPG_TRY(npg_path_of(path, output_of(worker), file));
    return like ? npg_write_obj_like(path, like, &view) : npg_write_mesh(path, &view);
}

/* Once the reference mesh is known: buffers, the faces as all files have them, reference.ply. */
static npg_status begin_meshes(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_mesh *reference = facts->reference;
    size_t v = reference->vert_count, f = reference->face_count;
    set_width(state, facts);
    NPG_TRY(check_exporters(worker));
    state->arena.purpose = NPG_FOR_FILES;
    state->vert_world = npg_arena_take(&state->arena, v, 3 * sizeof *state->vert_world);
    state->vert_normals = npg_arena_take(&state->arena, v, 3 * sizeof *state->vert_normals);
    state->faces = npg_arena_take(&state->arena, f, 3 * sizeof *state->faces);
    NPG_TRY(npg_arena_status(&state->arena));
    npg_place_faces(&state->map, state->faces, reference->faces, f);
    return write_mesh(worker, "reference.ply", reference->vert_pos, NULL, true, NULL);
}

/* The vertices as this frame saw them (option colour = frames); where it did not, as the reference. */
static npg_status colour_frame(npg_worker *worker, npg_frame *frame)
{
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_mesh *reference = facts->reference;
    if (npg_worker_settings(worker)->colour != NPG_COLOUR_FRAMES || !frame->vert_unit) return NPG_OK;
    if (!reference->vert_colours || frame->vert_count != reference->vert_count) return NPG_OK;
    size_t v = frame->vert_count, n = frame->colours ? frame->point_count : 0;
    npg_arena scratch = {.purpose = NPG_FOR_FILES};
    float *normals = npg_arena_take(&scratch, v, 3 * sizeof *normals);
    float *points = npg_arena_take(&scratch, n, 3 * sizeof *points);
    npg_release(&frame->vert_colours);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_alloc_array(&frame->vert_colours, NPG_FOR_FRAMES, v, 4);
    if (!status && n) {
        npg_mesh_vertex_normals(normals, frame->vert_unit, v, reference->faces, reference->face_count);
        npg_box_local_to_unit(&facts->box, points, frame->pos_local, n);
        const npg_coloured cloud = {points, frame->normals, frame->colours, n};
        status = npg_colour_vertices(frame->vert_colours, frame->vert_unit, normals, v, &cloud, 0);
    }
    for (size_t i = 0; i < v && !status; i++) {
        if (frame->vert_colours[4 * i + 3]) continue;
        memcpy(frame->vert_colours + 4 * i, reference->vert_colours + 4 * i, 3);
        frame->vert_colours[4 * i + 3] = NPG_COLOUR_LENT;
    }
    npg_arena_release(&scratch);
    return status;
}

static npg_status list_frame(npg_worker *worker, const npg_frame *frame, const char *file)
{
    export_state *state = npg_worker_state(worker);
    npg_job *job = npg_job_of(worker);
    int64_t lines, bytes;
    NPG_TRY(npg_frame_log_add(state->list, frame, file, &lines, &bytes));
    if (job) npg_job_set_exported(job, lines, bytes);
    return NPG_OK;
}

static npg_status export_frame(npg_worker *worker, const npg_frame *frame)
{
    export_state *state = npg_worker_state(worker);
    const npg_mesh *reference = npg_worker_facts(worker)->reference;
    char file[NPG_MESH_NAME_SIZE + 8] = "meshes/";
    bool has_mesh = (frame->fields & NPG_FIELD_VERTICES) && frame->vert_unit && frame->vert_count;
    state->skipped_count += frame->is_skipped;
    if (!has_mesh) return list_frame(worker, frame, NULL);
    if (!reference || frame->vert_count != reference->vert_count)
        return npg_error(NPG_FAILED, "frame %lld has %zu vertices, the reference %zu",
                         (long long)frame->number, frame->vert_count, reference ? reference->vert_count : 0);
    if (!state->faces) NPG_TRY(begin_meshes(worker));
    npg_mesh_name(file + strlen(file), &state->names, number_of(state, frame));
    NPG_TRY(write_mesh(worker, file, frame->vert_unit, frame->vert_colours, state->facts.has_normals,
                       state->choice.is_obj ? state->facts.like : NULL));
    state->mesh_count++;
    return list_frame(worker, frame, file);
}

static void report_settings(json_t *object, const export_state *state)
{
    const double *c = state->map.centre;
    json_object_update_new(object,
                           json_pack("{ss sf ss sf ss sf so}", "format", state->names.ending, "scale",
                                     state->scale, "axes", state->axes, "fps", state->facts.fps, "up",
                                     state->up ? "z" : "y", "metres_per_unit", metres_per_unit[state->unit],
                                     "forms", npg_exporters_json(&state->choice)));
    if (state->is_centred) json_object_set_new(object, "centre", json_pack("[fff]", c[0], c[1], c[2]));
}

/* ---- the other formats ---- */

/* What of the reference is the same in all poses. */
static npg_status place_reference(npg_worker *worker, npg_export_facts *facts)
{
    export_state *state = npg_worker_state(worker);
    const npg_mesh *reference = npg_worker_facts(worker)->reference;
    size_t v = reference->vert_count, f = reference->face_count;
    float *rest = npg_arena_take(&state->arena, v, 3 * sizeof *rest);
    float *corners = reference->corner_uvs ? npg_arena_take(&state->arena, f, 6 * sizeof *corners) : NULL;
    NPG_TRY(npg_arena_status(&state->arena));
    npg_place_points(&state->map, state->vert_world, &npg_worker_facts(worker)->box, reference->vert_pos, v);
    for (size_t i = 0; i < 3 * v; i++) rest[i] = (float)state->vert_world[i];
    if (corners) npg_place_corners(&state->map, corners, reference->corner_uvs, f);
    facts->rest = rest;
    facts->corner_uvs = corners;
    facts->faces = state->faces;
    facts->colours = reference->vert_colours;
    facts->has_pose_colours =
        reference->vert_colours && npg_worker_settings(worker)->colour == NPG_COLOUR_FRAMES;
    facts->uvs = reference->vert_uvs;
    return NPG_OK;
}

/* From the meshes on disk, in the order of time (exporters_internal.h says why). */
static npg_status write_exports(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    npg_export_watch watch = {.should_stop = npg_worker_should_stop, .user = worker};
    if (!state->choice.chosen[0]) return NPG_OK;
    if (!state->faces) NPG_TRY(begin_meshes(worker));
    npg_export_facts *facts = export_facts(worker);
    npg_status status = place_reference(worker, facts);
    if (!status) status = npg_exporters_clear(facts->output);
    if (!status && facts->has_pose_colours && npg_exporters_has(&state->choice, "glb"))
        npg_worker_log(worker, NPG_LOG_INFO, -1,
                       "motion.glb has the reference's colours: morph targets of colours are an option of "
                       "glTF that few programs read");
    if (!status) status = npg_exporters_write(&state->choice, facts, &watch);
    if (!status && watch.repeated)
        npg_worker_warn(worker, false, -1,
                        "%lld frames without a mesh repeat the one before them in pc2 and mdd, "
                        "which have no times",
                        (long long)watch.repeated);
    return status;
}

static npg_status close_frames(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    json_t *report = npg_worker_report(worker);
    if (!state->mesh_count) return npg_error(NPG_FAILED, "no frame got a mesh");
    report_settings(report, state);
    json_object_update_new(report, json_pack("{sI sI}", "meshes", (json_int_t)state->mesh_count, "skipped",
                                             (json_int_t)state->skipped_count));
    NPG_TRY(npg_frame_log_finish(state->list, npg_worker_facts(worker),
                                 npg_worker_fact(worker, &npg_fact_late_faults)));
    return write_exports(worker);
}

/* ---- the last files ---- */

static npg_status conclude(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    json_t *whole = npg_worker_run_report(worker);
    const char *output = output_of(worker);
    if (!output[0]) return NPG_OK;
    NPG_TRY(read_options(worker));
    set_centre(state, &npg_worker_facts(worker)->box);
    char look[NPG_PATH_SIZE + 16];
    snprintf(look, sizeof look, "neupig view %s", output);
    json_t *head =
        json_pack("{sO* sO* so}", "verdict", npg_json_at(whole, "stages.evaluate.verdict"), "quality",
                  npg_json_at(whole, "stages.evaluate.quality"), "look", npg_json_text(look));
    json_t *report = json_copy(head); /* the same at the top of both */
    json_object_update(report, whole);
    npg_status status = npg_json_write(output, "report.json", report);
    json_decref(report);
    json_object_update_new(head, json_pack("{ss sO sO sI sO*}", "neupig", npg_version(), "status",
                                           json_object_get(whole, "status"), "exit_code",
                                           json_object_get(whole, "exit_code"), "frames",
                                           (json_int_t)npg_worker_facts(worker)->frame_count, "meshes",
                                           json_object_get(npg_worker_report(worker), "meshes")));
    report_settings(head, state);
    const npg_export_facts *facts = export_facts(worker);
    json_object_set_new(head, "box",
                        json_pack("{sf sf sf}", "diagonal", facts->diagonal, "longest", facts->longest,
                                  "largest", facts->largest));
    json_object_set_new(head, "options", npg_options_json(npg_worker_options(worker), NULL));
    if (!status) status = npg_done_end(output, head, state->choice.chosen[0]);
    json_decref(head);
    return status ? status : npg_job_end(npg_job_of(worker));
}

/* A run that was done before: what was not asked for then. */
static npg_status write_more(npg_worker *worker)
{
    const export_state *state = npg_worker_state(worker);
    npg_exported made = {.struct_size = sizeof made};
    NPG_TRY(read_options(worker));
    npg_status status = npg_export_locked(&made, output_of(worker), state->exports);
    if (!status && made.files)
        npg_worker_log(worker, NPG_LOG_INFO, -1, "%zu files more are exported", made.files);
    return status;
}

/* ---- the stage ---- */

static npg_status check_own(const npg_worker *worker)
{
    npg_status status = NPG_OK;
    for (int i = -1; (i < 0 || npg_exporters[i]) && !status; i++) {
        char folder[NPG_PATH_SIZE];
        if (i >= 0 && !npg_exporters[i]->folder) continue;
        NPG_TRY(npg_path_of(folder, output_of(worker), i < 0 ? "meshes" : npg_exporters[i]->folder));
        status = npg_folder_is_own(folder);
    }
    return status;
}

static npg_status init(npg_worker *worker)
{
    NPG_TRY(read_options(worker));
    if (!output_of(worker)[0]) return NPG_OK;
    NPG_TRY(check_reference(worker));
    if (npg_worker_settings(worker)->confine) NPG_TRY(check_own(worker));
    if (npg_worker_pass(worker) == NPG_PASS_MEASURE) {
        NPG_TRY(npg_folder_probe(output_of(worker)));
        NPG_TRY(check_for_live(worker));
    }
    return npg_worker_pass(worker) == NPG_PASS_SOLVE ? open_folder(worker) : NPG_OK;
}

static npg_status process(npg_worker *worker, npg_chunk **chunk)
{
    bool is_solving = npg_worker_pass(worker) == NPG_PASS_SOLVE;
    for (size_t i = 0; i < npg_chunk_count(*chunk); i++) {
        npg_frame *frame = npg_chunk_frame(*chunk, i);
        if (is_solving) NPG_TRY(colour_frame(worker, frame));
        if (!output_of(worker)[0]) continue;
        NPG_TRY(is_solving ? export_frame(worker, frame) : note_number(worker, frame));
    }
    return NPG_OK;
}

static npg_status flush(npg_worker *worker)
{
    if (!output_of(worker)[0]) return NPG_OK;
    return npg_worker_pass(worker) == NPG_PASS_SOLVE ? close_frames(worker) : check_numbers(worker);
}

static void uninit(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    npg_frame_log_close(&state->list);
    npg_release(&state->numbers);
    npg_arena_release(&state->arena);
}

/* A place per frame in the list; coordinates, normals and two faces per vertex; the buffers of two files. */
static size_t memory(const npg_worker *worker, size_t *chunks_held)
{
    int64_t frame_count = npg_worker_facts(worker)->frame_count;
    *chunks_held = 1;
    size_t verts = npg_worker_verts_at_most(worker);
    const export_state *state = npg_worker_state(worker);
    bool has_exports = state->exports[0];
    return 24 * (size_t)(frame_count > 0 ? frame_count : 0) + (60 + (has_exports ? 200 : 0)) * verts +
           (has_exports ? 4 << 20 : 512 << 10);
}

#define AT(member) offsetof(export_state, member)

/* clang-format off */
static const npg_option options[] = {
    /* type               name            place             default  least  most  shown as or words */
    NPG_ROW_TEXT(         "export",       AT(exports),      "",      "LIST",
        NPG_EXPORT_FORMS ": what to write. A sequence is always there: "
        "PLY, or OBJ where the list has obj without ply"),
    NPG_ROW_TEXT(         "prefix",       AT(facts.prefix),       "frame", "NAME",
        "First part of the mesh files' names"),
    NPG_ROW_CHOICE(       "numbering",    AT(numbering),    "file",  "file|index",
        "Number of a mesh file. As in the input's name, or the place in the sequence"),
    NPG_ROW_REAL(         "scale",        AT(scale),        "1",     1e-12, 1e12, NULL,
        "Multiply all written coordinates by this"),
    NPG_ROW_TEXT(         "axes",         AT(axes),         "xyz",   "AXES",
        "Which input axis becomes x, y and z, with signs. xz-y turns z up into y up"),
    NPG_ROW_REAL(         "fps",          AT(facts.fps),          "30",    1e-3,  1e6,  NULL,
        "Frames per second of the capture. For the report and formats that carry time"),
    NPG_ROW_CHOICE(       "up",           AT(up),           "y",     "y|z",
        "Axis that points up in the written coordinates. For exporters that record it"),
    NPG_ROW_CHOICE(       "unit",         AT(unit),         "m",     "m|dm|cm|mm|km|in|ft",
        "Unit of the written coordinates. For exporters that record it"),
    NPG_ROW_FLAG(         "centre",       AT(is_centred),   "no",
        "Write coordinates from the middle of the capture's box. done.json then names it: for captures far "
        "from 0"),
    NPG_PROGRAM_ROW(REAL, "vdb-voxel",    AT(facts.voxel_share),  "0.005", 1e-4,  0.25, "SHARE",
        "Voxel of the level sets, as a share of the longest side of the capture's box"),
    NPG_PROGRAM_ROW(FLAG, "mesh-normals", AT(facts.has_normals), "no",
        "Write vertex normals into every mesh"),
    NPG_ROW_FLAG(         "overwrite",    AT(overwrite),    "no",
        "Remove meshes that another run left in the output folder"),
    {0}};
/* clang-format on */

const npg_stage npg_stage_export = {.name = "export",
                                    .help = "Write meshes, report and checksums",
                                    .options = options,
                                    .state_size = sizeof(export_state),
                                    .passes = NPG_PASS_MEASURE | NPG_PASS_SOLVE,
                                    .needs = NPG_FIELD_KEY | NPG_FIELD_REFERENCE | NPG_FIELD_VERTICES,
                                    .init = init,
                                    .process = process,
                                    .flush = flush,
                                    .uninit = uninit,
                                    .memory = memory,
                                    .again = write_more,
                                    .conclude = conclude};
