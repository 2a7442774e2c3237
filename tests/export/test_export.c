/* Export: what lies in the folder after a run, in which coordinates, and what happens to what lay there. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <xxhash.h>

#include "export/exporters/exporters_internal.h"
#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "tests/support/group_folder.h"
#include "tests/support/test_chain.h"

extern const npg_stage npg_stage_keyframe, npg_stage_export;

/* ---- a chain that gives every frame a tetrahedron, far from the origin ---- */

enum { FRAMES = 5 };

typedef struct scene {
    int64_t numbers[FRAMES];
    bool skipped[FRAMES];
    const char *paths[FRAMES];
    int64_t fail_at; /* index at which the stage before the export fails, -1: never */
} scene;

static const double corners[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
static const uint32_t tetrahedron[12] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
static const double origin[3] = {500000, -4000000, 100};

static void world_corner(double out[3], int64_t index, int corner)
{
    for (int a = 0; a < 3; a++) out[a] = origin[a] + corners[corner][a] + 0.25 * (double)index * (a == 1);
}

static npg_status make(npg_frame *frame, npg_facts *facts, int64_t index, void *user)
{
    const scene *s = user;
    npg_origin_offer(&facts->origin, origin);
    frame->number = s->numbers[index];
    frame->is_skipped = s->skipped[index];
    if (s->paths[index]) NPG_TRY(npg_copy_text(&frame->path, s->paths[index]));
    if (frame->is_skipped) return NPG_OK;
    NPG_TRY(npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, 4, 12));
    frame->point_count = 4;
    for (int c = 0; c < 4; c++) {
        double world[3];
        world_corner(world, index, c);
        for (int a = 0; a < 3; a++) frame->pos_local[3 * c + a] = (float)(world[a] - origin[a]);
    }
    return NPG_OK;
}

static npg_status give_mesh(npg_facts *facts, npg_frame *frame)
{
    if (!facts->reference) {
        NPG_TRY(npg_mesh_open(&facts->reference, 4, 4));
        npg_box_local_to_unit(&facts->box, facts->reference->vert_pos, frame->pos_local, 4);
        memcpy(facts->reference->faces, tetrahedron, sizeof tetrahedron);
    }
    NPG_TRY(npg_alloc_array(&frame->vert_unit, NPG_FOR_FRAMES, 4, 12));
    npg_box_local_to_unit(&facts->box, frame->vert_unit, frame->pos_local, 4);
    frame->vert_count = 4;
    frame->fields |= NPG_FIELD_VERTICES | NPG_FIELD_FIGURES;
    frame->figures = (npg_figures){.coverage = 0.75, .chamfer = (double)NAN, .good = true};
    return NPG_OK;
}

static npg_status mesh_process(npg_worker *worker, npg_chunk **chunk)
{
    const scene *s = script.user;
    for (size_t i = 0; i < npg_chunk_count(*chunk); i++) {
        npg_frame *frame = npg_chunk_frame(*chunk, i);
        if (frame->index == s->fail_at) return npg_error(NPG_DIVERGED, "frame %d failed", (int)frame->index);
        if (!frame->is_skipped) NPG_TRY(give_mesh(test_facts(worker), frame));
    }
    return NPG_OK;
}

static const npg_stage mesher = {.name = "mesher",
                                 .help = "",
                                 .passes = NPG_PASS_SOLVE,
                                 .gives = NPG_FIELD_VERTICES | NPG_FIELD_REFERENCE,
                                 .process = mesh_process};
static const npg_stage *const chain[] = {&test_source, &npg_stage_keyframe, &mesher, &npg_stage_export, NULL};

static char last_text[1024];

static scene plain_scene(void)
{
    return (scene){.numbers = {7, 8, 9, 10, 11}, .paths = {"in/b.ply"}, .fail_at = -1};
}

static npg_status run_scene(scene *s, const char *out, const char *const (*more)[2])
{
    const char *settings[16][2] = {{"input", "any"}, {"output", in_folder(&folder, out)}, {"chunk", "2"}};
    for (int i = 0; more && more[i][0]; i++) memcpy(settings[3 + i], more[i], sizeof *more);
    script = (test_script){FRAMES, make, NULL, s};
    return run_chain(chain, (const char *const(*)[2])settings, last_text);
}

static const char *in_out(const char *out, const char *name)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s", out, name);
    return in_folder(&folder, path);
}

