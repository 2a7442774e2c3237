/* Mesh: Poisson in its process, the steps to a clean mesh, and the stage. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>
#include <unistd.h>

#include "geometry/geometry.h"
#include "mesh/surface.h"
#include "pipeline/child.h"
#include "pipeline/stage.h"
#include "tests/support/shapes.h"
#include "tests/support/temp_folder.h"
#include "tests/support/test_chain.h"

#define N 3000

extern const npg_stage npg_stage_outlier, npg_stage_mesh;

static float points[3 * N], normals[3 * N];
static const npg_poisson_settings quick = {.depth = 7, .point_weight = 4, .time_limit_s = 60};

/* ---- Poisson ---- */

static npg_mesh *reconstruct(size_t n)
{
    npg_mesh *mesh;
    npg_status status = npg_poisson(&mesh, points, normals, n, &quick);
    if (status) fprintf(stderr, "%s\n", npg_error_text());
    assert_int_equal(status, NPG_OK);
    return mesh;
}

static int euler(const npg_mesh *mesh)
{
    npg_manifold m;
    assert_int_equal(npg_mesh_manifold(&m, mesh), NPG_OK);
    assert_int_equal(m.border_edges + m.crowded_edges + m.misoriented_edges, 0);
    return (int)mesh->vert_count - (int)m.edge_count + (int)mesh->face_count;
}

static void sphere_and_torus_have_their_volumes(void **state)
{
    (void)state;
    shape_random r = {1};
    shape_sphere(points, normals, N, 1, &r);
    npg_mesh *mesh = reconstruct(N);
    assert_true(fabs(npg_mesh_volume(mesh) - 4.18879) < 0.03);
    assert_true(fabs(npg_mesh_area(mesh) - 12.5664) < 0.15);
    assert_int_equal(euler(mesh), 2);
    npg_mesh_unref(&mesh);
    shape_torus(points, normals, N, 1, 0.3, &r);
    mesh = reconstruct(N);
    assert_true(fabs(npg_mesh_volume(mesh) - 2 * 9.8696 * 0.09) < 0.03);
    assert_int_equal(euler(mesh), 0);
    npg_mesh_unref(&mesh);
}

static void a_thin_plate_keeps_two_sheets(void **state)
{
    (void)state;
    const double half[3] = {1, 0.8, 0.06};
    shape_random r = {2};
    shape_box(points, normals, N, half, &r);
    npg_mesh *mesh = reconstruct(N);
    assert_true(fabs(npg_mesh_volume(mesh) - 8 * half[0] * half[1] * half[2]) < 0.06);
    npg_mesh_unref(&mesh);
}

static void the_same_mesh_every_time(void **state)
{
    (void)state;
    shape_random r = {3};
    shape_torus(points, normals, N, 1, 0.3, &r);
    npg_mesh *a = reconstruct(N), *b = reconstruct(N);
    assert_int_equal(a->vert_count, b->vert_count);
    assert_memory_equal(a->vert_pos, b->vert_pos, a->vert_count * 12);
    assert_memory_equal(a->faces, b->faces, a->face_count * 12);
    npg_mesh_unref(&a);
    npg_mesh_unref(&b);
}

static void expect_refusal(size_t n, npg_status expected, const char *words)
{
    npg_mesh *mesh = (npg_mesh *)1;
    npg_status status = npg_poisson(&mesh, points, normals, n, &quick);
    assert_int_equal(status, expected);
    assert_null(mesh);
    if (!strstr(npg_error_text(), words)) fail_msg("\"%s\" does not say \"%s\"", npg_error_text(), words);
}

static void bad_clouds_are_refused(void **state)
{
    (void)state;
    shape_random r = {4};
    shape_sphere(points, normals, N, 1, &r);
    expect_refusal(3, NPG_BAD_INPUT, "3 points are too few");
    points[3 * 77 + 1] = NAN;
    expect_refusal(N, NPG_BAD_INPUT, "point 77 is not finite");
    points[3 * 77 + 1] = 0;
    normals[3 * 5] = 9;
    expect_refusal(N, NPG_BAD_INPUT, "normal of point 5");
    shape_sphere(points, normals, N, 1, &r);
    for (size_t i = 0; i < 3 * N; i++)
        if (i / 3 % 2) normals[i] = -normals[i];
    expect_refusal(N, NPG_BAD_INPUT, "contradict each other");
    shape_sphere(points, normals, N, 1, &r);
    for (size_t i = 0; i < 3 * N; i++) normals[i] = -normals[i];
    expect_refusal(N, NPG_FAILED, "inside out");
    for (size_t i = 0; i < N; i++) shape_put(normals + 3 * i, 0, 0, 1);
    expect_refusal(N, NPG_BAD_INPUT, "one plane");
    shape_sphere(points, normals, N, 1, &r);
    memset(points, 0, sizeof points);
    expect_refusal(N, NPG_BAD_INPUT, "in one place");
}

