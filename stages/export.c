/* Export: writes every frame's mesh with the same faces, in the capture's own units and axes, and what the
 * run has to say about it. */
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "export.h"
#include "file.h"
#include "job.h"
#include "mesh_tools.h"
#include "writer.h"

/* out[a] = sign[a] * in[from[a]] */
typedef struct axis_map {
    int from[3];
    double sign[3];
    bool is_mirror; /* turns a surface inside out, so faces are wound the other way */
} axis_map;

typedef enum numbering { NUMBER_OF_FILE, NUMBER_OF_INDEX } numbering;

typedef struct export_state {
    /* options */
    int format, numbering;
    const char *prefix, *axes;
    double scale, fps;
    bool overwrite, with_normals;
    /* of a pass */
    axis_map map;
    npg_mesh_names names;
    int64_t *numbers; /* of all frames, while measuring; owned */
    size_t number_count, number_capacity;
    npg_frame_log *list;
    uint32_t *faces;     /* F x 3 as they are written; owned */
    double *vert_world;  /* V x 3; owned */
    float *vert_normals; /* V x 3; owned */
    int64_t mesh_count, skipped_count;
} export_state;

static const char *output_of(const npg_worker *worker)
{
    return npg_worker_settings(worker)->output;
}

/* ---- options ---- */

static npg_status parse_axes(axis_map *map, const char *text)
{
    const char *c = text;
    bool is_used[3] = {false, false, false};
    for (int a = 0; a < 3; a++) {
        map->sign[a] = *c == '-' ? -1 : 1;
        if (*c == '-' || *c == '+') c++;
        if (*c < 'x' || *c > 'z' || is_used[*c - 'x'])
            return npg_error(
                NPG_USAGE, "option axes: \"%s\" does not name x, y and z once each, as xyz or xz-y do", text);
        map->from[a] = *c++ - 'x';
        is_used[map->from[a]] = true;
    }
    if (*c) return npg_error(NPG_USAGE, "option axes: \"%s\" goes on after the third axis", text);
    bool is_cyclic = map->from[1] == (map->from[0] + 1) % 3;
    map->is_mirror = is_cyclic != (map->sign[0] * map->sign[1] * map->sign[2] > 0);
    return NPG_OK;
}

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
    NPG_TRY(parse_axes(&state->map, state->axes));
    NPG_TRY(check_prefix(state->prefix));
    state->names = (npg_mesh_names){state->prefix, state->format ? "obj" : "ply", 4};
    return NPG_OK;
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

/* ---- measuring pass: would the names be in each other's or an earlier run's way? ---- */

static int by_value(const void *left, const void *right)
{
    int64_t a = *(const int64_t *)left, b = *(const int64_t *)right;
    return a < b ? -1 : a > b;
}

static bool is_same_folder(const char *a, const char *b)
{
    struct stat of_a, of_b;
    return !stat(a, &of_a) && !stat(b, &of_b) && of_a.st_dev == of_b.st_dev && of_a.st_ino == of_b.st_ino;
}

/* The results must not land among the frames they are made of. */
static npg_status check_source(const npg_worker *worker, const npg_frame *frame)
{
    char *folder, *meshes;
    const char *output = output_of(worker), *slash = frame->path ? strrchr(frame->path, '/') : NULL;
    if (!slash || slash == frame->path) return NPG_OK;
    NPG_TRY(npg_copy_text(&folder, frame->path));
    folder[slash - frame->path] = 0;
    npg_status status = npg_join_path(&meshes, output, "meshes");
    if (!status && is_same_folder(folder, meshes))
        status = npg_error(NPG_USAGE,
                           "%s is an input, and this run's meshes would be written over it: choose another "
                           "output folder than %s",
                           frame->path, output);
    npg_release(&folder);
    npg_release(&meshes);
    return status;
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
    if (!state->number_count) return NPG_OK;
    qsort(state->numbers, state->number_count, sizeof *state->numbers, by_value);
    for (size_t i = 1; i < state->number_count; i++)
        if (state->numbers[i] == state->numbers[i - 1])
            return npg_error(
                NPG_BAD_INPUT,
                "two frames have the number %lld and would be written to one file: set numbering "
                "to index",
                (long long)state->numbers[i]);
    set_width(state, npg_worker_facts(worker));
    if (state->overwrite) return NPG_OK;
    return npg_folder_check(output_of(worker), &state->names, state->numbers, state->number_count);
}