static json_t *load_json(const char *path)
{
    json_t *json = json_load_file(path, 0, NULL);
    assert_non_null(json);
    return json;
}

/* ---- what a run leaves ---- */

static npg_mesh *load_mesh(const char *path)
{
    npg_mesh *mesh;
    npg_origin at = {.known = true, .world = {origin[0], origin[1], origin[2]}};
    assert_int_equal(npg_read_mesh(&mesh, path, &at), NPG_OK);
    return mesh;
}

static void every_frame_has_its_mesh_in_world_coordinates(void **state)
{
    (void)state;
    scene s = plain_scene();
    assert_int_equal(run_scene(&s, "plain", NULL), NPG_OK);
    for (int64_t t = 0; t < FRAMES; t++) {
        char name[64];
        snprintf(name, sizeof name, "meshes/frame_%04d.ply", (int)s.numbers[t]);
        npg_mesh *mesh = load_mesh(in_out("plain", name));
        assert_int_equal(mesh->vert_count, 4);
        assert_int_equal(mesh->face_count, 4);
        assert_memory_equal(mesh->faces, tetrahedron, sizeof tetrahedron);
        for (int c = 0; c < 4; c++) {
            double world[3];
            world_corner(world, t, c);
            for (int a = 0; a < 3; a++)
                assert_true(fabs((double)mesh->vert_pos[3 * c + a] + origin[a] - world[a]) < 2e-6);
        }
        npg_mesh_unref(&mesh);
    }
    npg_mesh *reference = load_mesh(in_out("plain", "reference.ply"));
    assert_memory_equal(reference->faces, tetrahedron, sizeof tetrahedron);
    assert_non_null(reference->vert_normals);
    npg_mesh_unref(&reference);
}

static void the_list_is_in_the_order_of_time(void **state)
{
    (void)state;
    FILE *list = fopen(in_out("plain", "frames.jsonl"), "r");
    char line[4096];
    assert_non_null(list);
    for (int64_t t = 0; t < FRAMES; t++) {
        assert_non_null(fgets(line, sizeof line, list));
        json_t *frame = json_loads(line, 0, NULL);
        assert_int_equal(json_integer_value(json_object_get(frame, "index")), t);
        assert_int_equal(json_integer_value(json_object_get(frame, "number")), 7 + t);
        assert_int_equal(json_integer_value(json_object_get(frame, "points")), 4);
        assert_int_equal(json_is_true(json_object_get(frame, "key")), t == 2);
        assert_true(json_is_true(json_object_get(frame, "good")));
        json_t *figures = json_object_get(frame, "figures");
        assert_true(json_real_value(json_object_get(figures, "coverage")) == 0.75);
        assert_true(json_is_null(json_object_get(figures, "chamfer")));
        const char *source = json_string_value(json_object_get(frame, "source"));
        assert_int_equal(source != NULL, t == 0);
        json_decref(frame);
    }
    assert_null(fgets(line, sizeof line, list));
    fclose(list);
    assert_false(exists(in_out("plain", "frames.partial.jsonl")));
}

static void check_entry(const char *out, const json_t *entry)
{
    static unsigned char bytes[1 << 20];
    char text[17];
    const char *path = json_string_value(json_object_get(entry, "path"));
    FILE *file = fopen(in_out(out, path), "rb");
    assert_non_null(file);
    size_t size = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    snprintf(text, sizeof text, "%016llx", (unsigned long long)XXH3_64bits(bytes, size));
    assert_int_equal(json_integer_value(json_object_get(entry, "bytes")), size);
    assert_string_equal(json_string_value(json_object_get(entry, "xxh3")), text);
}

static void done_lists_every_file_with_its_checksum(void **state)
{
    (void)state;
    json_t *done = load_json(in_out("plain", "done.json"));
    json_t *files = json_object_get(done, "files"), *settings = json_object_get(done, "options");
    assert_string_equal(json_string_value(json_object_get(done, "neupig")), npg_version());
    assert_string_equal(json_string_value(json_object_get(done, "status")), "ok");
    assert_int_equal(json_integer_value(json_object_get(done, "frames")), FRAMES);
    assert_int_equal(json_integer_value(json_object_get(done, "meshes")), FRAMES);
    assert_string_equal(json_string_value(json_object_get(settings, "chunk")), "2");
    assert_int_equal(json_array_size(files), FRAMES + 3);
    for (size_t i = 0; i < json_array_size(files); i++) check_entry("plain", json_array_get(files, i));
    json_decref(done);
    json_t *report = load_json(in_out("plain", "report.json"));
    json_t *own = json_object_get(json_object_get(report, "stages"), "export");
    assert_int_equal(json_integer_value(json_object_get(own, "meshes")), FRAMES);
    json_decref(report);
}