/* ---- the child process ---- */

static npg_status run_script(npg_child_result *result, const temp_folder *folder, const char *body,
                             double limit_s, const char *input, size_t input_size)
{
    char program[600], text[1000];
    /* The path of a helper may be absolute, which the search takes as it is. */
    snprintf(program, sizeof program, "%s", in_folder(folder, "helper"));
    snprintf(text, sizeof text, "#!/bin/sh\n%s\n", body);
    assert_int_equal(write_text_file(program, text), 0);
    assert_int_equal(chmod(program, 0755), 0);
    npg_child_job job = {.program = program,
                         .input = {input, NULL},
                         .input_size = {input_size, 0},
                         .output_max = 1 << 20,
                         .time_limit_s = limit_s};
    return npg_child_run(result, &job);
}

static void children_end_in_every_way(void **state)
{
    (void)state;
    temp_folder folder;
    npg_child_result result;
    static char much[1 << 20];
    assert_int_equal(open_temp_folder(&folder), 0);
    assert_int_equal(run_script(&result, &folder, "tr a-z A-Z", 20, "hello", 5), NPG_OK);
    assert_int_equal(result.output_size, 5);
    assert_memory_equal(result.output, "HELLO", 5);
    npg_release(&result.output);
    assert_int_equal(run_script(&result, &folder, "echo first >&2; echo last words >&2; exit 9", 20, "", 0),
                     NPG_FAILED);
    assert_non_null(strstr(npg_error_text(), "exit code 9: last words"));
    assert_int_equal(run_script(&result, &folder, "exit 6", 20, "", 0), NPG_MEMORY);
    assert_int_equal(run_script(&result, &folder, "kill -SEGV $$", 20, "", 0), NPG_FAILED);
    assert_non_null(strstr(npg_error_text(), "killed by signal 11"));
    assert_int_equal(run_script(&result, &folder, "exec sleep 100", 0.3, "", 0), NPG_FAILED);
    assert_non_null(strstr(npg_error_text(), "not done after 0.3 s"));
    /* ends without reading: the write must neither kill us nor block */
    assert_int_equal(run_script(&result, &folder, "exec 0<&-; exit 0", 20, much, sizeof much), NPG_OK);
    npg_release(&result.output);
    assert_int_equal(run_script(&result, &folder, "head -c 3000000 /dev/zero", 20, "", 0), NPG_FAILED);
    assert_non_null(strstr(npg_error_text(), "more than 1048576 bytes"));
    npg_child_job none = {.program = "neupig-none", .time_limit_s = 1};
    assert_int_equal(npg_child_run(&result, &none), NPG_FAILED);
    assert_non_null(strstr(npg_error_text(), "neupig-none"));
    close_temp_folder(&folder);
}

static void expect_wait_policy(const temp_folder *folder, const char *expected)
{
    npg_child_result result;
    assert_int_equal(run_script(&result, folder, "printf %s \"$OMP_WAIT_POLICY$NPG_TEST_SEEN\"", 20, "", 0),
                     NPG_OK);
    assert_int_equal(result.output_size, strlen(expected));
    assert_memory_equal(result.output, expected, strlen(expected));
    npg_release(&result.output);
}

static void threads_of_a_child_wait_asleep(void **state)
{
    (void)state;
    temp_folder folder;
    assert_int_equal(open_temp_folder(&folder), 0);
    unsetenv("OMP_WAIT_POLICY");
    setenv("NPG_TEST_SEEN", ", seen", 1);
    expect_wait_policy(&folder, "passive, seen");
    setenv("OMP_WAIT_POLICY", "active", 1);
    expect_wait_policy(&folder, "active, seen");
    unsetenv("OMP_WAIT_POLICY");
    close_temp_folder(&folder);
}