/* ---- solving pass ---- */

/* About what the meshes take: binary PLY, or OBJ text with its longer numbers.  0 where it can't be told. */
static uint64_t bytes_of_meshes(const npg_worker *worker)
{
    const export_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    const char *reference = npg_options_get(npg_worker_options(worker), "reference");
    uint64_t verts = npg_worker_verts_at_most(worker), per_vert = state->format ? 30 : 12;
    if (facts->frame_count < 0 || (reference && reference[0])) return 0;
    if (state->with_normals) per_vert *= 2;
    return (uint64_t)facts->frame_count * verts * (per_vert + 2 * (state->format ? 20 : 13));
}

static npg_status prepare_folder(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    const char *output = output_of(worker);
    char *meshes;
    if (npg_worker_facts(worker)->is_live && !state->overwrite)
        NPG_TRY(npg_folder_check(output, &state->names, NULL, 0));
    NPG_TRY(npg_folder_has_room(output, bytes_of_meshes(worker)));
    NPG_TRY(npg_folder_clear(output));
    NPG_TRY(npg_join_path(&meshes, output, "meshes"));
    npg_status status = npg_make_folder(meshes);
    npg_release(&meshes);
    NPG_TRY(status);
    NPG_TRY(npg_frame_log_open(&state->list, output));
    npg_job *job = npg_worker_facts(worker)->job;
    return job ? npg_job_write(job) : NPG_OK;
}

/* What an earlier run of the same job wrote stays. */
static npg_status take_up_folder(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    const char *output = output_of(worker);
    npg_job *job = npg_worker_facts(worker)->job;
    int64_t count, bytes;
    NPG_TRY(npg_folder_probe(output));
    NPG_TRY(npg_folder_has_room(output, bytes_of_meshes(worker)));
    npg_job_exported(job, &count, &bytes);
    NPG_TRY(npg_frame_log_resume(&state->list, output, bytes, &state->mesh_count, &state->skipped_count));
    return npg_job_write(job);
}

static void place_vertices(double *vert_world, const npg_facts *facts, const export_state *state,
                           const float *vert_unit, size_t vert_count)
{
    npg_box_unit_to_world(&facts->box, vert_world, vert_unit, vert_count);
    for (size_t i = 0; i < vert_count; i++) {
        double *p = vert_world + 3 * i, q[3] = {p[0], p[1], p[2]};
        for (int a = 0; a < 3; a++) p[a] = state->scale * state->map.sign[a] * q[state->map.from[a]];
    }
}

static void turn_normals(float *out, const export_state *state, const float *normals, size_t vert_count)
{
    for (size_t i = 0; i < vert_count; i++) {
        const float n[3] = {normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]};
        for (size_t a = 0; a < 3; a++)
            out[3 * i + a] = state->map.sign[a] < 0 ? -n[state->map.from[a]] : n[state->map.from[a]];
    }
}

static npg_status write_mesh(npg_worker *worker, const char *file, const float *vert_unit, bool with_normals)
{
    export_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_mesh *reference = facts->reference;
    char *path;
    place_vertices(state->vert_world, facts, state, vert_unit, reference->vert_count);
    if (with_normals) {
        npg_mesh_vertex_normals(state->vert_normals, vert_unit, reference->vert_count, reference->faces,
                                reference->face_count);
        turn_normals(state->vert_normals, state, state->vert_normals, reference->vert_count);
    }
    npg_mesh_view view = {.vert_count = reference->vert_count,
                          .face_count = reference->face_count,
                          .vert_world = state->vert_world,
                          .vert_normals = with_normals ? state->vert_normals : NULL,
                          .faces = state->faces,
                          .vert_colours = reference->vert_colours,
                          .vert_uvs = reference->vert_uvs};
    NPG_TRY(npg_join_path(&path, output_of(worker), file));
    npg_status status = npg_write_mesh(path, &view);
    npg_release(&path);
    return status;
}

