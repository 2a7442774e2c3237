/* Exporters: choosing them, what they refuse, what is in their files, and what stays when
 * the disk or memory ends. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <malloc.h>
#include <math.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include "export/export.h"
#include "export/exporters/exporters_internal.h"
#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "tests/export/read_surface.h"
#include "tests/support/group_folder.h"

enum { V = 5, F = 6 }; /* two tetrahedra on one base: closed */

static const uint32_t faces[3 * F] = {0, 1, 3, 1, 2, 3, 2, 0, 3, 1, 0, 4, 2, 1, 4, 0, 2, 4};
static const float rest[3 * V] = {0, 0, 0, 1, 0, 0, 0.5f, 0, -1, 0.5f, 1, -0.3f, 0.5f, -1, -0.3f};
static const uint8_t colours[4 * V] = {255, 0,   0, 255, 0, 255, 0, 255, 0, 0,
                                       255, 255, 9, 8,   7, 255, 1, 2,   3, 128};
static const float uvs[2 * V] = {0, 0, 1, 0, 0.5f, 0.25f, 0, 1, 1, 1};

static void pose_at(float pos[3 * V], int64_t index)
{
    double turn = 0.01 * (double)index;
    for (int i = 0; i < V; i++) {
        double x = (double)rest[3 * i], z = (double)rest[3 * i + 2];
        pos[3 * i] = (float)(x * cos(turn) + z * sin(turn) + 0.125 * (double)index);
        pos[3 * i + 1] = rest[3 * i + 1] - 0.25f;
        pos[3 * i + 2] = (float)(z * cos(turn) - x * sin(turn));
    }
}

/* OUT with a sequence of `count` meshes; those at `missing` are not there. */
static const char *make_run(const char *name, int64_t count, int64_t missing)
{
    static char out[512];
    char path[600];
    snprintf(out, sizeof out, "%s/%s", folder.path, name);
    snprintf(path, sizeof path, "%s/meshes", out);
    assert_int_equal(mkdir(out, 0777), 0);
    assert_int_equal(mkdir(path, 0777), 0);
    snprintf(path, sizeof path, "%s/frames.jsonl", out);
    FILE *list = fopen(path, "w");
    for (int64_t t = 0; t < count; t++) {
        float pos[3 * V];
        double world[3 * V];
        fprintf(list, "{\"index\":%d,\"number\":%d,\"file\":", (int)t, (int)t + 10);
        if (t == missing) {
            fprintf(list, "null}\n");
            continue;
        }
        fprintf(list, "\"meshes/frame_%04d.ply\"}\n", (int)t + 10);
        pose_at(pos, t);
        for (int i = 0; i < 3 * V; i++) world[i] = (double)pos[i];
        npg_mesh_view view = {.vert_count = V, .face_count = F, .vert_world = world, .faces = faces};
        snprintf(path, sizeof path, "%s/meshes/frame_%04d.ply", out, (int)t + 10);
        assert_int_equal(npg_write_ply(path, &view), NPG_OK);
    }
    fclose(list);
    return out;
}

static npg_export_facts facts_of(const char *out)
{
    return (npg_export_facts){.output = out,
                              .prefix = "frame",
                              .width = 4,
                              .vert_count = V,
                              .face_count = F,
                              .faces = faces,
                              .rest = rest,
                              .fps = 25,
                              .metres_per_unit = 1,
                              .largest = 2,
                              .diagonal = 3,
                              .longest = 2,
                              .voxel_share = 0.05};
}

static npg_status write_list(const char *list, npg_export_facts *facts, npg_export_watch *watch)
{
    npg_export_choice choice;
    NPG_TRY(npg_exporters_choose(&choice, list, NULL));
    return npg_exporters_write(&choice, facts, watch);
}

static unsigned char *bytes_of(const char *out, const char *name, size_t *size)
{
    char path[700];
    snprintf(path, sizeof path, "%s/%s", out, name);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    unsigned char *bytes = malloc(4 << 20);
    *size = fread(bytes, 1, 4 << 20, file);
    fclose(file);
    return bytes;
}

static bool is_there(const char *out, const char *name)
{
    char path[700];
    snprintf(path, sizeof path, "%s/%s", out, name);
    return exists(path);
}