static void answers_that_are_not_whole_are_refused(void **state)
{
    (void)state;
    temp_folder folder;
    shape_random r = {5};
    npg_mesh *mesh;
    assert_int_equal(open_temp_folder(&folder), 0);
    const char *program = in_folder(&folder, "helper");
    npg_poisson_settings settings = quick;
    settings.program = program;
    shape_sphere(points, normals, N, 1, &r);
    assert_int_equal(write_text_file(program, "#!/bin/sh\ncat >/dev/null\n"), 0);
    assert_int_equal(chmod(program, 0755), 0);
    assert_int_equal(npg_poisson(&mesh, points, normals, N, &settings), NPG_FAILED);
    assert_non_null(strstr(npg_error_text(), "0 bytes"));
    assert_int_equal(write_text_file(program, "#!/bin/sh\ncat >/dev/null; head -c 500 /dev/zero\n"), 0);
    assert_int_equal(npg_poisson(&mesh, points, normals, N, &settings), NPG_FAILED);
    assert_non_null(strstr(npg_error_text(), "not whole"));
    assert_int_equal(write_text_file(program, "#!/bin/sh\ncat >/dev/null; kill -KILL $$\n"), 0);
    assert_int_equal(npg_poisson(&mesh, points, normals, N, &settings), NPG_FAILED);
    assert_non_null(strstr(npg_error_text(), "killed by signal 9"));
    close_temp_folder(&folder);
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
static void the_memory_limit_holds(void **state)
{
    (void)state;
    npg_mesh *mesh;
    shape_random r = {6};
    npg_poisson_settings settings = quick;
    settings.memory_limit = (size_t)1 << 20;
    shape_sphere(points, normals, N, 1, &r);
    npg_status status = npg_poisson(&mesh, points, normals, N, &settings);
    assert_true(status == NPG_MEMORY || status == NPG_FAILED);
    assert_null(mesh);
}
#endif

/* ---- steps ---- */

static npg_mesh *mesh_of(const float *vert_pos, size_t vert_count, const uint32_t *faces, size_t face_count)
{
    npg_mesh *mesh;
    assert_int_equal(npg_mesh_open(&mesh, vert_count, face_count), NPG_OK);
    memcpy(mesh->vert_pos, vert_pos, vert_count * 12);
    memcpy(mesh->faces, faces, face_count * 12);
    return mesh;
}

static const float cube_pos[24] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1};
static const uint32_t cube_faces[36] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                        1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7};

static void mending_closes_and_cleans(void **state)
{
    (void)state;
    uint32_t faces[3 * 15];
    npg_mending done;
    memcpy(faces, cube_faces, sizeof cube_faces);
    uint32_t more[9] = {0, 2, 1, /* a copy */ 4, 4, 5, /* degenerate */ 3,
                        0, 4 /* a copy in place of a face */};
    memcpy(faces + 36, more, sizeof more);
    memmove(faces + 6, faces + 9, 36 * sizeof *faces); /* and a face missing: a hole */
    npg_mesh *mesh = mesh_of(cube_pos, 8, faces, 14);
    assert_int_equal(npg_mesh_mend(&mesh, &done), NPG_OK);
    assert_int_equal(done.degenerate, 1);
    assert_int_equal(done.holes, 1);
    assert_true(done.duplicate >= 2);
    assert_int_equal(mesh->face_count, 12);
    assert_int_equal(euler(mesh), 2);
    assert_true(fabs(npg_mesh_volume(mesh) - 1) < 1e-6);
    npg_mesh_unref(&mesh);
}

static void of_shreds_nothing_is_left(void **state)
{
    (void)state;
    static const uint32_t back_to_back[6] = {0, 2, 1, 0, 1, 2};
    npg_mending done;
    npg_pieces pieces;
    npg_mesh *mesh = mesh_of(cube_pos, 8, back_to_back, 2);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(npg_mesh_mend(&mesh, &done), NPG_OK);
        assert_int_equal(done.duplicate, i ? 0 : 2);
        assert_int_equal(npg_mesh_keep_main(&mesh, &pieces, 1), NPG_OK);
        assert_int_equal(pieces.found + pieces.kept, 0);
        assert_int_equal(mesh->face_count, 0);
    }
    npg_mesh_unref(&mesh);
}