/* Once the reference mesh is known: buffers, the faces as all files have them, reference.ply. */
static npg_status begin_meshes(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    const npg_mesh *reference = facts->reference;
    size_t v = reference->vert_count, f = reference->face_count;
    set_width(state, facts);
    NPG_TRY(npg_alloc_array(&state->vert_world, NPG_FOR_FILES, v, 3 * sizeof *state->vert_world));
    NPG_TRY(npg_alloc_array(&state->vert_normals, NPG_FOR_FILES, v, 3 * sizeof *state->vert_normals));
    NPG_TRY(npg_alloc_array(&state->faces, NPG_FOR_FILES, f, 3 * sizeof *state->faces));
    for (size_t i = 0; i < f; i++)
        for (size_t k = 0; k < 3; k++)
            state->faces[3 * i + k] = reference->faces[3 * i + (state->map.is_mirror ? 2 - k : k)];
    return write_mesh(worker, "reference.ply", reference->vert_pos, true);
}

static npg_status list_frame(npg_worker *worker, const npg_frame *frame, const char *file)
{
    export_state *state = npg_worker_state(worker);
    npg_job *job = npg_worker_facts(worker)->job;
    int64_t lines, bytes;
    NPG_TRY(npg_frame_log_add(state->list, frame, output_of(worker), file));
    npg_frame_log_size(state->list, &lines, &bytes);
    if (job) npg_job_note_exported(job, lines, bytes);
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
    NPG_TRY(write_mesh(worker, file, frame->vert_unit, state->with_normals));
    state->mesh_count++;
    return list_frame(worker, frame, file);
}

static void report_settings(json_t *object, const export_state *state)
{
    json_object_set_new(object, "format", json_string(state->names.ending));
    json_object_set_new(object, "scale", json_real(state->scale));
    json_object_set_new(object, "axes", json_string(state->axes));
    json_object_set_new(object, "fps", json_real(state->fps));
}

static npg_status finish(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    json_t *report = npg_worker_report(worker);
    if (!state->mesh_count) return npg_error(NPG_FAILED, "no frame got a mesh");
    report_settings(report, state);
    json_object_set_new(report, "meshes", json_integer((json_int_t)state->mesh_count));
    json_object_set_new(report, "skipped", json_integer((json_int_t)state->skipped_count));
    return npg_frame_log_finish(state->list, npg_worker_facts(worker));
}

/* ---- the last files ---- */

static json_t *json_of_options(const npg_options *options)
{
    json_t *values = json_object();
    npg_option_info info = {.struct_size = sizeof info};
    for (size_t i = 0; npg_options_describe(i, &info) == NPG_OK; i++)
        json_object_set_new(values, info.name, npg_json_text(npg_options_get(options, info.name)));
    return values;
}

static npg_status conclude(npg_worker *worker)
{
    const export_state *state = npg_worker_state(worker);
    json_t *whole = npg_worker_whole_report(worker), *head = json_object();
    if (!output_of(worker)[0]) {
        json_decref(head);
        return NPG_OK;
    }
    npg_status status = read_options(worker);
    if (!status) status = npg_json_write(output_of(worker), "report.json", whole);
    json_object_set_new(head, "neupig", json_string(npg_version()));
    json_object_set(head, "status", json_object_get(whole, "status"));
    json_object_set(head, "exit_code", json_object_get(whole, "exit_code"));
    json_object_set_new(head, "frames", json_integer((json_int_t)npg_worker_facts(worker)->frame_count));
    json_object_set(head, "meshes", json_object_get(npg_worker_report(worker), "meshes"));
    report_settings(head, state);
    json_object_set_new(head, "options", json_of_options(npg_worker_options(worker)));
    if (!status) return npg_done_write(output_of(worker), head);
    json_decref(head);
    return status;
}