static uint32_t word_at(const unsigned char *bytes, size_t at)
{
    return bytes[at] | (uint32_t)bytes[at + 1] << 8 | (uint32_t)bytes[at + 2] << 16 |
           (uint32_t)bytes[at + 3] << 24;
}

static float float_at(const unsigned char *bytes, size_t at)
{
    uint32_t word = word_at(bytes, at);
    float value;
    memcpy(&value, &word, sizeof value);
    return value;
}

/* ---- choosing ---- */

static void help_names_all_of_the_table(void **state)
{
    char all[256] = "";
    (void)state;
    for (int i = 0; npg_exporters[i]; i++) strcat(strcat(all, i ? "," : ""), npg_exporters[i]->name);
    assert_string_equal(all, NPG_EXPORT_FORMS);
}

static void the_list_says_what_is_made(void **state)
{
    npg_export_choice choice;
    (void)state;
    assert_int_equal(npg_exporters_choose(&choice, "", NULL), NPG_OK);
    assert_false(choice.is_obj);
    assert_false(choice.chosen[0]);
    assert_int_equal(npg_exporters_choose(&choice, "obj", NULL), NPG_OK);
    assert_true(choice.is_obj); /* alone it is the sequence itself */
    assert_false(choice.chosen[0]);
    assert_int_equal(npg_exporters_choose(&choice, "obj,ply", NULL), NPG_OK);
    assert_false(choice.is_obj);
    assert_true(choice.chosen[0]);
    json_t *names = npg_exporters_json(&choice);
    assert_int_equal(json_array_size(names), 2);
    json_decref(names);
    assert_int_equal(npg_exporters_choose(&choice, "glb,ply", "obj"), NPG_OK); /* of a run that wrote OBJ */
    assert_true(choice.is_obj && choice.has_sequence);
    char *list = npg_exporters_list(&choice);
    assert_string_equal(list, "obj,ply,glb");
    free(list);
    assert_int_equal(npg_exporters_choose(&choice, "glb", NULL), NPG_OK);
    assert_false(choice.has_sequence);
}

static void what_is_no_form_is_refused(void **state)
{
    const char *const lists[] = {"fbx", "glb,", ",glb", "glb,,npz", "GLB", "glb npz", " glb"};
    npg_export_choice choice;
    (void)state;
    for (size_t i = 0; i < sizeof lists / sizeof *lists; i++) {
        assert_int_equal(npg_exporters_choose(&choice, lists[i], NULL), NPG_USAGE);
        assert_non_null(strstr(npg_error_text(), "is none of ply, obj, pc2"));
    }
}

static void what_a_form_can_not_hold_is_refused(void **state)
{
    npg_export_facts facts = facts_of("unused");
    npg_export_choice choice;
    (void)state;
    facts.pose_count = 10;
    assert_int_equal(npg_exporters_choose(&choice, "pc2,mdd,glb,usda,npz,vdb", NULL), NPG_OK);
    assert_int_equal(npg_exporters_check(&choice, &facts), NPG_OK);
    facts.face_count = 0;
    assert_int_equal(npg_exporters_check(&choice, &facts), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "points without faces"));
    facts.face_count = F;
    facts.largest = 51; /* more than 16.8 diagonals */
    assert_int_equal(npg_exporters_check(&choice, &facts), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "centre"));
    facts.largest = 2;
    facts.pose_count = (int64_t)1 << 31;
    assert_int_equal(npg_exporters_check(&choice, &facts), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "frames in 31 bits"));
    facts.pose_count = 10;
    facts.vert_count = (size_t)1 << 31;
    assert_int_equal(npg_exporters_choose(&choice, "glb", NULL), NPG_OK);
    assert_int_equal(npg_exporters_check(&choice, &facts), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "glb"));
    facts.vert_count = 8193;
    facts.last_index = 4999; /* two rows a frame */
    assert_int_equal(npg_exporters_choose(&choice, "vat", NULL), NPG_OK);
    assert_int_equal(npg_exporters_check(&choice, &facts), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "5000 frames of 8193 vertices"));
    facts.last_index = 0;
    facts.pose_count = -1; /* a live source: nothing is known, nothing is refused */
    facts.vert_count = V;
    facts.face_count = F;
    facts.largest = facts.diagonal = 0;
    assert_int_equal(npg_exporters_choose(&choice, "pc2,mdd,glb,usda,npz,vdb", NULL), NPG_OK);
    assert_int_equal(npg_exporters_check(&choice, &facts), NPG_OK);
    assert_int_equal(npg_exporters_bytes(&choice, &facts), 0);
}