static void cubes_that_touch_are_parted(void **state)
{
    (void)state;
    float pos[3 * 14];
    uint32_t faces[72];
    npg_mending done;
    /* the second cube shares the first one's edge 5-6: four faces meet there */
    static const uint32_t second[8] = {5, 8, 9, 6, 10, 11, 12, 13};
    memcpy(pos, cube_pos, sizeof cube_pos);
    for (int i = 0; i < 8; i++)
        for (int a = 0; a < 3; a++)
            pos[3 * second[i] + (uint32_t)a] = cube_pos[3 * i + a] + (a == 1 ? 0.0f : 1.0f);
    memcpy(faces, cube_faces, sizeof cube_faces);
    for (int i = 0; i < 36; i++) faces[36 + i] = second[cube_faces[i]];
    npg_mesh *mesh = mesh_of(pos, 14, faces, 24);
    npg_manifold m;
    assert_int_equal(npg_mesh_manifold(&m, mesh), NPG_OK);
    assert_int_equal(m.crowded_edges, 1);
    assert_int_equal(npg_mesh_mend(&mesh, &done), NPG_OK);
    assert_int_equal(done.split_vertices, 2);
    assert_int_equal(euler(mesh), 4);
    assert_int_equal(mesh->face_count, 24);
    npg_pieces pieces;
    assert_int_equal(npg_mesh_keep_main(&mesh, &pieces, 0), NPG_OK);
    assert_int_equal(pieces.found, 2);
    assert_int_equal(pieces.kept, 1);
    assert_true(fabs(pieces.lost_share - 0.5) < 1e-6);
    npg_mesh_unref(&mesh);
}

static void pieces_near_the_main_one_stay(void **state)
{
    (void)state;
    float pos[3 * 24];
    uint32_t faces[108];
    npg_pieces pieces;
    for (uint32_t k = 0; k < 3; k++) { /* a large cube, a small one near it, a small one far from it */
        float size = k ? 0.3f : 1, shift = k == 0 ? 0 : k == 1 ? 1.05f : 9;
        for (uint32_t i = 0; i < 24; i++) pos[24 * k + i] = size * cube_pos[i] + (i % 3 ? 0 : shift);
        for (uint32_t i = 0; i < 36; i++) faces[36 * k + i] = cube_faces[i] + 8 * k;
    }
    npg_mesh *mesh = mesh_of(pos, 24, faces, 36);
    assert_int_equal(npg_mesh_keep_main(&mesh, &pieces, 1), NPG_OK);
    assert_int_equal(pieces.found, 3);
    assert_int_equal(pieces.kept, 2);
    assert_int_equal(mesh->face_count, 24);
    npg_mesh_unref(&mesh);
}

static void decimation_keeps_the_shape(void **state)
{
    (void)state;
    shape_random r = {7};
    size_t flipped;
    npg_mending done;
    shape_torus(points, normals, N, 1, 0.3, &r);
    npg_mesh *mesh = reconstruct(N);
    double volume = npg_mesh_volume(mesh);
    assert_true(mesh->face_count > 2000);
    assert_int_equal(npg_mesh_decimate(&mesh, 1500), NPG_OK);
    assert_int_equal(npg_mesh_mend(&mesh, &done), NPG_OK);
    assert_true(mesh->face_count <= 1500 && mesh->face_count > 1300);
    assert_true(fabs(npg_mesh_volume(mesh) / volume - 1) < 0.03);
    assert_int_equal(npg_mesh_flipped(&flipped, NULL, mesh), NPG_OK);
    assert_int_equal(flipped, 0);
    assert_int_equal(euler(mesh), 0);
    npg_mesh_unref(&mesh);
}

static void a_folded_face_is_found_and_unfolded(void **state)
{
    (void)state;
    shape_random r = {8};
    npg_mending done;
    size_t flipped;
    shape_sphere(points, normals, N, 1, &r);
    npg_mesh *mesh = reconstruct(N);
    assert_int_equal(npg_mesh_decimate(&mesh, 800), NPG_OK);
    const uint32_t *face = mesh->faces + 3 * 100;
    for (size_t a = 0; a < 3; a++) /* one corner pushed over the opposite edge and beyond */
        mesh->vert_pos[3 * face[0] + a] =
            1.6f * (mesh->vert_pos[3 * face[1] + a] + mesh->vert_pos[3 * face[2] + a]) / 2 -
            0.6f * mesh->vert_pos[3 * face[0] + a];
    assert_int_equal(npg_mesh_flipped(&flipped, NULL, mesh), NPG_OK);
    assert_true(flipped > 0);
    assert_int_equal(npg_mesh_mend(&mesh, &done), NPG_OK);
    assert_true(done.flipped > 0);
    assert_int_equal(npg_mesh_flipped(&flipped, NULL, mesh), NPG_OK);
    assert_int_equal(flipped, 0);
    npg_mesh_unref(&mesh);
}