static void two_runs_give_the_same_bytes(void **state)
{
    (void)state;
    scene s = plain_scene();
    assert_int_equal(run_scene(&s, "again", NULL), NPG_OK);
    const char *const names[] = {"frames.jsonl", "reference.ply", "meshes/frame_0007.ply",
                                 "meshes/frame_0011.ply"};
    for (size_t i = 0; i < 4; i++) {
        char command[1200];
        snprintf(command, sizeof command, "cmp -s '%s' '%s'", in_out("plain", names[i]),
                 in_out("again", names[i]));
        assert_int_equal(system(command), 0);
    }
}

/* ---- options ---- */

static void scale_and_axes_change_what_is_written(void **state)
{
    (void)state;
    const struct {
        const char *axes;
        int from[3];
        double sign[3];
        bool is_mirror;
    } cases[] = {{"xz-y", {0, 2, 1}, {1, 1, -1}, false},
                 {"xzy", {0, 2, 1}, {1, 1, 1}, true},
                 {"-x+yz", {0, 1, 2}, {-1, 1, 1}, true},
                 {"yzx", {1, 2, 0}, {1, 1, 1}, false},
                 {"-z-yx", {2, 1, 0}, {-1, -1, 1}, true}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scene s = plain_scene();
        const char *const settings[][2] = {{"scale", "0.001"}, {"axes", cases[i].axes}, {"export", "obj"},
                                           {"fps", "12.5"},    {"prefix", "my mesh"},   {NULL, NULL}};
        assert_int_equal(run_scene(&s, cases[i].axes, settings), NPG_OK);
        npg_origin nowhere = {.known = true};
        npg_mesh *mesh;
        assert_int_equal(npg_read_mesh(&mesh, in_out(cases[i].axes, "meshes/my mesh_0010.obj"), &nowhere),
                         NPG_OK);
        for (int c = 0; c < 4; c++) {
            double world[3];
            world_corner(world, 3, c);
            for (int a = 0; a < 3; a++) {
                double expected = 0.001 * cases[i].sign[a] * world[cases[i].from[a]];
                assert_true(fabs((double)mesh->vert_pos[3 * c + a] - expected) < 4e-4); /* read as float */
            }
        }
        assert_int_equal(mesh->faces[0], cases[i].is_mirror ? 1 : 0);
        assert_true(npg_mesh_volume(mesh) > 0); /* faces still look outward */
        npg_mesh_unref(&mesh);
        json_t *done = load_json(in_out(cases[i].axes, "done.json"));
        assert_string_equal(json_string_value(json_object_get(done, "axes")), cases[i].axes);
        assert_true(json_real_value(json_object_get(done, "fps")) == 12.5);
        json_decref(done);
    }
}

static void senseless_options_are_refused(void **state)
{
    const char *const cases[][2] = {
        {"axes", "xyy"}, {"axes", "xy"},    {"axes", "xyzx"}, {"axes", ""},       {"axes", "--xyz"},
        {"prefix", ""},  {"prefix", "a/b"}, {"prefix", ".a"}, {"prefix", "\xff"}, {"prefix", "a\nb"}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scene s = plain_scene();
        const char *const settings[][2] = {{cases[i][0], cases[i][1]}, {NULL, NULL}};
        assert_int_equal(run_scene(&s, "senseless", settings), NPG_USAGE);
        assert_non_null(strstr(last_text, cases[i][0]));
        assert_false(exists(in_out("senseless", "meshes")));
    }
}

static void the_number_is_as_wide_as_the_largest(void **state)
{
    (void)state;
    scene s = plain_scene();
    s.numbers[4] = 1234567;
    assert_int_equal(run_scene(&s, "wide", NULL), NPG_OK);
    assert_true(exists(in_out("wide", "meshes/frame_0000007.ply")));
    assert_true(exists(in_out("wide", "meshes/frame_1234567.ply")));
}