/* ---- files ---- */

static void point_caches_repeat_what_is_missing(void **state)
{
    const char *out = make_run("gap", 6, 3);
    npg_export_facts facts = facts_of(out);
    npg_export_watch watch = {0};
    size_t size;
    (void)state;
    assert_int_equal(write_list("pc2", &facts, &watch), NPG_OK);
    assert_int_equal(watch.repeated, 1);
    unsigned char *cache = bytes_of(out, "motion.pc2", &size);
    assert_int_equal(size, 32 + 6 * V * 12);
    assert_int_equal(word_at(cache, 28), 6);
    for (int t = 0; t < 6; t++) {
        float pos[3 * V];
        pose_at(pos, t == 3 ? 2 : t);
        for (int i = 0; i < 3 * V; i++)
            assert_true(float_at(cache, 32 + 4 * (size_t)(t * 3 * V + i)) == pos[i]);
    }
    free(cache);
    assert_true(is_there(out, "reference.obj"));
}

/* The JSON of a GLB; *binary is where its second part begins. */
static json_t *json_of(const unsigned char *glb, size_t size, size_t *binary)
{
    assert_memory_equal(glb, "glTF", 4);
    assert_int_equal(word_at(glb, 4), 2);
    assert_int_equal(word_at(glb, 8), size);
    size_t length = word_at(glb, 12);
    assert_int_equal(length % 4, 0);
    json_t *json = json_loadb((const char *)glb + 20, length, 0, NULL);
    assert_non_null(json);
    assert_memory_equal(glb + 24 + length, "BIN", 4);
    *binary = 28 + length;
    assert_int_equal(word_at(glb, 20 + length), size - *binary);
    return json;
}

static void a_long_capture_becomes_several_glb(void **state)
{
    const char *out = make_run("long", 300, -1);
    npg_export_facts facts = facts_of(out);
    npg_export_watch watch = {0};
    const int64_t counts[] = {256, 44};
    (void)state;
    assert_int_equal(write_list("glb", &facts, &watch), NPG_OK);
    assert_false(is_there(out, "motion.glb"));
    assert_false(is_there(out, "motion_002.glb"));
    for (int k = 0; k < 2; k++) {
        size_t size, binary;
        float first[3 * V], pos[3 * V];
        unsigned char *glb = bytes_of(out, k ? "motion_001.glb" : "motion_000.glb", &size);
        json_t *json = json_of(glb, size, &binary);
        json_t *extras = json_object_get(json_object_get(json, "asset"), "extras");
        assert_int_equal(json_integer_value(json_object_get(extras, "first_frame")), 256 * k);
        assert_int_equal(json_integer_value(json_object_get(extras, "frames")), counts[k]);
        pose_at(first, 256 * k);
        for (int64_t t = 1; t < counts[k]; t += 42) {
            pose_at(pos, 256 * k + t);
            for (int i = 0; i < 3 * V; i++) {
                size_t base = binary + 12 * F, delta = base + 12 * V * (size_t)t;
                float sum = float_at(glb, base + 4 * (size_t)i) + float_at(glb, delta + 4 * (size_t)i);
                assert_true(fabs((double)sum - (double)pos[i]) < 4e-6);
            }
        }
        json_decref(json);
        free(glb);
    }
}