/* ---- the stage ---- */

static npg_status init(npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    NPG_TRY(read_options(worker));
    if (!output_of(worker)[0]) return NPG_OK;
    if (npg_worker_pass(worker) == NPG_PASS_MEASURE || facts->is_live)
        NPG_TRY(npg_folder_probe(output_of(worker)));
    if (npg_worker_pass(worker) != NPG_PASS_SOLVE) return NPG_OK;
    return facts->is_resumed ? take_up_folder(worker) : prepare_folder(worker);
}

static npg_status process(npg_worker *worker, npg_chunk **chunk)
{
    if (!output_of(worker)[0]) return NPG_OK;
    bool is_solving = npg_worker_pass(worker) == NPG_PASS_SOLVE;
    for (size_t i = 0; i < npg_chunk_count(*chunk); i++) {
        const npg_frame *frame = npg_chunk_frame(*chunk, i);
        NPG_TRY(is_solving ? export_frame(worker, frame) : note_number(worker, frame));
    }
    return NPG_OK;
}

static npg_status flush(npg_worker *worker)
{
    if (!output_of(worker)[0]) return NPG_OK;
    return npg_worker_pass(worker) == NPG_PASS_SOLVE ? finish(worker) : check_numbers(worker);
}

static void uninit(npg_worker *worker)
{
    export_state *state = npg_worker_state(worker);
    npg_frame_log_close(&state->list);
    npg_release(&state->numbers);
    npg_release(&state->faces);
    npg_release(&state->vert_world);
    npg_release(&state->vert_normals);
}

/* A place per frame in the list; coordinates, normals and two faces per vertex; the buffers of two files. */
static size_t memory(const npg_worker *worker, size_t *chunks_held)
{
    int64_t frame_count = npg_worker_facts(worker)->frame_count;
    *chunks_held = 1;
    return 24 * (size_t)(frame_count > 0 ? frame_count : 0) + 60 * npg_worker_verts_at_most(worker) +
           (512 << 10);
}

#define OFFSET(member) offsetof(export_state, member)

static const npg_option options[] = {
    {"format", "Format of the mesh sequence", NPG_OPTION_CHOICE, OFFSET(format), "ply", 0, 0, "ply|obj",
     NULL},
    {"prefix", "First part of the mesh files' names", NPG_OPTION_TEXT, OFFSET(prefix), "frame", 0, 0, NULL,
     "NAME"},
    {"numbering", "Number of a mesh file: as in the input's name, or the place in the sequence",
     NPG_OPTION_CHOICE, OFFSET(numbering), "file", 0, 0, "file|index", NULL},
    {"scale", "Multiply all written coordinates by this", NPG_OPTION_REAL, OFFSET(scale), "1", 1e-12, 1e12,
     NULL, NULL},
    {"axes", "Which input axis becomes x, y and z, with signs: xz-y turns z up into y up", NPG_OPTION_TEXT,
     OFFSET(axes), "xyz", 0, 0, NULL, "AXES"},
    {"fps", "Frames per second of the capture, for the report and formats that carry time", NPG_OPTION_REAL,
     OFFSET(fps), "30", 1e-3, 1e6, NULL, NULL},
    {"mesh-normals", "Write vertex normals into every mesh", NPG_OPTION_FLAG, OFFSET(with_normals), "no", 0,
     0, NULL, NULL},
    {"overwrite", "Remove meshes that an earlier run left in the output folder", NPG_OPTION_FLAG,
     OFFSET(overwrite), "no", 0, 0, NULL, NULL},
    {0}};

extern const npg_stage npg_stage_export;
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
                                    .conclude = conclude};