static void a_skipped_frame_is_listed_without_a_mesh(void **state)
{
    (void)state;
    scene s = plain_scene();
    s.skipped[1] = true;
    assert_int_equal(run_scene(&s, "skipped", NULL), NPG_OK);
    assert_false(exists(in_out("skipped", "meshes/frame_0008.ply")));
    char *text = text_of_file(in_out("skipped", "frames.jsonl"));
    const char *line = strstr(text, "\"number\":8");
    assert_non_null(line);
    assert_non_null(strstr(line, "\"skipped\":true"));
    assert_non_null(strstr(line, "\"file\":null"));
    free(text);
    json_t *done = load_json(in_out("skipped", "done.json"));
    assert_int_equal(json_integer_value(json_object_get(done, "meshes")), 4);
    json_decref(done);
}

/* ---- what lay there before ---- */

static void another_runs_meshes_are_not_mixed_in(void **state)
{
    (void)state;
    scene s = plain_scene(), other = plain_scene();
    for (int i = 0; i < FRAMES; i++) other.numbers[i] = 8 + i;
    const char *const overwrite[][2] = {{"overwrite", "yes"}, {NULL, NULL}};
    assert_int_equal(run_scene(&s, "mixed", NULL), NPG_OK);
    assert_int_equal(write_text_file(in_out("mixed", "meshes/notes.txt"), "mine"), 0);
    assert_int_equal(run_scene(&s, "mixed", NULL), NPG_OK); /* the same names: written again */
    assert_int_equal(run_scene(&other, "mixed", NULL), NPG_USAGE);
    assert_non_null(strstr(last_text, "frame_0007.ply"));
    assert_non_null(strstr(last_text, "overwrite"));
    assert_true(exists(in_out("mixed", "done.json"))); /* and the old result is still whole */
    assert_true(exists(in_out("mixed", "meshes/frame_0007.ply")));
    assert_int_equal(run_scene(&other, "mixed", overwrite), NPG_OK);
    assert_false(exists(in_out("mixed", "meshes/frame_0007.ply")));
    assert_true(exists(in_out("mixed", "meshes/frame_0012.ply")));
    assert_true(exists(in_out("mixed", "meshes/notes.txt")));
}

static void a_run_that_fails_leaves_no_done(void **state)
{
    (void)state;
    scene s = plain_scene();
    assert_int_equal(run_scene(&s, "failing", NULL), NPG_OK);
    s.fail_at = 0; /* the last but one: the key, 3 and 4 come before */
    assert_int_equal(run_scene(&s, "failing", NULL), NPG_DIVERGED);
    assert_false(exists(in_out("failing", "done.json")));
    assert_false(exists(in_out("failing", "report.json")));
    assert_false(exists(in_out("failing", "frames.jsonl")));
    s.fail_at = -1;
    assert_int_equal(run_scene(&s, "failing", NULL), NPG_OK);
    assert_true(exists(in_out("failing", "done.json")));
}

static void a_bad_input_leaves_an_old_result_alone(void **state)
{
    (void)state;
    scene s = plain_scene();
    assert_int_equal(run_scene(&s, "old", NULL), NPG_OK);
    for (int i = 0; i < FRAMES; i++) s.skipped[i] = true;
    assert_int_equal(run_scene(&s, "old", NULL), NPG_BAD_INPUT);
    assert_true(exists(in_out("old", "done.json")));
    assert_true(exists(in_out("old", "meshes/frame_0009.ply")));
}

static void leftovers_of_a_killed_run_go(void **state)
{
    (void)state;
    scene s = plain_scene();
    assert_int_equal(run_scene(&s, "left", NULL), NPG_OK);
    assert_int_equal(write_text_file(in_out("left", "meshes/.frame_0009.ply.part"), "half"), 0);
    assert_int_equal(write_text_file(in_out("left", "frames.partial.jsonl"), "half"), 0);
    assert_int_equal(run_scene(&s, "left", NULL), NPG_OK);
    assert_false(exists(in_out("left", "meshes/.frame_0009.ply.part")));
    assert_false(exists(in_out("left", "frames.partial.jsonl")));
}