static void colours_and_seams_come_along(void **state)
{
    const char *out = make_run("seams", 2, -1);
    npg_export_facts facts = facts_of(out);
    npg_export_watch watch = {0};
    float corner_uvs[6 * F];
    size_t size, binary;
    (void)state;
    for (size_t i = 0; i < 3 * F; i++) { /* the lower tetrahedron has an island of its own */
        corner_uvs[2 * i] = uvs[2 * faces[i]] + (i >= 9 ? 2 : 0);
        corner_uvs[2 * i + 1] = uvs[2 * faces[i] + 1];
    }
    facts.colours = colours;
    facts.uvs = uvs;
    facts.corner_uvs = corner_uvs;
    assert_int_equal(write_list("glb,usda,npz,ply,obj", &facts, &watch), NPG_OK);
    unsigned char *glb = bytes_of(out, "motion.glb", &size);
    json_t *json = json_of(glb, size, &binary);
    json_t *accessor = json_array_get(json_object_get(json, "accessors"), 1);
    size_t count = (size_t)json_integer_value(json_object_get(accessor, "count"));
    assert_int_equal(count, V + 3); /* the rim's vertices are doubled */
    size_t colours_at = binary + 12 * F + 12 * count, uvs_at = colours_at + 8 * count;
    assert_int_equal(word_at(glb, colours_at), 0xffff); /* red, no green */
    for (size_t i = 0; i < 3 * F; i++) {
        uint32_t index = word_at(glb, binary + 4 * i);
        assert_true(float_at(glb, uvs_at + 8 * index) == corner_uvs[2 * i]);
        assert_true(float_at(glb, uvs_at + 8 * index + 4) == 1 - corner_uvs[2 * i + 1]);
    }
    json_decref(json);
    free(glb);
    char *usda = text_of_file(in_folder(&folder, "seams/motion.usda"));
    assert_non_null(strstr(usda, "interpolation = \"faceVarying\""));
    assert_non_null(strstr(usda, "displayColor = [(1, 0, 0), (0, 1, 0)"));
    free(usda);
    char *obj = text_of_file(in_folder(&folder, "seams/obj/frame_0011.obj"));
    assert_non_null(strstr(obj, "vt 0.5"));
    assert_non_null(strstr(obj, "1.0000 0.0000 0.0000\n"));
    free(obj);
}

static void colours_of_frames_come_along(void **state)
{
    const char *out = make_run("hues", 2, -1);
    npg_export_facts facts = facts_of(out);
    npg_export_watch watch = {0};
    (void)state;
    for (int64_t t = 0; t < 2; t++) { /* the meshes again, with colours: in the second one all are grey */
        char path[600];
        float pos[3 * V];
        double world[3 * V];
        uint8_t grey[4 * V];
        memset(grey, 188, sizeof grey);
        pose_at(pos, t);
        for (int i = 0; i < 3 * V; i++) world[i] = (double)pos[i];
        npg_mesh_view view = {.vert_count = V,
                              .face_count = F,
                              .vert_world = world,
                              .faces = faces,
                              .vert_colours = t ? grey : colours};
        snprintf(path, sizeof path, "%s/meshes/frame_%04d.ply", out, (int)t + 10);
        assert_int_equal(npg_write_ply(path, &view), NPG_OK);
    }
    facts.colours = colours;
    facts.has_pose_colours = true;
    assert_int_equal(write_list("usda,npz", &facts, &watch), NPG_OK);
    char *usda = text_of_file(in_folder(&folder, "hues/motion.usda"));
    const char *samples = strstr(usda, "        color3f[] primvars:displayColor.timeSamples = {\n");
    assert_non_null(strstr(usda, "        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)"));
    assert_non_null(samples);
    const char *first = strstr(samples, "            0: [(1.00000, 0.00000, 0.00000), (0.00000, 1.00000, "),
               *second = strstr(samples, "            1: [(0.50289, 0.50289, 0.50289), (0.50289, ");
    const char *end = strstr(samples, "        }\n    }\n}\n");
    assert_true(first && second && end && samples < first && first < second && second < end);
    int tuples = 0;
    for (const char *at = first; at < end; at++) tuples += *at == '(';
    assert_int_equal(tuples, 2 * V);
    free(usda);
}