static void the_first_bad_edge_is_named(void **state)
{
    (void)state;
    const uint32_t fan[9] = {0, 1, 2, 0, 1, 3, 2, 1, 4};
    npg_mesh *mesh = mesh_of(cube_pos, 8, fan, 3);
    assert_int_equal(npg_mesh_require_manifold(mesh, "my.ply"), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "my.ply is not a manifold: faces 0 and 1"));
    assert_non_null(strstr(npg_error_text(), "from vertex 0 to vertex 1"));
    npg_mesh_unref(&mesh);
    mesh = mesh_of(cube_pos, 8, cube_faces, 11); /* open is fine */
    assert_int_equal(npg_mesh_require_manifold(mesh, "my.ply"), NPG_OK);
    npg_mesh_unref(&mesh);
}

/* ---- the stage ---- */

typedef struct outcome {
    int cut; /* only the half that a sensor at z = -5 sees */
    int no_normals;
    int kept;       /* unseen = keep */
    npg_mesh *mesh; /* a copy */
    double unseen;
} outcome;

static npg_status make_frame(npg_frame *frame, npg_facts *facts, int64_t index, void *user)
{
    const outcome *o = user;
    shape_random r = {30};
    npg_bounds bounds = npg_bounds_empty();
    (void)index;
    shape_torus(points, normals, N, 1, 0.3, &r);
    NPG_TRY(npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, N, 12));
    if (!o->no_normals) NPG_TRY(npg_alloc_array(&frame->normals, NPG_FOR_FRAMES, N, 12));
    for (size_t i = 0; i < N; i++) {
        if (o->cut && normals[3 * i + 2] > -0.1f) continue;
        for (size_t a = 0; a < 3; a++) frame->pos_local[3 * frame->point_count + a] = 10 * points[3 * i + a];
        if (!o->no_normals) memcpy(frame->normals + 3 * frame->point_count, normals + 3 * i, 12);
        frame->point_count++;
    }
    frame->is_key = true;
    facts->origin.known = true;
    npg_bounds_add_points(&bounds, frame->pos_local, frame->point_count);
    return npg_frame_box_set(&facts->box, &facts->origin, &bounds);
}

static npg_status see_frame(npg_worker *worker, npg_frame *frame, void *user)
{
    outcome *o = user;
    const npg_facts *facts = npg_worker_facts(worker);
    (void)frame;
    o->unseen = facts->unseen_share;
    return npg_mesh_copy(&o->mesh, facts->reference);
}

static const npg_stage announce = {
    .name = "announce", .help = "", .passes = NPG_PASS_SOLVE, .gives = NPG_FIELD_KEY};

static npg_status pass_on(npg_worker *worker, npg_chunk **chunk)
{
    (void)worker;
    (void)chunk;
    return NPG_OK;
}

static npg_status run_stage(outcome *o, const char *name, const char *value, char text[1024])
{
    npg_stage key = announce;
    key.process = pass_on;
    const npg_stage *const chain[] = {&test_source,    &npg_stage_outlier, &key,
                                      &npg_stage_mesh, &test_sink,         NULL};
    const char *const settings[][2] = {
        {"input", "none"}, {"output", "none"}, {"poisson-depth", "7"},
        {"faces", "3000"}, {name, value},      {o->kept ? "unseen" : NULL, "keep"},
        {NULL, NULL}};
    script = (test_script){1, make_frame, see_frame, o};
    return run_chain(chain, settings, text);
}

static void check_reference(const outcome *o)
{
    size_t flipped;
    const npg_mesh *mesh = o->mesh;
    assert_non_null(mesh);
    assert_true(mesh->face_count <= 3000 && mesh->face_count > 500);
    assert_non_null(mesh->vert_normals);
    assert_int_equal(npg_mesh_require_manifold(mesh, "reference"), NPG_OK);
    assert_int_equal(npg_mesh_flipped(&flipped, NULL, mesh), NPG_OK);
    assert_int_equal(flipped, 0);
    /* unit coordinates: the torus of outer radius 1.3 fills -0.95 .. 0.95 */
    for (size_t i = 0; i < mesh->vert_count; i++) {
        const float *p = mesh->vert_pos + 3 * i;
        double scale = 0.95 / 1.3, ring = hypot((double)p[0], (double)p[1]) - scale;
        if (!o->cut) assert_true(fabs(hypot(ring, (double)p[2]) - 0.3 * scale) < 0.05 * scale);
    }
}