static void inputs_are_never_written_over(void **state)
{
    (void)state;
    scene s = plain_scene();
    assert_int_equal(run_scene(&s, "loop", NULL), NPG_OK);
    char path[600];
    snprintf(path, sizeof path, "%s/../loop/meshes/frame_0007.ply", in_folder(&folder, "loop"));
    s.paths[0] = path;
    assert_int_equal(run_scene(&s, "loop", NULL), NPG_USAGE);
    assert_non_null(strstr(last_text, "is an input"));
    assert_true(exists(in_out("loop", "meshes/frame_0007.ply")));
}

/* ---- disks ---- */

static void a_folder_that_can_not_be_written_is_said_at_once(void **state)
{
    (void)state;
    scene s = plain_scene();
    assert_int_equal(write_text_file(in_folder(&folder, "a-file"), ""), 0);
    assert_int_equal(run_scene(&s, "a-file", NULL), NPG_DISK);
    assert_int_equal(run_scene(&s, "a-file/below", NULL), NPG_DISK);
    assert_non_null(strstr(last_text, "a-file"));
    const char *const proc[][2] = {{"output", "/proc/neupig"}, {NULL, NULL}};
    assert_int_equal(run_scene(&s, "unused", proc), NPG_DISK);
}

static void results_that_can_not_fit_are_refused_at_once(void **state)
{
    (void)state;
    assert_int_equal(npg_folder_has_room(folder.path, 4096), NPG_OK);
    assert_int_equal(npg_folder_has_room(folder.path, UINT64_C(1) << 62), NPG_DISK);
    assert_non_null(strstr(npg_error_text(), folder.path));
    assert_non_null(strstr(npg_error_text(), "4398046511104 MiB"));
    assert_int_equal(npg_folder_has_room(in_folder(&folder, "nowhere"), 1), NPG_DISK);
}

static int run_with_limit(rlim_t limit)
{
    const struct rlimit bound = {limit, limit};
    scene s = plain_scene();
    signal(SIGXFSZ, SIG_IGN);
    if (setrlimit(RLIMIT_FSIZE, &bound)) return 99;
    return npg_status_exit_code(run_scene(&s, "full", NULL));
}

/* A limit on the size of files stands for the full disk: the first try is refused before any work. */
static void a_full_disk_ends_the_run_with_its_code(void **state)
{
    (void)state;
    int status;
    pid_t child = fork();
    if (child == 0) _exit(run_with_limit(1000));
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 5);
    assert_false(exists(in_out("full", "done.json")));
    assert_false(exists(in_out("full", "meshes")));
    assert_false(exists(in_out("full", ".write-test")));
}

static void no_memory_leaves_no_done(void **state)
{
    (void)state;
    size_t before = npg_memory_used();
    npg_status status = NPG_MEMORY;
    uint64_t n = 1;
    for (; status && n < 1000; n += status && n > 60 ? 7 : 1) {
        scene s = plain_scene();
        npg_memory_fail_at(n, false);
        status = run_scene(&s, "memory", NULL);
        npg_memory_fail_at(0, false);
        assert_true(status == NPG_OK || status == NPG_MEMORY);
        assert_int_equal(exists(in_out("memory", "done.json")), status == NPG_OK);
        assert_int_equal(npg_memory_used(), before);
    }
    assert_int_equal(status, NPG_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_frame_has_its_mesh_in_world_coordinates),
        cmocka_unit_test(the_list_is_in_the_order_of_time),
        cmocka_unit_test(done_lists_every_file_with_its_checksum),
        cmocka_unit_test(two_runs_give_the_same_bytes),
        cmocka_unit_test(scale_and_axes_change_what_is_written),
        cmocka_unit_test(senseless_options_are_refused),
        cmocka_unit_test(the_number_is_as_wide_as_the_largest),
        cmocka_unit_test(a_skipped_frame_is_listed_without_a_mesh),
        cmocka_unit_test(another_runs_meshes_are_not_mixed_in),
        cmocka_unit_test(a_run_that_fails_leaves_no_done),
        cmocka_unit_test(a_bad_input_leaves_an_old_result_alone),
        cmocka_unit_test(leftovers_of_a_killed_run_go),
        cmocka_unit_test(inputs_are_never_written_over),
        cmocka_unit_test(a_folder_that_can_not_be_written_is_said_at_once),
        cmocka_unit_test(results_that_can_not_fit_are_refused_at_once),
        cmocka_unit_test(a_full_disk_ends_the_run_with_its_code),
        cmocka_unit_test(no_memory_leaves_no_done),
    };
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