static void level_sets_close_openings(void **state)
{
    const char *out = make_run("volume", 1, -1);
    npg_export_watch watch = {0};
    double area, volume, voxel;
    (void)state;
    npg_export_facts facts = facts_of(out);
    float pos[3 * V];
    npg_mesh whole = {
        .vert_count = V, .face_count = F, .faces = (uint32_t *)(uintptr_t)faces, .vert_pos = pos};
    pose_at(pos, 0);
    facts.voxel_share = 0.005;
    assert_int_equal(write_list("vdb", &facts, &watch), NPG_OK);
    const char *path = in_folder(&folder, "volume/volumes/frame_0010.vdb");
    read_surface(path, &area, &volume, &voxel);
    assert_true(fabs(voxel - 0.01) < 1e-6);
    assert_true(fabs(area / npg_mesh_area(&whole) - 1) < 0.05);
    assert_true(fabs(volume / fabs(npg_mesh_volume(&whole)) - 1) < 0.05);
    uint32_t *caps;
    size_t cap_count;
    assert_int_equal(npg_border_caps(&caps, &cap_count, V, faces, F), NPG_OK);
    assert_int_equal(cap_count, 0);
    npg_release(&caps);
    assert_int_equal(npg_border_caps(&caps, &cap_count, V, faces, 3), NPG_OK); /* the lower half is missing */
    assert_int_equal(cap_count, 1);
    uint32_t closed[12];
    memcpy(closed, faces, 9 * sizeof *closed);
    memcpy(closed + 9, caps, 3 * sizeof *closed);
    npg_release(&caps);
    npg_mesh half = {.vert_count = V, .face_count = 4, .faces = closed, .vert_pos = (float *)(uintptr_t)rest};
    npg_manifold manifold;
    assert_int_equal(npg_mesh_manifold(&manifold, &half), NPG_OK);
    assert_int_equal(manifold.border_edges + manifold.misoriented_edges, 0);
}

/* ---- parts ---- */

static void a_rigid_motion_is_found(void **state)
{
    float to[3 * V];
    double rotation[3][3], translation[3];
    (void)state;
    for (int k = 0; k < 40; k++) {
        pose_at(to, 16 * k);
        npg_rigid_fit(rotation, translation, rest, to, V);
        for (int i = 0; i < V; i++)
            for (int a = 0; a < 3; a++) {
                double x = translation[a];
                for (int b = 0; b < 3; b++) x += rotation[a][b] * (double)rest[3 * i + b];
                assert_true(fabs(x - (double)to[3 * i + a]) < 1e-5);
            }
    }
    for (int i = 0; i < V; i++)
        to[3 * i] = -rest[3 * i], to[3 * i + 1] = rest[3 * i + 1], to[3 * i + 2] = rest[3 * i + 2];
    npg_rigid_fit(rotation, translation, rest, to, V); /* a mirror image: still a rotation */
    double det = 0;
    for (int a = 0; a < 3; a++)
        det += rotation[0][a] * (rotation[1][(a + 1) % 3] * rotation[2][(a + 2) % 3] -
                                 rotation[1][(a + 2) % 3] * rotation[2][(a + 1) % 3]);
    assert_true(fabs(det - 1) < 1e-12);
}

/* ---- failures ---- */

static void a_changed_mesh_is_noticed(void **state)
{
    const char *out = make_run("changed", 3, -1);
    npg_export_facts facts = facts_of(out);
    npg_export_watch watch = {0};
    double world[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    npg_mesh_view view = {
        .vert_count = 4, .face_count = 2, .vert_world = world, .faces = (uint32_t[]){0, 1, 2, 0, 2, 3}};
    (void)state;
    assert_int_equal(npg_write_ply(in_folder(&folder, "changed/meshes/frame_0012.ply"), &view), NPG_OK);
    assert_int_equal(write_list("pc2,mdd,glb,usda,npz,vdb", &facts, &watch), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "frame_0012.ply was changed"));
    const char *const names[] = {"motion.pc2", "motion.mdd",       "motion.glb",           "motion.usda",
                                 "motion.npz", ".motion.npz.part", "exports.partial.jsonl"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) assert_false(is_there(out, names[i]));
}

static bool stop_at_once(void *user)
{
    (void)user;
    return true;
}