static void the_stage_makes_the_reference(void **state)
{
    (void)state;
    char text[1024];
    for (int no_normals = 0; no_normals < 2; no_normals++) {
        outcome o = {.no_normals = no_normals};
        assert_int_equal(run_stage(&o, "unseen", "auto", text), NPG_OK);
        check_reference(&o);
        assert_int_equal(euler(o.mesh), 0);
        assert_true(o.unseen < 0.02);
        npg_mesh_unref(&o.mesh);
    }
}

/* The sensor saw the lower side alone; what it saw supports surface up to two spacings away. */
static void check_mask(const outcome *o, bool is_kept)
{
    size_t marked = 0;
    assert_non_null(o->mesh->vert_unseen);
    for (size_t i = 0; i < o->mesh->vert_count; i++) {
        float z = o->mesh->vert_pos[3 * i + 2];
        marked += o->mesh->vert_unseen[i];
        if (is_kept && z > 0.25f) assert_true(o->mesh->vert_unseen[i]);
        if (z < -0.1f) assert_false(o->mesh->vert_unseen[i]);
    }
    assert_true(is_kept ? marked > o->mesh->vert_count / 5 : marked < o->mesh->vert_count / 50);
}

static void the_unseen_side_is_told_and_trimmed(void **state)
{
    (void)state;
    char text[1024];
    npg_manifold m;
    for (int keep = 0; keep < 2; keep++) {
        outcome o = {.cut = 1};
        assert_int_equal(run_stage(&o, "unseen", keep ? "keep" : "auto", text), keep ? NPG_PARTIAL : NPG_OK);
        check_reference(&o);
        if (keep) assert_true(o.unseen > 0.25);
        check_mask(&o, keep);
        if (!keep) assert_true(o.unseen < 0.02); /* what is left of the surface was seen */
        assert_int_equal(npg_mesh_manifold(&m, o.mesh), NPG_OK);
        if (!keep) assert_true(m.border_edges > 20);
        npg_mesh_unref(&o.mesh);
    }
}

static void a_bar_for_invented_surface(void **state)
{
    (void)state;
    char text[1024];
    outcome o = {.cut = 1, .kept = 1};
    assert_int_equal(run_stage(&o, "bars.invented", "100", text), NPG_OK);
    assert_true(o.unseen > 0.25);
    npg_mesh_unref(&o.mesh);
}

static void failures_name_the_keyframe(void **state)
{
    (void)state;
    char text[1024];
    temp_folder folder;
    outcome o = {0};
    assert_int_equal(open_temp_folder(&folder), 0);
    const char *path = in_folder(&folder, "bad.obj");
    write_text_file(path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n");
    assert_int_equal(run_stage(&o, "reference", path, text), NPG_BAD_INPUT);
    assert_non_null(strstr(text, "keyframe 0"));
    assert_non_null(strstr(text, "not a manifold"));
    assert_null(o.mesh);
    close_temp_folder(&folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sphere_and_torus_have_their_volumes),
        cmocka_unit_test(a_thin_plate_keeps_two_sheets),
        cmocka_unit_test(the_same_mesh_every_time),
        cmocka_unit_test(bad_clouds_are_refused),
        cmocka_unit_test(children_end_in_every_way),
        cmocka_unit_test(threads_of_a_child_wait_asleep),
        cmocka_unit_test(answers_that_are_not_whole_are_refused),
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
        cmocka_unit_test(the_memory_limit_holds),
#endif
        cmocka_unit_test(mending_closes_and_cleans),
        cmocka_unit_test(of_shreds_nothing_is_left),
        cmocka_unit_test(cubes_that_touch_are_parted),
        cmocka_unit_test(pieces_near_the_main_one_stay),
        cmocka_unit_test(decimation_keeps_the_shape),
        cmocka_unit_test(a_folded_face_is_found_and_unfolded),
        cmocka_unit_test(the_first_bad_edge_is_named),
        cmocka_unit_test(the_stage_makes_the_reference),
        cmocka_unit_test(the_unseen_side_is_told_and_trimmed),
        cmocka_unit_test(a_bar_for_invented_surface),
        cmocka_unit_test(failures_name_the_keyframe)
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