static void a_stop_leaves_nothing(void **state)
{
    const char *out = make_run("stopped", 3, -1);
    npg_export_facts facts = facts_of(out);
    npg_export_watch watch = {.should_stop = stop_at_once};
    (void)state;
    assert_int_equal(write_list("npz,usda", &facts, &watch), NPG_STOPPED);
    assert_false(is_there(out, "motion.npz"));
    assert_false(is_there(out, ".motion.usda.part"));
}

/* A limit on the size of files stands for the full disk. */
static void a_full_disk_is_said(void **state)
{
    const char *const lists[] = {"pc2", "mdd", "glb", "usda", "npz", "vdb", "vat", "glb-meshopt", "ply,obj"};
    const char *out = make_run("full", 300, -1);
    (void)state;
    for (size_t i = 0; i < sizeof lists / sizeof *lists; i++) {
        int status;
        pid_t child = fork();
        if (child == 0) {
            const struct rlimit bound = {300, 300};
            npg_export_facts facts = facts_of(out);
            npg_export_watch watch = {0};
            signal(SIGXFSZ, SIG_IGN);
            setrlimit(RLIMIT_FSIZE, &bound);
            _exit(npg_status_exit_code(write_list(lists[i], &facts, &watch)));
        }
        assert_int_equal(waitpid(child, &status, 0), child);
        assert_true(WIFEXITED(status));
        assert_int_equal(WEXITSTATUS(status), 5);
        assert_false(is_there(out, "exports.partial.jsonl"));
    }
}

/* ---- memory does not grow with frames ---- */

static size_t most_counted;

static void *take(void *user, size_t align, size_t size)
{
    (void)user;
    size_t now = npg_memory_used() + size;
    if (now > most_counted) most_counted = now;
    return aligned_alloc(align, (size + align - 1) / align * align);
}

static void give(void *user, void *memory)
{
    (void)user;
    free(memory);
}

/* In use between frames: after the first, what the library counts; after the 12th, all that malloc() gave,
 * for other libraries' is not counted. */
typedef struct held {
    int frames;
    size_t counted, counted_most, given, given_most;
} held;

static bool look(void *user)
{
    held *h = user;
    struct mallinfo2 now = mallinfo2();
    size_t given = now.uordblks + now.hblkhd, counted = npg_memory_used();
    if (++h->frames == 2) h->counted = counted;
    if (h->frames == 12) h->given = given;
    if (h->frames >= 2 && counted > h->counted_most) h->counted_most = counted;
    if (h->frames >= 12 && given > h->given_most) h->given_most = given;
    return false;
}

/* One mesh stands for all frames: what is in them does not matter here. */
static const char *make_repeated(const char *name, int64_t count)
{
    const char *out = make_run(name, 1, -1);
    char path[600];
    snprintf(path, sizeof path, "%s/frames.jsonl", out);
    FILE *list = fopen(path, "w");
    for (int64_t t = 0; t < count; t++)
        fprintf(list, "{\"index\":%d,\"number\":%d,\"file\":\"meshes/frame_0010.ply\"}\n", (int)t, (int)t);
    fclose(list);
    return out;
}

/* The most that was counted while `count` frames were written in a format. */
static size_t counted_for(const char *list, int64_t count)
{
    char name[80];
    snprintf(name, sizeof name, "%s-of-%d", list, (int)count);
    npg_export_facts facts = facts_of(make_repeated(name, count));
    held h = {0};
    npg_export_watch watch = {.should_stop = look, .user = &h};
    facts.uvs = uvs;
    facts.colours = colours;
    most_counted = 0;
    assert_int_equal(write_list(list, &facts, &watch), NPG_OK);
    assert_int_equal(h.frames, count);
    if (count <= 256 && h.counted_most != h.counted) /* one file */
        fail_msg("%s: %zu counted bytes after the first frame, %zu later", list, h.counted, h.counted_most);
    if (h.given_most > h.given + (64 << 10))
        fail_msg("%s: %zu bytes in use after 11 frames, %zu later", list, h.given, h.given_most);
    return most_counted;
}

static void memory_does_not_grow_with_frames(void **state)
{
    const char *const lists[] = {"ply,obj", "pc2", "mdd", "usda", "npz", "vdb", "vat", "glb-meshopt", "glb"};
    const npg_allocator noting = {sizeof noting, NULL, take, give};
    (void)state;
    assert_int_equal(npg_memory_set_allocator(&noting), NPG_OK);
    for (size_t i = 0; i < sizeof lists / sizeof *lists; i++) {
        bool is_glb = !strcmp(lists[i], "glb");
        size_t few = counted_for(lists[i], 12), many = counted_for(lists[i], 48);
        /* a line of text for each pose of the file that is written, and what the text's
         * buffer has to spare */
        size_t allowed = is_glb ? (48 - 12) * 1024 : 600;
        if (many > few + allowed) fail_msg("%s: %zu bytes for 12 frames, %zu for 48", lists[i], few, many);
        if (!is_glb) continue;
        /* one file of 256 against four: the same text but for its numbers */
        few = counted_for(lists[i], 256), many = counted_for(lists[i], 1024);
        if (many > few + 4096) fail_msg("%s: %zu bytes for 256 frames, %zu for 1024", lists[i], few, many);
    }
    assert_int_equal(npg_memory_set_allocator(NULL), NPG_OK);
}

static void no_memory_leaves_no_list(void **state)
{
    const char *out = make_run("memory", 3, 1);
    size_t before = npg_memory_used();
    npg_status status = NPG_MEMORY;
    (void)state;
    for (uint64_t n = 1; status && n < 2000; n++) {
        npg_export_facts facts = facts_of(out);
        npg_export_watch watch = {0};
        facts.uvs = uvs;
        npg_memory_fail_at(n, false);
        status = write_list("ply,obj,pc2,mdd,glb,glb-meshopt,vat,usda,npz,vdb", &facts, &watch);
        npg_memory_fail_at(0, false);
        assert_true(status == NPG_OK || status == NPG_MEMORY);
        assert_int_equal(is_there(out, "exports.partial.jsonl"), status == NPG_OK);
        assert_int_equal(npg_memory_used(), before);
    }
    assert_int_equal(status, NPG_OK);
}

static void clearing_leaves_what_is_not_ours(void **state)
{
    const char *out = make_run("clear", 2, -1);
    npg_export_facts facts = facts_of(out);
    npg_export_watch watch = {0};
    (void)state;
    assert_int_equal(write_list("ply,obj,pc2,glb,vdb", &facts, &watch), NPG_OK);
    const char *const mine[] = {"motion.txt", "my motion.glb", "motion_1.glb.bak", "obj/notes.obj",
                                "volumes/x.vdb"};
    for (size_t i = 0; i < 5; i++) {
        char path[700];
        snprintf(path, sizeof path, "%s/%s", out, mine[i]);
        assert_int_equal(write_text_file(path, "mine"), 0);
    }
    assert_int_equal(npg_exporters_clear(out), NPG_OK);
    for (size_t i = 0; i < 5; i++) assert_true(is_there(out, mine[i]));
    assert_false(is_there(out, "motion.glb"));
    assert_false(is_there(out, "reference.obj"));
    assert_false(is_there(out, "exports.partial.jsonl"));
    assert_false(is_there(out, "obj/frame_0010.obj"));
    assert_false(is_there(out, "volumes/frame_0010.vdb"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(help_names_all_of_the_table),
        cmocka_unit_test(the_list_says_what_is_made),
        cmocka_unit_test(what_is_no_form_is_refused),
        cmocka_unit_test(what_a_form_can_not_hold_is_refused),
        cmocka_unit_test(point_caches_repeat_what_is_missing),
        cmocka_unit_test(a_long_capture_becomes_several_glb),
        cmocka_unit_test(colours_of_frames_come_along),
        cmocka_unit_test(colours_and_seams_come_along),
        cmocka_unit_test(level_sets_close_openings),
        cmocka_unit_test(a_rigid_motion_is_found),
        cmocka_unit_test(a_changed_mesh_is_noticed),
        cmocka_unit_test(a_stop_leaves_nothing),
        cmocka_unit_test(a_full_disk_is_said),
        cmocka_unit_test(memory_does_not_grow_with_frames),
        cmocka_unit_test(no_memory_leaves_no_list),
        cmocka_unit_test(clearing_leaves_what_is_not_ours),
    };
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
